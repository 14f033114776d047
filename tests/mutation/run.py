"""Do the tests of the guard notice a mistake in it? Each mutant is put to the tests that reach its statement.

    python -m tests.mutation.run --out runs/mutants

Every mutant lives in a process of its own, forked after the tests were collected, with one function replaced. One that
acts when a module is imported gets a process that imports it anew. The first test that fails kills a mutant, and so
does a test that takes ten times as long as it should. A survivor must be explained in `survivors.toml`.
"""

import argparse
import contextlib
import dataclasses
import importlib.util
import json
import os
import pathlib
import random
import resource
import signal
import sys
import time
import tomllib
import types
from collections import Counter

import coverage
import hypothesis
import numpy as np
import pytest

import services.messages
from tests.mutation.mutants import Mutant, mutants

ROOT = pathlib.Path(__file__).resolve().parents[2]
SURVIVORS = pathlib.Path(__file__).with_name("survivors.toml")
MODULES = ("guard", "guard_commands", "guard_conditions", "guard_limits", "guard_motion")
PARTS = ("_limits", "_details", "_envelope", "_commands", "_motion", "", "_faults")
TESTS = [f"tests/services/test_guard{part}.py" for part in PARTS]
SLOW = "whatever_is_asked or any_length_of_block or moves_per_minute_at_the_edge or within_four_fifths"
PYTEST = ["-q", "-x", "--tb=no", "-W", "ignore::pytest.PytestAssertRewriteWarning", "-k", f"not ({SLOW})", *TESTS]
BROKEN = 255
"""Exit code of a process that could not do what it should: no verdict on a mutant."""
ROOM = 1 << 30
"""Memory that a mutant may take beyond what was there (bytes)."""
PRELOADED = (hypothesis, np, services.messages)


def all_mutants() -> list[Mutant]:
    """All mutants of the guard, in order."""
    return [one for name in MODULES for one in mutants(name, (ROOT / "services" / f"{name}.py").read_text())]


class Bench:
    """A pytest session that puts mutants to its tests instead of running them once.

    Parameters
    ----------
    drawn : list of Mutant
        Those to try.
    end : float
        When to stop (s, of the monotonic clock).
    found : callable
        Told each mutant and what became of it; `unreached` if none of the tests comes by.
    """

    def __init__(self, drawn, end, found) -> None:
        self._drawn, self._end, self._found = drawn, end, found
        self._failed, self._kills = False, Counter()

    def pytest_runtest_logreport(self, report) -> None:
        """Remember a failure."""
        self._failed |= report.failed

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session) -> bool:
        """Measure which test reaches what, then try the mutants."""
        reached, seconds = self._measure(session.items)
        whole = next(one for one in all_mutants() if one.scope == "Guard.check")
        if forked(lambda: self._survives(dataclasses.replace(whole, path=None), session.items, seconds)):
            raise SystemExit("the tests must pass in a process of their own, with a function replaced by itself")
        for mutant in self._drawn:
            if time.monotonic() > self._end:
                break
            path = str(ROOT / "services" / f"{mutant.module}.py")
            known = {name for line in mutant.lines for name in reached.get((path, line), ())}
            chosen = [item for item in session.items if item.nodeid in known]
            if not chosen or not mutant.scope:
                self._found(mutant, "unreached")
                continue
            chosen.sort(key=lambda item: (seconds[item.nodeid] + 0.003) / (self._kills[item.nodeid] + 0.1))
            number = forked(lambda chosen=chosen, mutant=mutant: self._survives(mutant, chosen, seconds))
            killer = chosen[number - 2].nodeid if number > 1 else ""
            self._kills[killer] += 1
            self._found(mutant, "survived" if number == 0 else f"killed by {killer or 'time'}")
        return True

    def _measure(self, items):
        watch = coverage.Coverage(data_file=None, include=[str(ROOT / "services" / "guard*.py")])
        seconds = {}
        watch.start()
        for item in items:
            watch.switch_context(item.nodeid)
            begin = time.process_time()
            item.config.hook.pytest_runtest_protocol(item=item, nextitem=None)
            seconds[item.nodeid] = time.process_time() - begin
        watch.stop()
        if self._failed:
            raise SystemExit("the tests must pass before anything is mutated")
        data = watch.get_data()
        reached = {
            (path, line): names
            for path in data.measured_files()
            for line, names in data.contexts_by_lineno(path).items()
        }  # fmt: skip
        return reached, seconds

    def _survives(self, mutant, chosen, seconds) -> int:
        """Return 0 if all tests pass with the mutant, 2 + the number of the first that does not."""
        transplant(mutant)
        for number, item in enumerate(chosen):
            signal.setitimer(signal.ITIMER_PROF, 2.0 + 10.0 * seconds[item.nodeid])
            item.config.hook.pytest_runtest_protocol(item=item, nextitem=None)
            if self._failed:
                return min(2 + number, BROKEN - 1)
        return 0


def forked(action, room: int | None = ROOM) -> int:
    """Return what an action returns in a process of its own; 1 if a signal ends it, such as that of its time limit."""
    child = os.fork()
    if not child:
        number = BROKEN
        with contextlib.suppress(BaseException):
            if room is not None:
                pages = int(pathlib.Path("/proc/self/statm").read_text().split()[0])
                resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + room,) * 2)
            with open(os.devnull, "w") as nowhere:
                os.dup2(nowhere.fileno(), 1)
                os.dup2(nowhere.fileno(), 2)
            number = action()
        os._exit(number)
    status = os.waitpid(child, 0)[1]
    number = os.WEXITSTATUS(status) if os.WIFEXITED(status) else 1
    if number == BROKEN:
        raise SystemExit("a trial could not be made")
    return number


def transplant(mutant: Mutant) -> None:
    """Put the mutated code into the living function."""
    place = sys.modules[f"services.{mutant.module}"]
    *owners, name = mutant.scope.split(".")
    for owner in owners:
        place = vars(place)[owner]
    function = vars(place)[name]
    function = function.fget if isinstance(function, property) else function
    whole = compile(mutant.tree(), function.__code__.co_filename, "exec")
    function.__code__ = _code(whole, mutant.scope)


def _code(code: types.CodeType, name: str) -> types.CodeType:
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            if constant.co_qualname == name:
                return constant
            if name.startswith(f"{constant.co_qualname}."):
                return _code(constant, name)
    raise LookupError(name)


def survives_anew(mutant: Mutant) -> int:
    """Import the mutated module and run all tests; 0 if they pass."""
    name = f"services.{mutant.module}"
    module = importlib.util.module_from_spec(importlib.util.find_spec(name))
    sys.modules[name] = module
    signal.setitimer(signal.ITIMER_PROF, 90.0)
    try:
        exec(compile(mutant.tree(), module.__file__, "exec"), vars(module))
    except Exception:  # it does not even import
        return 1
    setattr(services, mutant.module, module)
    return min(int(pytest.main(PYTEST)), 1)


def main() -> int:
    """Try the mutants and print the score; 0 if every survivor is explained."""
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("--out", type=pathlib.Path, default=ROOT / "runs" / "mutants")
    ask.add_argument("--seconds", type=float, default=float("inf"), help="time for all; the rest is not tried")
    ask.add_argument("--seed", type=int, default=1, help="of the order in which they are tried")
    ask.add_argument("--only", default="", help="those whose name holds this text")
    ask.add_argument("--resume", action="store_true", help="keep what was killed in an earlier run in --out")
    told = ask.parse_args()
    drawn = [one for one in all_mutants() if told.only in one.key]
    total = len(drawn)
    random.Random(told.seed).shuffle(drawn)
    told.out.mkdir(parents=True, exist_ok=True)
    log = told.out / "mutants.jsonl"
    known = {one.key for one in drawn}
    before = [json.loads(line) for line in log.read_text().splitlines()] if told.resume and log.exists() else []
    kept = [line for line in before if line["result"].startswith("killed") and line["key"] in known]
    log.write_text("".join(json.dumps(line) + "\n" for line in kept))
    done = {line["key"] for line in kept}
    tried = {line["key"] for line in before}
    drawn = sorted((one for one in drawn if one.key not in done), key=lambda one: one.key not in tried)

    def found(mutant, result) -> None:
        with log.open("a") as file:
            file.write(json.dumps({"key": mutant.key, "family": mutant.family, "result": result}) + "\n")

    end = time.monotonic() + told.seconds
    share = time.monotonic() + 0.7 * told.seconds  # the rest is for those that need an import of their own
    forked(lambda: int(pytest.main(PYTEST, plugins=[Bench(drawn, share, found)])), room=None)
    lines = [json.loads(line) for line in log.read_text().splitlines()]
    unreached = {line["key"] for line in lines if line["result"] == "unreached"}
    log.write_text("".join(json.dumps(line) + "\n" for line in lines if line["result"] != "unreached"))
    for mutant in drawn:
        if mutant.key in unreached and time.monotonic() < end:
            found(mutant, "survived" if forked(lambda m=mutant: survives_anew(m)) == 0 else "killed anew")
    return score(log, told, total)


def score(log, told, total) -> int:
    """Write and print what came of it."""
    lines = [json.loads(line) for line in log.read_text().splitlines()]
    explained = tomllib.loads(SURVIVORS.read_text())["survivors"]
    left = [line["key"] for line in lines if line["result"] == "survived"]
    open_ = sorted(key for key in left if key not in explained)
    killed = len(lines) - len(left)
    words = [
        f"{killed} of {len(lines)} mutants killed ({100.0 * killed / max(len(lines), 1):.1f} %); {len(left)} survived, "
        f"{len(left) - len(open_)} of them explained; {len(lines)} of {total} tried, seed {told.seed}",
        "| family | killed | tried |", "|---|---:|---:|",
    ]  # fmt: skip
    for family, tried in sorted(Counter(line["family"] for line in lines).items()):
        dead = sum(line["family"] == family and line["result"] != "survived" for line in lines)
        words.append(f"| {family} | {dead} | {tried} |")
    words += [f"unexplained: {key}" for key in open_]
    (told.out / "mutants.md").write_text("\n".join(words) + "\n")
    sys.stdout.write("\n".join(words) + "\n")
    return 1 if open_ or not lines else 0


if __name__ == "__main__":
    sys.exit(main())
