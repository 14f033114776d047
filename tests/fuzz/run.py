"""Throw bytes at every door: good ones, bent. Anything but a polite no, or more than a second, is a finding.

    python -m tests.fuzz.run --runs 1000000

With atheris (`pip install 'antiphase[fuzz]'`) the coverage of each door guides the bending; a finding leaves a file.
Without it, or with `--blind`, it is blind, but seeded: any finding is had again by its seed and number.
"""

import argparse
import importlib.util
import mmap
import os
import pathlib
import re
import signal
import struct
import subprocess
import sys
import tempfile
import time
import traceback

import numpy as np

from tests.fuzz.targets import NO, Door, doors

WORDS = (
    b"\x00", b"\xff", b"\xff\xff\xff\xff", b"\x00\x00\x00\x80", b"\xff\xff\xff\x7f", b"\x00" * 8, b"NaN", b"inf",
    b"-1", b"1e400", b"0", b"99999999999999999999", b"\n", b"\t", b",", b";", b'"', b"[", b"{", b"=", b"\xf0\x7f",
    b"true", b"null", b"[[", b"]]", b"'''", b"-", b"e", b".",
)  # fmt: skip


class SlowError(BaseException):
    """An input took too long."""


def bent(seeds: tuple[bytes, ...], rng: np.random.Generator) -> bytes:
    """Return one of the seeds with one to eight changes."""
    data = bytearray(seeds[rng.integers(len(seeds))])
    for _ in range(int(rng.integers(1, 9))):
        at = int(rng.integers(len(data) + 1))
        length = int(rng.integers(1, 33))
        kind = rng.integers(8)
        if kind == 0 and at < len(data):
            data[at] ^= 1 << int(rng.integers(8))
        elif kind == 1:
            data[at : at + length] = rng.bytes(length)
        elif kind == 2:
            del data[at : at + length]
        elif kind == 3:
            data[at:at] = data[at : at + length]
        elif kind == 4:
            word = WORDS[rng.integers(len(WORDS))]
            data[at : at + len(word) * int(rng.integers(2))] = word
        elif kind == 5:
            other = seeds[rng.integers(len(seeds))]
            begin = int(rng.integers(len(other) + 1))
            data[at : at + length] = other[begin : begin + length]
        elif kind == 6 and rng.random() < 0.1:
            del data[at:]
        elif kind == 7 and at < len(data):
            data[at] = int(data[at] + rng.integers(-3, 4)) % 256
    return bytes(data)


def _ring(*_: object) -> None:
    raise SlowError


def survived(name: str, runs: int, seed: int, seconds: float = float("inf")) -> tuple[int, list[str]]:
    """As `tried`, in processes of their own: an input that kills one is a finding too."""
    end, findings, place = time.monotonic() + seconds, [], 0
    door = doors()[name]  # made once, and before any fork
    with tempfile.NamedTemporaryFile("r+") as told, mmap.mmap(-1, 8) as counter:
        while place < runs:
            child = os.fork()
            if not child:
                code = 1
                try:
                    left = end - time.monotonic()
                    count, found = tried(door, name, runs, seed, left, first=place, counter=counter)
                    told.write("".join(f"{line}\n" for line in found))
                    struct.pack_into("q", counter, 0, count)
                    code = 0
                except BaseException:
                    told.write(traceback.format_exc())
                finally:
                    told.flush()
                    os._exit(code)
            status = os.waitpid(child, 0)[1]
            place = max(place, struct.unpack_from("q", counter, 0)[0])
            if not status:
                break
            findings.append(f"{name} seed {seed} input {place}: the process died ({os.waitstatus_to_exitcode(status)})")
            place += 1
        told.seek(0)
        return place, findings + told.read().splitlines()


def tried(
    door: Door, name: str, runs: int, seed: int, seconds: float = float("inf"), first: int = 0,
    counter: mmap.mmap | None = None,
) -> tuple[int, list[str]]:  # fmt: skip
    """Bend and throw; returns how many were thrown and what was found.

    Parameters
    ----------
    door : Door
        Where to throw.
    name : str
        Of the door.
    runs : int
        Most inputs.
    seed : int
        Of the bending.
    seconds : float
        Longest time for all (s).
    first : int
        Number of the first input.
    counter : mmap or None
        Told the number of each input before it is thrown.
    """
    found, known = [], set()
    signal.signal(signal.SIGPROF, _ring)
    end = time.monotonic() + seconds
    for number in range(first, runs):
        if counter is not None:
            struct.pack_into("q", counter, 0, number)
        if time.monotonic() > end:
            return number, found
        data = bent(door.seeds, np.random.default_rng([seed, number]))
        signal.setitimer(signal.ITIMER_PROF, door.slowest_s)
        signal.setitimer(signal.ITIMER_VIRTUAL, 3.0 * door.slowest_s)  # ends the process where no exception can
        try:
            with np.errstate(all="ignore"):
                door.open(data)
        except NO:
            pass
        except (Exception, SlowError) as error:
            frames = traceback.extract_tb(error.__traceback__)
            own = [one for one in frames if "site-packages" not in one.filename and one.name != "_ring"]
            where = f"{pathlib.Path(own[-1].filename).name}:{own[-1].lineno}"
            if (type(error), where) not in known:
                known.add((type(error), where))
                found.append(f"{name} seed {seed} input {number}: {type(error).__name__} at {where}: {error!s:.160}")
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0.0)
            signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
    return runs, found


def guided(name: str, runs: int, seed: int, seconds: float, folder: pathlib.Path) -> tuple[int, list[str]]:
    """Let atheris bend, in a process of its own; returns how many were thrown and what was found."""
    given = name, folder, runs, seed, int(min(seconds, 1e6))
    command = [sys.executable, "-m", "tests.fuzz.guided", *map(str, given)]
    done = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)
    count = re.search(r"number_of_executed_units: (\d+)", done.stderr)
    found = re.findall(r"(?:Uncaught Python exception|ERROR: libFuzzer).*(?:\n.*){0,4}", done.stderr)
    lines = [f"{name}: {' '.join(text.split())[:300]}" for text in found]
    if done.returncode and not lines:
        lines = [f"{name}: ended with {done.returncode}: {done.stderr[-300:]}"]
    return int(count[1]) if count else 0, lines


def main() -> int:
    """Fuzz all doors, or one; 1 if anything was found."""
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("--runs", type=int, default=1_000_000, help="inputs for all doors together")
    ask.add_argument("--seed", type=int, default=1)
    ask.add_argument("--only", default="", help="name of one door, which then gets its share")
    ask.add_argument("--seconds", type=float, default=float("inf"), help="longest time for each door")
    ask.add_argument("--blind", action="store_true", help="do without atheris")
    ask.add_argument("--out", type=pathlib.Path, default=pathlib.Path("runs/fuzz"), help="for what atheris learns")
    told = ask.parse_args()
    blind = told.blind or importlib.util.find_spec("atheris") is None
    names = {name: door.share for name, door in doors().items() if told.only in ("", name)}
    thrown, findings = 0, []
    for name, share in names.items():
        begin = time.monotonic()
        given = name, round(told.runs * share), told.seed, told.seconds
        count, found = survived(*given) if blind else guided(*given, told.out)
        thrown, findings = thrown + count, findings + found
        line = f"{name}: {count} inputs in {time.monotonic() - begin:.0f} s, {len(found)} findings"
        sys.stdout.write("\n".join([line, *found]) + "\n")
        sys.stdout.flush()
    sys.stdout.write(f"{thrown} inputs{', blind' if blind else ', guided by coverage'}, {len(findings)} findings\n")
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main())
