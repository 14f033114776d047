"""Verbs that show a running machine: `dashboard` and `watch`."""

from __future__ import annotations

import re
import sys
from typing import TYPE_CHECKING, Annotated, Any

import typer

from services.cli.app import JsonFlag, app, emit, positive
from services.cli.services import CLOSING_S, Connect, IdentityDir, MachineName, home, known_as
from services.clock import WallClock
from services.config import load_case
from services.errors import InputError, RefusalError
from services.process import Stopped, StopSignal, end_within
from services.zenoh_bus import check_endpoint, check_machine

if TYPE_CHECKING:
    from services.dashboard.feed import BusFeed

ShownCase = Annotated[str, typer.Argument(help="What is taken to be cut until the machine tells its own case.")]


@app.command()
def dashboard(
    case: ShownCase = "thesis-652",
    connect: Connect = None,
    name: MachineName = None,
    identity: IdentityDir = None,
    host: Annotated[str, typer.Option("--host", help="Where to serve: an address of this host.")] = "127.0.0.1",
    port: Annotated[int, typer.Option("--port", help="Port; 0: a free one.")] = 8080,
    allow_control: Annotated[
        bool, typer.Option("--allow-control", help="Let whoever has the printed link arm, disarm, stop and reset.")
    ] = False,
    allow_origin: Annotated[
        list[str] | None,
        typer.Option("--allow-origin", help="Another page that may read the frames, such as `null`: a file."),
    ] = None,
    as_json: JsonFlag = False,
) -> None:
    """Serve a page that shows a running machine, until stopped; nothing is fetched from elsewhere."""
    from services.dashboard.control import Control
    from services.dashboard.facts import Facts
    from services.dashboard.feed import BusFeed
    from services.dashboard.hub import Hub
    from services.dashboard.server import make_app, open_socket, serve
    from services.dashboard.view import View

    config, clock = load_case(case), WallClock()
    origins = tuple(map(_check_origin, allow_origin or ()))
    machine = check_machine(name or config.settings.machine)
    known = known_as("dashboard", identity)
    operator = known_as("operator", identity) if allow_control else None
    endpoint = check_endpoint("connect", connect or home(known))
    with open_socket(host, port) as listening, StopSignal():
        where = _address(listening.getsockname())
        feed = BusFeed(machine, endpoint, known, operator)
        try:
            hub = Hub(View(Facts.of(config, machine), clock), feed, clock)
            control = Control(hub) if allow_control else None
            link = f"{where}/#token={control.token}" if control else f"{where}/"
            answer: dict[str, Any] = {"url": f"{where}/", "machine": machine, "endpoint": endpoint, "control": link}
            if control is None:
                del answer["control"]
            emit(answer, f"{machine} at {endpoint}: open {link}", as_json)
            sys.stdout.flush()
            serve(make_app(hub, control, host, origins), listening)
        finally:
            _leave(feed)


@app.command()
def watch(
    case: ShownCase = "thesis-652",
    connect: Connect = None,
    name: MachineName = None,
    identity: IdentityDir = None,
    once: Annotated[bool, typer.Option("--once", help="Say what is known, and end.")] = False,
    wait_s: Annotated[float, typer.Option("--wait-s", help="--once: how long to wait for the machine (s).")] = 3.0,
    as_json: JsonFlag = False,
) -> None:
    """Show a running machine in the terminal, until stopped."""
    from rich.console import Console

    from services.dashboard.facts import Facts
    from services.dashboard.feed import BusFeed
    from services.dashboard.terminal import Watcher
    from services.dashboard.view import View

    config, clock = load_case(case), WallClock()
    machine = check_machine(name or config.settings.machine)
    known = known_as("watch", identity)
    endpoint = check_endpoint("connect", connect or home(known))
    positive("wait-s", wait_s, "s")
    if as_json and not once:
        raise InputError("json", True, "given together with --once: a screen is no object")
    console = Console()
    feed = BusFeed(machine, endpoint, known)
    try:
        with StopSignal() as stop:
            watcher = Watcher(View(Facts.of(config, machine), clock), feed, clock)
            if not once:
                watcher.live(console, stop)
                return
            state = watcher.once(wait_s, stop)
        if state["age_ms"] is None:
            raise RefusalError(f"{state['word'].lower()}: {state['detail']} ({machine} at {endpoint})", state)
        emit(state, "", as_json=True) if as_json else console.print(watcher.draw(*console.size))
    except Stopped:
        pass
    finally:
        _leave(feed)


def _leave(feed: BusFeed) -> None:
    """Close the bus, which may not hang."""
    deadline = end_within(CLOSING_S, 1)
    feed.close()
    deadline.cancel()


def _check_origin(origin: str) -> str:
    if origin == "null" or re.fullmatch(r"https?://[^/\s]+", origin):
        return origin
    raise InputError("allow-origin", origin, "`null` (a file) or the origin of a page, such as http://127.0.0.1:9000")


def _address(name: tuple[Any, ...]) -> str:
    host = f"[{name[0]}]" if ":" in name[0] else name[0]
    return f"http://{host}:{name[1]}"
