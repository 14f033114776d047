"""Starts the services as processes of their own: once for `demo`, and again whenever one dies for `up`."""

from __future__ import annotations

import pathlib
from collections import Counter, deque
from dataclasses import dataclass, field
from typing import Any

from services.children import Child, end_all, private_folder
from services.clock import Clock, utc_now
from services.errors import InputError, RefusalError
from services.node import Say
from services.process import Stopped, StopSignal, command_line, router_line
from services.security.identity import load_identity
from services.zenoh_bus import ZenohBus

FOLLOWERS = ("monitor", "controller")
SERVICES = ("machine", *FOLLOWERS)
WATCHER = "watch"
"""Identity of the keeper itself: it only looks at who is alive."""
TICK_S = 0.01
START_S = 60.0
"""How long a process may take until it shows a sign of life."""
HUNG_S = 3.0
"""A process without a sign of life for so long, while the router is there, is ended and started again."""
MOST_DEATHS, DEATHS_WITHIN_S = 6, 30.0
"""A service that dies so often within so long is given up."""
RESERVE_AFTER_S = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """What the services are started with.

    Attributes
    ----------
    case
        As on the command line: name of a shipped case or path of a file.
    machine
        Name of the machine.
    seed
        Of the plant's noise.
    arm_after_s
        When the machine arms its guard by itself (s); None: when the operator asks.
    lasts
        Options of `machine` that say how long it goes on, and through which adapter.
    identity
        Folder of certificates; without one only this computer reaches the bus.
    sensitivity
        Of the monitor; None: the case's.
    advise_only
        Whether the controller only says what it would command.
    """

    case: str
    machine: str
    seed: int
    arm_after_s: float | None = None
    lasts: tuple[str, ...] = ()
    identity: pathlib.Path | None = None
    sensitivity: float | None = None
    advise_only: bool = False

    def line(self, service: str, endpoint: str, *more: str) -> list[str]:
        """Return how to start a service that connects to `endpoint`."""
        common = ("--machine", self.machine, "--connect", endpoint, "--json", "--child")
        proof = () if self.identity is None else ("--identity", str(self.identity))
        told = () if self.sensitivity is None or service != "monitor" else (f"--sensitivity={self.sensitivity}",)
        mode = ("--advise-only",) if self.advise_only and service == "controller" else ()
        return command_line(service, self.case, *common, *proof, *told, *mode, *more)

    def router_line(self, endpoint: str) -> list[str]:
        """Return how to start the router."""
        return router_line(endpoint, "" if self.identity is None else str(self.identity))

    def machine_line(self, endpoint: str, *more: str) -> list[str]:
        """Return how to start the machine."""
        return self.line("machine", endpoint, "--seed", str(self.seed), *self.lasts, *more)

    def arming(self) -> tuple[str, ...]:
        """Return the option that arms the guard."""
        return () if self.arm_after_s is None else ("--arm-after-s", str(self.arm_after_s))


@dataclass(slots=True)
class Service:
    """One service: the process that does the work, one in reserve, and what became of those before."""

    child: Child
    spare: Child | None = None
    stands_by: bool = False
    """Whether the one in reserve has compiled everything."""
    alive: bool = False
    seen: bool = False
    """Whether this process has ever shown a sign of life; until then it is starting, which may take long."""
    since: float = 0.0
    """When it was last started, seen to come, or seen to go."""
    deaths: deque[float] = field(default_factory=deque[float])


class Keeper:
    """Keeps router, machine, monitor and controller up.

    The monitor and the controller each have a second process in reserve that has compiled everything: it takes over
    within a fraction of a second, before the guard gives up. A machine that is started again begins a new run with
    its guard OFF: only the operator arms it.
    """

    def __init__(self, plan: Plan, folder: pathlib.Path, *, clock: Clock, say: Say) -> None:
        self._plan, self._folder, self._clock, self._say = plan, folder, clock, say
        self._shelf = folder / "shelf"
        self._shelf.mkdir()
        self.services: dict[str, Service] = {}
        self.restarts: Counter[str] = Counter()
        self.endpoint = ""
        self._router: Child | None = None
        self._router_deaths: deque[float] = deque()
        self._linked_since = 0.0

    def children(self) -> list[Child]:
        """Return every process that is or was there."""
        found = [child for s in self.services.values() for child in (s.child, s.spare) if child is not None]
        return [*found, *([self._router] if self._router else [])]

    def open_router(self, listen: str) -> str:
        """Start the router and return where it is."""
        self._router = self._new("router", self._plan.router_line(listen))
        until = self._clock.now() + START_S
        while self._clock.now() < until:
            said = self._router.said()
            if "endpoint" in said:
                self.endpoint = str(said["endpoint"])
                self._say(f"up: router is alive (process {self._router.pid}) at {self.endpoint}")
                return self.endpoint
            if self._router.ended() is not None:
                error = said.get("error", {})
                raise InputError("listen", error.get("value", listen), error.get("rule", self._router.why()))
            self._clock.sleep_until(self._clock.now() + TICK_S)
        raise RuntimeError(f"the router does not start: {self._router.why()}")

    def start(self) -> None:
        """Start the services."""
        for service in SERVICES:
            line = self._line(service, *(self._plan.arming() if service == "machine" else ()))
            self.services[service] = Service(self._new(service, line), since=self._clock.now())

    def _line(self, service: str, *more: str) -> list[str]:
        if service == "machine":
            return self._plan.machine_line(self.endpoint, "--wait-s", str(START_S), *more)
        shelf = ("--shelf", str(self._shelf)) if service == "monitor" else ()
        return self._plan.line(service, self.endpoint, *shelf, *more)

    def _new(self, service: str, line: list[str]) -> Child:
        return Child(service, line, self._folder, quiet=False)

    def note(self, who: str, came: bool) -> None:
        """Take in that a sign of life came or went."""
        if who in self.services:
            service = self.services[who]
            service.alive, service.since, service.seen = came, self._clock.now(), service.seen or came
            pid = service.child.pid
            self._say(f"up: {who} is {'alive' if came else 'gone'} (process {pid})")

    def look(self, linked: bool) -> bool:
        """Start again what died; returns whether the machine has finished its work.

        Parameters
        ----------
        linked
            Whether signs of life could be seen: without a router nobody shows any.
        """
        now = self._clock.now()
        if not linked:
            self._linked_since = now
        if self._router is not None and (code := self._router.ended()) is not None:
            self._died("router", code, self._router_deaths, now)
            self._router = self._new("router", self._plan.router_line(self.endpoint))
            self._say(f"up: router is alive (process {self._router.pid}) at {self.endpoint}")
        for name, service in self.services.items():
            code = service.child.ended()
            if code == 0 and name == "machine":
                return True
            if code is None and self._hangs(service, now):
                self._say(f"up: {name} shows no sign of life; it is ended by force")
                service.child.kill()
                code = service.child.ended()
            if code is not None:
                self._died(name, code, service.deaths, now)
                self._replace(name, service, now)
            elif name in FOLLOWERS and self._wants_reserve(service, now):
                service.spare, service.stands_by = self._new(name, self._line(name, "--reserve")), False
            elif service.spare is not None and not service.stands_by and service.spare.said().get("stands_by"):
                service.stands_by = True
                self._say(f"up: a second {name} stands by (process {service.spare.pid})")
        return False

    def _hangs(self, service: Service, now: float) -> bool:
        patience = HUNG_S if service.seen else START_S
        return not service.alive and now - max(service.since, self._linked_since) > patience

    def _wants_reserve(self, service: Service, now: float) -> bool:
        if service.spare is not None:
            return service.spare.ended() is not None
        return all(s.alive and now - s.since > RESERVE_AFTER_S for s in self.services.values())

    def _died(self, name: str, code: int, deaths: deque[float], now: float) -> None:
        deaths.append(now)
        self.restarts[name] += 1
        while now - deaths[0] > DEATHS_WITHIN_S:
            deaths.popleft()
        self._say(f"up: {name} ended ({_code(code)}); it is started again")
        if len(deaths) >= MOST_DEATHS:
            raise RuntimeError(f"{name} died {len(deaths)} times within {DEATHS_WITHIN_S:g} s: given up")

    def _replace(self, name: str, service: Service, now: float) -> None:
        why = service.child.why() if service.child.ended() in (2, 3) else ""
        if why:
            raise RefusalError(f"{name}: {why}", {"service": name})
        service.alive, service.seen, service.since = False, False, now
        if service.spare is not None and service.spare.ended() is None:
            service.child, service.spare = service.spare, None
            service.child.go()
            return
        service.spare = None
        service.child = self._new(name, self._line(name))
        if name == "machine":
            self._say("up: a new run begins with the guard OFF; `antiphase operator arm` arms it")


def _code(code: int) -> str:
    return f"signal {-code}" if code < 0 else f"exit code {code}"


def keep_up(plan: Plan, listen: str, *, stop: StopSignal, clock: Clock, say: Say) -> dict[str, Any]:
    """Keep the services up until the machine has finished or `stop` comes, and return what there was to count.

    Parameters
    ----------
    plan
        What to start.
    listen
        Where the router is to listen.
    stop
        Ends it.
    clock
        Monotonic.
    say
        Told in words what happens.
    """
    with private_folder() as folder:
        keeper = Keeper(plan, folder, clock=clock, say=say)
        stopped = False
        try:
            endpoint = keeper.open_router(listen)
            identity = None if plan.identity is None else load_identity(plan.identity, WATCHER, utc_now())
            with ZenohBus.client(plan.machine, endpoint, stop.check, identity) as bus:
                _watch_over(keeper, bus, stop, clock)
        except Stopped:
            stopped = True
        finally:
            _end(keeper)
        machine = keeper.services["machine"].child.said() if "machine" in keeper.services else {}
        return {"stopped": stopped, "restarts": dict(keeper.restarts), "endpoint": keeper.endpoint, "machine": machine}


def _watch_over(keeper: Keeper, bus: ZenohBus, stop: StopSignal, clock: Clock) -> None:
    presence = bus.presence()
    keeper.start()
    finished = False
    while not finished:
        for who, came in presence.changes():
            keeper.note(who, came)
        finished = keeper.look(bus.linked())
        with stop.waiting():
            clock.sleep_until(clock.now() + TICK_S)


def _end(keeper: Keeper) -> None:
    """End the services first, and the router when they have said what they had to say."""
    children = keeper.children()
    end_all(child for child in children if child.service != "router")
    end_all(child for child in children if child.service == "router")
