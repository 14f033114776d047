"""Verbs of the services on the bus: `machine`, `monitor`, `controller`, `router`, `operator` and `up`."""

from __future__ import annotations

import pathlib
import sys
import uuid
from collections.abc import Callable, Generator
from contextlib import contextmanager, redirect_stdout
from typing import Annotated, Any

import typer

from services.bus import Node
from services.cli.app import (
    Adapter,
    JsonFlag,
    LinuxcncDir,
    Seed,
    Sensitivity,
    app,
    console,
    emit,
    positive,
    require,
    sensitive,
)
from services.clock import WallClock, utc_now
from services.config import Case, load_case
from services.doubts import doubts_of, notes, refusing
from services.errors import InputError
from services.messages import Event
from services.process import Parent, Stopped, StopSignal, end_within
from services.security.identity import Identity, load_identity
from services.security.rights import ROUTER
from services.zenoh_bus import DEFAULT_ENDPOINT, SECURE_ENDPOINT, ZenohBus, check_machine

CaseName = Annotated[str, typer.Argument(help="Name of a shipped case, or path of a TOML file.")]
Connect = Annotated[
    str | None,
    typer.Option("--connect", help=f"The router (default: {DEFAULT_ENDPOINT}, which `antiphase machine` holds)."),
]
Listen = Annotated[
    str | None, typer.Option("--listen", help="Hold the router here instead of connecting to one; port 0: a free one.")
]
MachineName = Annotated[str | None, typer.Option("--machine", help="Name of the machine (default: the case's).")]
IdentityDir = Annotated[
    pathlib.Path | None,
    typer.Option("--identity", help="Folder of certificates (`antiphase certs`); the bus is then at tls/HOST:PORT."),
]
Machines = Annotated[
    list[str] | None,
    typer.Option("--machine", help="Name of the machine (default: the case's); several times: one process for all."),
]
ArmAfter = Annotated[
    float | None,
    typer.Option("--arm-after-s", help="Arm the guard this long after the start (s); default: OFF until asked."),
]
Child = Annotated[bool, typer.Option("--child", hidden=True, help="Stop when standard input ends.")]
Reserve = Annotated[bool, typer.Option("--reserve", hidden=True, help="Prepare, then wait for `go` on standard input.")]
AdviseOnly = Annotated[
    bool, typer.Option("--advise-only", help="Say what the controller would command, and command nothing.")
]
Shelf = Annotated[pathlib.Path | None, typer.Option("--shelf", hidden=True, help="Folder for what was learned.")]
Attach = Annotated[
    bool, typer.Option("--attach", help="LinuxCNC runs already, is on and homed; its program is started there.")
]
CLOSING_S = 3.0


def say(text: str) -> None:
    """Tell the terminal what happens."""
    console.print(text, markup=False, highlight=False, soft_wrap=True)


@contextmanager
def on_bus(
    machine: str, connect: str | None, listen: str | None, stop: StopSignal, identity: Identity | None = None
) -> Generator[ZenohBus]:
    """Open a bus, and close it whatever happens; closing may not hang."""
    if listen is not None and connect is not None:
        raise InputError("listen", listen, "left out when --connect is given: one router is enough")
    if listen is not None and identity is not None:
        raise InputError("listen", listen, "left out with --identity: let `antiphase router` listen, it tells refusals")
    if listen is not None:
        bus = ZenohBus.router(machine, listen)
    else:
        endpoint = connect or home(identity)
        bus = ZenohBus.client(machine, endpoint, _patience(endpoint, stop), identity)
    try:
        yield bus
    finally:
        deadline = end_within(CLOSING_S, 1)
        bus.close()
        deadline.cancel()


def home(identity: Identity | None) -> str:
    """Return where the router is when nobody says so."""
    return DEFAULT_ENDPOINT if identity is None else SECURE_ENDPOINT


def known_as(role: str, folder: pathlib.Path | None) -> Identity | None:
    """Return the identity of a role from a folder of certificates, None without one."""
    return None if folder is None else load_identity(folder, role, utc_now())


def _patience(endpoint: str, stop: StopSignal) -> Callable[[], None]:
    said: list[str] = []

    def wait() -> None:
        stop.check()
        if not said:
            said.append(endpoint)
            say(f"nobody listens at {endpoint} yet; waiting (`antiphase machine` or `antiphase router` does)")

    return wait


@app.command()
def machine(
    case: CaseName = "thesis-652",
    connect: Connect = None,
    listen: Listen = None,
    name: MachineName = None,
    seed: Seed = None,
    duration_s: Annotated[
        float | None, typer.Option("--duration-s", help="How long (s); default: as long as the case.")
    ] = None,
    forever: Annotated[bool, typer.Option("--forever", help="Until stopped.")] = False,
    arm_after_s: ArmAfter = None,
    event_log: Annotated[
        pathlib.Path | None, typer.Option("--event-log", help="File to which every event is appended, for the audit.")
    ] = None,
    wait_s: Annotated[float, typer.Option("--wait-s", help="How long to wait for monitor and controller (s).")] = 120.0,
    identity: IdentityDir = None,
    adapter: Adapter = "simulator",
    linuxcnc: LinuxcncDir = None,
    attach: Attach = False,
    trace: Annotated[
        pathlib.Path | None, typer.Option("--trace", help="CSV of what LinuxCNC did in every servo cycle.")
    ] = None,
    as_json: JsonFlag = False,
    child: Child = False,
    latencies: Annotated[bool, typer.Option("--latencies", hidden=True, help="Every latency in the JSON.")] = False,
) -> None:
    """Be the (simulated) machine in real time. Without --connect it holds the router that the others connect to."""
    from services.closed_loop import blocks_of
    from services.machines.adapters import Choice, open_machine
    from services.messages import BLOCK_S
    from services.pace import Paced, PacedMachine

    config = load_case(case)
    choice = Choice(adapter=adapter, folder=linuxcnc, attach=attach, trace=trace)
    positive("wait-s", wait_s, "s")
    blocks = None if forever else blocks_of(config)
    if duration_s is not None and not forever:
        blocks = max(1, round(positive("duration-s", duration_s, "s") / BLOCK_S))
    if arm_after_s is not None:
        require("arm-after-s", arm_after_s, "0 s or more", arm_after_s >= 0)
    run, used = str(uuid.uuid4()), config.settings.seed if seed is None else seed
    answer: dict[str, Any] = {}
    with StopSignal() as stop, _stoppable():
        if child:
            Parent()
        known = known_as("machine", identity)
        where = listen or (None if connect or known else DEFAULT_ENDPOINT)
        with on_bus(check_machine(name or config.settings.machine), connect, where, stop, known) as bus:
            bus.serve_config(config.text)
            say("\n".join(("limits of the guard:", *config.limits.describe())) + notes(doubts_of(config)))
            if arm_after_s is None:
                say("the guard is OFF until `antiphase operator arm` (or --arm-after-s)")
            armed = None if arm_after_s is None else round(arm_after_s / BLOCK_S)
            with _audit(event_log, config, run) as log, open_machine(choice, config, used, run) as node:
                paced = PacedMachine(node, bus, run, clock=WallClock(), stop=stop, say=say, log=log)
                with refusing(config, Paced().summary(False)):
                    counts = paced.run(blocks, arm_block=armed, wait_s=wait_s)
            answer = {"service": "machine", "machine": bus.machine, "run": run, "case": config.name, "seed": used}
            answer |= counts.summary(latencies) | {"endpoint": bus.endpoint} | paced.noticed() | node.summary()
    emit(answer, _words(answer), as_json)


@contextmanager
def _audit(path: pathlib.Path | None, case: Case, run: str) -> Generator[Callable[[Event], None] | None]:
    """Keep the audit log of a run, and say when it is incomplete."""
    from services.event_log import EventLog

    if path is None:
        yield None
        return
    with EventLog(path) as log:
        log.begin(case, run)
        yield log.write
    if log.failure:
        say(f"the event log is incomplete: {log.failure}")


@app.command()
def monitor(
    case: CaseName = "thesis-652",
    connect: Connect = None,
    listen: Listen = None,
    name: Machines = None,
    identity: IdentityDir = None,
    sensitivity: Sensitivity = None,
    as_json: JsonFlag = False,
    child: Child = False,
    reserve: Reserve = False,
    shelf: Shelf = None,
) -> int:
    """Watch the servo signals of a machine for chatter, until stopped."""
    config = load_case(case, sensitive(sensitivity))

    def make(run: str) -> Node:
        from services.nodes.monitor import MonitorNode

        return MonitorNode(config, run)

    known = known_as("monitor", identity)
    return _follow(
        "monitor", config, make, connect, listen, name, known, as_json=as_json, child=child, reserve=reserve,
        shelf=shelf,
    )  # fmt: skip


@app.command()
def controller(
    case: CaseName = "thesis-652",
    connect: Connect = None,
    listen: Listen = None,
    name: Machines = None,
    identity: IdentityDir = None,
    as_json: JsonFlag = False,
    child: Child = False,
    reserve: Reserve = False,
    advise_only: AdviseOnly = False,
) -> int:
    """Decide where turret 1 shall stand after each report of the monitor, until stopped."""
    config = load_case(case)

    def make(run: str) -> Node:
        from services.nodes.controller import ControllerNode

        return ControllerNode(config, run, advise_only)

    known = known_as("controller", identity)
    return _follow(
        "controller", config, make, connect, listen, name, known, as_json=as_json, child=child, reserve=reserve
    )


def _follow(
    service: str,
    config: Case,
    make: Callable[[str], Node],
    connect: str | None,
    listen: str | None,
    names: list[str] | None,
    identity: Identity | None,
    *,
    as_json: bool,
    child: bool,
    reserve: bool,
    shelf: pathlib.Path | None = None,
) -> int:
    from services.node import run_node
    from services.shelf import Shelf

    machines = [check_machine(name) for name in dict.fromkeys(names or [config.settings.machine])]
    answer: dict[str, Any] = {"service": service, "machine": machines[0], "run": None}
    with StopSignal() as stop, _stoppable():
        parent = Parent() if child or reserve else None
        if reserve and parent is not None:
            make("").prepare()
            emit({"service": service, "stands_by": True}, "", True)
            sys.stdout.flush()
            with stop.waiting():
                parent.wait()
        if len(machines) > 1:
            fleet = _fleet(service, make, machines, connect, listen, stop, identity)
            emit({"service": service, "machines": fleet}, "\n".join(map(_words, fleet)), as_json)
            return 1 if any("failure" in one for one in fleet) else 0
        with on_bus(machines[0], connect, listen, stop, identity) as bus:
            kept = Shelf(shelf) if shelf else None
            answer |= run_node(service, make, bus, clock=WallClock(), stop=stop, say=say, shelf=kept)
    emit(answer, _words(answer), as_json)
    return 0


def _fleet(
    service: str,
    make: Callable[[str], Node],
    machines: list[str],
    connect: str | None,
    listen: str | None,
    stop: StopSignal,
    identity: Identity | None,
) -> list[dict[str, Any]]:
    """Serve several machines behind one router."""
    from services.fleet import run_fleet

    if listen is not None:
        raise InputError("listen", listen, "left out with several machines: `antiphase router` holds the router")
    endpoint = connect or home(identity)
    patience = _patience(endpoint, stop)
    buses = [ZenohBus.client(machine, endpoint, patience, identity) for machine in machines]
    try:
        return run_fleet(service, make, buses, clock=WallClock(), stop=stop, say=say)
    finally:
        deadline = end_within(CLOSING_S, 1)
        for bus in buses:
            bus.close()
        deadline.cancel()


@contextmanager
def _stoppable() -> Generator[None]:
    """Being stopped before there was anything to do is no error."""
    try:
        yield
    except Stopped:
        say("stopped")


def _words(answer: dict[str, Any]) -> str:
    return "\n".join(f"{name}: {value}" for name, value in answer.items() if not isinstance(value, list))


@app.command()
def router(
    listen: Annotated[
        str | None, typer.Option("--listen", help=f"Where; port 0 takes a free one (default: {DEFAULT_ENDPOINT}).")
    ] = None,
    identity: IdentityDir = None,
    as_json: JsonFlag = False,
    child: Child = False,
) -> None:
    """Hold the router alone, until stopped: then machine, monitor and controller may come and go in any order."""
    from services.router import guarded, hold

    with StopSignal() as stop, _stoppable():
        known, out = guarded(identity, lambda text: say(f"refused: {text}"))

        def ready(where: str) -> None:
            with redirect_stdout(out):
                emit({"endpoint": where}, f"router at {where}", as_json)

        hold(listen or home(known), stop, child=child, ready=ready, identity=known)


@app.command()
def up(
    case: CaseName = "thesis-652",
    listen: Annotated[str, typer.Option("--listen", help="Where the router shall be; port 0: a free one.")] = "",
    name: MachineName = None,
    seed: Seed = None,
    duration_s: Annotated[
        float | None, typer.Option("--duration-s", help="How long (s); default: as long as the case.")
    ] = None,
    forever: Annotated[bool, typer.Option("--forever", help="Until stopped.")] = False,
    arm_after_s: ArmAfter = None,
    identity: IdentityDir = None,
    sensitivity: Sensitivity = None,
    advise_only: AdviseOnly = False,
    adapter: Adapter = "simulator",
    linuxcnc: LinuxcncDir = None,
    attach: Attach = False,
    as_json: JsonFlag = False,
) -> None:
    """Start router, machine, monitor and controller, and start again what dies."""
    from services.machines.adapters import Choice, check_choice
    from services.supervisor import Plan, keep_up

    config = load_case(case, sensitive(sensitivity))
    choice = Choice(adapter=adapter, folder=linuxcnc, attach=attach)
    check_choice(choice, config)
    lasts = ["--forever"] if forever else []
    if duration_s is not None and not forever:
        lasts = ["--duration-s", str(positive("duration-s", duration_s, "s"))]
    plan = Plan(
        case=case,
        machine=check_machine(name or config.settings.machine),
        seed=config.settings.seed if seed is None else seed,
        arm_after_s=arm_after_s,
        lasts=(*lasts, *choice.options()),
        identity=identity,
        sensitivity=config.monitor.sensitivity,
        advise_only=advise_only,
    )
    if advise_only and arm_after_s is not None:
        raise InputError("arm-after-s", arm_after_s, "left out with --advise-only: nothing is commanded to a guard")
    say(f"{config.name}: {config.settings.title}" + notes(doubts_of(config)))
    with StopSignal() as stop:
        answer = keep_up(plan, listen or home(known_as(ROUTER, identity)), stop=stop, clock=WallClock(), say=say)
    emit(answer, _words(answer), as_json)
