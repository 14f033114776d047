"""Whether this installation can do its work; each finding says what to do about it."""

from __future__ import annotations

import importlib
import pathlib
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import requires, version

from services.clock import Clock


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One thing that was looked at.

    Attributes
    ----------
    name
        What.
    ok
        Whether it is as it should be.
    detail
        What was found, and what to do when it is not.
    """

    name: str
    ok: bool
    detail: str


def examine(clock: Clock, identity: pathlib.Path | None = None, connect: str | None = None) -> list[Finding]:
    """Look at everything; a check that breaks is a finding, not a crash.

    Parameters
    ----------
    clock
        Monotonic.
    identity
        Folder of certificates, whose rights are tried.
    connect
        Router on which they are tried; None: one of our own.
    """
    checks: dict[str, Callable[[], Finding]] = {
        "python": _python,
        "packages": _packages,
        "cases": _cases,
        "compiled kernels": lambda: _kernels(clock),
        "kernel cache": _cache,
        "clock": lambda: _clock(clock),
        "bus round trip": lambda: _round_trip(clock),
        "writable folder": _folder,
    }
    found: list[Finding] = []
    for name, check in checks.items():
        try:
            found.append(check())
        except Exception as error:  # whatever breaks here is what the user asked about
            found.append(_broken(name, error))
    try:
        return [*found, *_rights(clock, identity, connect)]
    except Exception as error:
        return [*found, _broken("access rights", error)]


def _broken(name: str, error: Exception) -> Finding:
    return Finding(name=name, ok=False, detail=f"{type(error).__name__}: {error}")


def _rights(clock: Clock, identity: pathlib.Path | None, connect: str | None) -> list[Finding]:
    if identity is None:
        open_to = "on plain loopback every program on this computer may say anything; `antiphase certs` closes that"
        return [Finding(name="access rights", ok=True, detail=open_to)]
    from services.clock import utc_now
    from services.security.authority import make_authority
    from services.security.probe import open_probe, probe, stranger_is_refused

    with open_probe(identity, connect) as endpoint, tempfile.TemporaryDirectory() as rogue:
        found = [
            Finding(name=f"rights: {one.role}", ok=one.ok, detail=one.describe())
            for one in probe(identity, endpoint, clock)
        ]
        folder = pathlib.Path(rogue) / "rogue"
        make_authority(folder, 1, utc_now(), roles=("controller",))
        (folder / "authority.pem").write_bytes((identity / "authority.pem").read_bytes())
        refused = stranger_is_refused(folder, endpoint)
    words = "a certificate of another authority is not let in" if refused else "A ROGUE CERTIFICATE IS LET IN"
    return [*found, Finding(name="rights: stranger", ok=refused, detail=words)]


def _python() -> Finding:
    text = ".".join(map(str, sys.version_info[:3]))
    good = sys.version_info >= (3, 11)
    return Finding(name="python", ok=good, detail=text if good else f"{text}; install Python 3.11 or newer")


def _packages() -> Finding:
    needed = [line.split(";")[0] for line in requires("antiphase") or [] if "extra ==" not in line]
    names = [line.split(">")[0].split("=")[0].split("<")[0].strip() for line in needed]
    text = ", ".join(f"{name} {version(name)}" for name in sorted(names))
    return Finding(name="packages", ok=True, detail=text)


def _cases() -> Finding:
    from services.config import load_case, shipped

    names = list(shipped())
    for name in names:
        load_case(name)
    return Finding(name="cases", ok=bool(names), detail=", ".join(names) or "none; install the package again")


def _kernels(clock: Clock) -> Finding:
    from services.closed_loop import Loop
    from services.config import load_case

    begin = clock.now()
    loop = Loop(load_case("thesis-652"), 1, clock)
    compiled = clock.now() - begin
    for number in range(60):
        loop.step(number)
    factor = 0.5 / (loop.tape.wall_s * 50 / 60)
    ready = f"ready in {compiled:.1f} s; the loop runs {factor:.0f} times faster than real time"
    slow = "; real time needs more than 3: close other programs" if factor < 3.0 else ""
    return Finding(name="compiled kernels", ok=factor >= 3.0, detail=ready + slow)


def _cache() -> Finding:
    missing: list[str] = []
    for name in ("chatter._kernels", "turning_sim._kernels"):
        module = importlib.import_module(name)
        folder = pathlib.Path(module.__file__ or ".").parent / "__pycache__"
        if not list(folder.glob("*.nbi")):
            missing.append(str(folder))
    hint = f"nothing stored in {', '.join(missing)}: is it writable? every start will compile anew"
    return Finding(name="kernel cache", ok=not missing, detail=hint if missing else "in place")


def _clock(clock: Clock) -> Finding:
    late: list[float] = []
    for _ in range(50):
        goal = clock.now() + 0.005
        clock.sleep_until(goal)
        late.append(clock.now() - goal)
    worst = 1e3 * max(late)
    hint = "" if worst < 10.0 else "; over 10 ms: commands may come late on this machine, close other programs"
    return Finding(name="clock", ok=worst < 10.0, detail=f"wakes up at most {worst:.1f} ms late{hint}")


def _round_trip(clock: Clock) -> Finding:
    from services.messages import OperatorRequest
    from services.zenoh_bus import ZenohBus

    name = "bus round trip"
    with ZenohBus.router("doctor", "tcp/127.0.0.1:0") as here, ZenohBus.client("doctor", here.endpoint) as there:
        inbox = there.subscribe(OperatorRequest)
        here.offer(OperatorRequest)
        begin = clock.now()
        number = 0
        while clock.now() - begin < 5.0:
            sent = clock.now()
            request = OperatorRequest(run="", source="doctor", sequence=number, request="stop", nonce=str(number))
            here.publish(request)
            clock.sleep_until(clock.now() + 0.002)
            if any(received.message().sequence == number for received in inbox.take()):
                took = 1e3 * (clock.now() - sent)
                return Finding(name=name, ok=True, detail=f"Zenoh on loopback answers within {took:.1f} ms")
            number += 1
    hint = "nothing came back in 5 s: does a firewall block 127.0.0.1?"
    return Finding(name=name, ok=False, detail=hint)


def _folder() -> Finding:
    with tempfile.TemporaryFile(dir="."):
        pass
    return Finding(name="writable folder", ok=True, detail=str(pathlib.Path.cwd()))
