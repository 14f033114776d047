"""`antiphase up`: what dies is started again, and what is said from outside moves nothing beyond its limits."""

import math
import os
import pathlib
import re
import signal
import time

import msgspec
import pytest

from services.config import load_case
from services.messages import ChatterReport, Event, MachineState, SampleBlock, TurretCommand
from services.wire import encode, encoding_of, key
from tests.system.kit import Process, Spy, command, free_endpoint, until

pytestmark = pytest.mark.system
CASE = "thesis-652"
SEEN_S, BACK_S = 0.6, 5.0


class Up:
    """A running `antiphase up` and a spy on its bus."""

    def __init__(self, folder):
        self.endpoint = free_endpoint()
        options = ("--listen", self.endpoint, "--forever", "--json")
        self.process = Process(folder, "up", CASE, *options, "--arm-after-s", "0")
        self.spy = Spy(self.endpoint)

    def pid(self, service):
        return int(re.findall(rf"up: {service} is alive \(process (\d+)\)", self.process.told())[-1])

    def works(self, kind=TurretCommand, seconds=BACK_S):
        return self.spy.new(kind, 5, seconds) is not None

    def story(self):
        """Tell what happened, for a test that fails."""
        self.spy.look()
        lines = [line for line in self.process.told().splitlines() if " = " not in line]
        events = [f"{e.sample / 9000:.2f} s {e.source} {e.text}" for e in self.spy.of(Event)]
        return "\n".join(("", *lines[-40:], *events[-40:], str(self.spy.last.get(MachineState))))

    def kill(self, service):
        """End a process by force; returns when."""
        self.spy.look()
        os.kill(self.pid(service), signal.SIGKILL)
        return time.monotonic()

    def close(self):
        self.spy.close()
        self.process.close()


@pytest.fixture(scope="module")
def up(tmp_path_factory):
    running = Up(tmp_path_factory.mktemp("up"))
    try:
        assert running.spy.until_guard("ACTIVE"), running.process.told()
        assert running.spy.until(lambda: running.spy.last[MachineState].shift_applied_deg > 2.0)
        state = running.spy.last[MachineState]
        if state.commands_late > 0.02 * state.commands_accepted:
            late = f"{state.commands_late} of {state.commands_accepted} commands late"
            pytest.skip(f"too busy for real time here: {late}")
        yield running
    finally:
        running.close()


def reserves(up):
    """Wait until a second monitor and a second controller stand by for those that work now."""

    def there():
        told = up.process.told()
        return all(
            told.rfind(f"up: a second {service} stands by") > told.rfind(f"up: {service} ended")
            for service in ("monitor", "controller")
        )

    return until(there)


@pytest.mark.parametrize("service", ["monitor", "controller"])
def test_a_follower_that_dies_is_replaced_before_the_guard_gives_up(up, service):
    assert reserves(up)
    assert up.works(), up.story()
    run = up.spy.last[MachineState].run
    killed = up.kill(service)
    assert up.spy.until(lambda: up.spy.seen(service, False, killed) is not None, SEEN_S + 1.0)
    assert up.spy.seen(service, False, killed) < SEEN_S
    assert up.spy.until(lambda: up.spy.seen(service, True, killed) is not None, BACK_S)
    assert up.works(), up.story()
    assert time.monotonic() - killed < BACK_S
    states = [state for state in up.spy.of(MachineState) if state.run == run]
    assert {state.guard_state for state in states} <= {"OFF", "ACTIVE", "HOLDING"}
    assert up.spy.until_guard("ACTIVE", seconds=BACK_S)
    assert up.spy.last[MachineState].run == run
    assert up.spy.last[MachineState].shift_applied_deg > 2.0
    if service == "monitor":
        assert up.spy.until(lambda: any(e.kind == "limits_restored" for e in up.spy.of(Event)), BACK_S)
        assert up.spy.last[ChatterReport].state != "learning"


def test_without_a_router_the_guard_holds_and_the_loop_comes_back(up):
    assert up.works(), up.story()
    run, blocks = up.spy.last[MachineState].run, len(up.spy.of(SampleBlock))
    killed = up.kill("router")
    assert up.spy.until(lambda: up.spy.seen("machine", False, killed) is not None, SEEN_S + 1.0)
    assert up.spy.seen("machine", False, killed) < SEEN_S
    assert up.spy.until(lambda: up.spy.seen("machine", True, killed) is not None, BACK_S)
    assert up.works(), up.story()
    assert time.monotonic() - killed < BACK_S
    assert up.spy.until_guard("ACTIVE", seconds=BACK_S)
    assert up.spy.last[MachineState].run == run
    assert up.spy.until(lambda: len(up.spy.of(SampleBlock)) > blocks, BACK_S)
    assert {state.guard_state for state in up.spy.of(MachineState)} <= {"OFF", "ACTIVE", "HOLDING"}


def hostile(up, number):
    """Return payloads that somebody outside could send, as well informed as it gets."""
    state = up.spy.last[MachineState]
    known = {"run": state.run, "session": state.session}
    k = state.sample // 90 + 1
    now = state.sample
    ahead = {"issued_sample": now, "apply_at_sample": now + 90, "expires_at_sample": now + 2000}
    true = command(k, **known, **ahead)
    shifts = (50.0, -50.0, 1e9, -1e9, 1e308, 5.0001, math.nan, math.inf, 180.0, 360.0, 359.9)
    bad = [encode(command(k + i, **known, **ahead, shift_deg=shift)) for i, shift in enumerate(shifts)]
    texts = (b"NaN", b"1e999", b"null", b'"50 mm"', b"-1e9")
    bad += [encode(true).replace(b'"shift_deg":0.0', b'"shift_deg":' + text) for text in texts]
    changes = (
        {"session": "yesterday"}, {"run": "another"}, {"source": "operator"}, {"version": 2}, {"sequence": -1},
        {"sequence": 2**63 - 1, "shift_deg": 9.0}, {"expires_at_sample": 0}, {"issued_sample": 10**15},
    )  # fmt: skip
    bad += [encode(msgspec.structs.replace(true, **({"shift_deg": 4.0} | change))) for change in changes]
    old = [c for c in up.spy.of(TurretCommand)[:-300] if c.action == "move"][:3]
    bad += [encode(message) for message in old]
    bad += [b"", b"\x00" * 1000, b"{" * 100_000, b"[" * 1000, os.urandom(500), b'{"version":1}', encode(true)[:-40]]
    return bad * number


def test_nothing_from_outside_moves_the_turret_beyond_its_limits(up):
    assert up.works(), up.story()
    limits = load_case(CASE).limits
    start, before = len(up.spy.of(MachineState)), up.spy.last[MachineState]
    rogue = up.spy.bus._session.declare_publisher(key("lathe-1", TurretCommand), encoding=encoding_of(TurretCommand))
    for _ in range(20):
        for payload in hostile(up, 1):
            rogue.put(payload)
        assert up.spy.new(MachineState, 3, BACK_S) is not None
    rogue.undeclare()
    for state in up.spy.of(MachineState)[start:]:
        assert abs(state.shift_target_deg - before.shift_target_deg) < 0.01
        assert abs(state.shift_applied_deg - before.shift_applied_deg) < 0.02
        assert abs(state.slide_x1_um) <= 1e6 * limits.x1
        assert abs(state.slide_y1_um) <= 1e6 * limits.y1
        assert state.guard_state in ("ACTIVE", "HOLDING")
    assert up.spy.until(lambda: up.spy.last[MachineState].commands_rejected > before.commands_rejected + 100, BACK_S)
    assert up.spy.until(lambda: any(e.kind == "decode_error" for e in up.spy.of(Event)), BACK_S)
    assert up.works(), up.story()
    assert up.spy.until_guard("ACTIVE", seconds=BACK_S)


def test_a_machine_that_dies_comes_back_with_its_guard_off(up):
    assert up.works(), up.story()
    run = up.spy.last[MachineState].run
    killed = up.kill("machine")
    assert up.spy.until(lambda: up.spy.seen("machine", False, killed) is not None, SEEN_S + 1.0)
    assert up.spy.seen("machine", False, killed) < SEEN_S
    assert up.spy.until(lambda: up.spy.last[ChatterReport].run != run, BACK_S)
    assert time.monotonic() - killed < BACK_S
    assert up.works(ChatterReport)
    assert up.spy.last[MachineState].guard_state == "OFF"
    assert up.spy.last[MachineState].sample < 9000 * BACK_S
    assert not [c for c in up.spy.of(TurretCommand) if c.run != run]
    up.spy.ask("arm", "an-operator-asks")
    assert up.spy.until_guard("ACTIVE", seconds=BACK_S)
    assert up.works(), up.story()


def test_up_ends_with_everything_it_started(up):
    pids = [up.pid(service) for service in ("router", "machine", "monitor", "controller")]
    assert up.process.stop(signal.SIGINT) == 0, up.process.told()
    assert up.process.said()["stopped"] is True
    assert up.process.said()["restarts"]["monitor"] == up.process.said()["restarts"]["router"] == 1
    assert not [pid for pid in pids if pathlib.Path(f"/proc/{pid}").exists()]


def test_no_child_outlives_a_parent_that_is_killed(tmp_path):
    running = Up(tmp_path)
    try:
        assert running.spy.until(lambda: MachineState in running.spy.last), running.process.told()
        pids = [running.pid(service) for service in ("router", "machine", "monitor", "controller")]
        running.process.stop(signal.SIGKILL)
        assert until(lambda: not [pid for pid in pids if pathlib.Path(f"/proc/{pid}").exists()], 15.0)
    finally:
        running.close()
