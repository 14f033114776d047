"""Machine, monitor and controller as processes of their own."""

import json
import pathlib
import signal
import sys
import time

import numpy as np
import pytest

from services.clock import WallClock
from services.closed_loop import Loop
from services.config import load_case
from services.demo import run_demo
from services.messages import Event, MachineState, SampleBlock, Tick, TurretCommand
from services.zenoh_bus import ZenohBus
from tests.system.kit import TGKILL, Spy, free_endpoint, processes, until

pytestmark = pytest.mark.system
CASE = "thesis-652"


@pytest.fixture
def router():
    with ZenohBus.router("m", "tcp/127.0.0.1:0") as bus:
        yield bus.endpoint


def plain(message):
    """Return a message without what differs between any two runs."""
    own = ("run", "session", "nonce", "shift_requested_deg")  # the last one is told when the command comes: see `asked`
    names = (name for name in message.__struct_fields__ if name not in own)
    values = {name: getattr(message, name) for name in names}
    return {name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in values.items()}


def asked(messages):
    """Return what was requested, one after the other: it is told from the block on that the command came before."""
    found = [getattr(message, "shift_requested_deg", None) for message in messages]
    return [value for number, value in enumerate(found) if number == 0 or value != found[number - 1]]


def test_three_processes_do_what_one_does():
    case, blocks = load_case(CASE), 260  # entry, chatter, detection, and the move
    heard = []
    seen = run_demo(
        CASE, case, 3, clock=WallClock(), say=lambda _: None, lasts=("--duration-s", str(blocks / 100)),
        hear=lambda topic, payload, encoding, message: heard.append((topic, len(payload), encoding)),
    )  # fmt: skip
    assert not seen.died
    assert not seen.interrupted
    machine = seen.services["machine"]
    assert machine["blocks"] == blocks
    assert machine["guard_state"] == "ACTIVE"
    assert seen.undecodable == seen.tape.blocks_lost == 0
    assert len(seen.tape.latency_ms) == blocks
    assert sum(map(len, seen.tape.messages.values())) == len(heard)

    loop = Loop(case, 3, WallClock(), 0.0)
    for number in range(blocks):
        loop.step(number)
    assert len(seen.tape.of(SampleBlock)) == blocks
    late = machine["commands_late"] + machine["commands_rejected"]
    for kind, alone in loop.tape.messages.items():
        if kind in (Tick, Event, MachineState):
            continue
        apart = seen.tape.of(kind)
        assert len(apart) == len(alone)
        if not late:  # only a command that comes too late may make a difference
            assert [plain(message) for message in apart] == [plain(message) for message in alone], kind
            assert asked(apart) == asked(alone), kind  # in the same order, if not in the same block
    moves = [command for command in seen.tape.of(TurretCommand) if command.action == "move"]
    assert moves
    assert 2.0 <= moves[0].shift_deg <= 3.6
    assert seen.tape.of(MachineState)[-1].shift_applied_deg > (0.0 if late else 2.0)


def test_three_terminals_close_the_loop(tmp_path):
    endpoint = free_endpoint()
    with processes(tmp_path) as start:
        common = (CASE, "--machine", "lathe-7", "--json")
        monitor = start("monitor", *common, "--connect", endpoint)
        assert until(lambda: "waiting" in monitor.told())  # before there is a router
        machine = start("machine", *common, "--listen", endpoint, "--forever")
        controller = start("controller", *common, "--connect", endpoint)
        spy = Spy(endpoint, "lathe-7")
        try:
            assert spy.until(lambda: MachineState in spy.last)
            assert spy.last[MachineState].guard_state == "OFF"
            arm = start("operator", "arm", "--machine", "lathe-7", "--connect", endpoint, "--json")
            assert until(lambda: arm.ended() is not None)
            assert (arm.ended(), arm.said().get("guard_state")) == (0, "ACTIVE"), arm.said()
            assert spy.new(TurretCommand, 20) is not None
            assert spy.until(lambda: spy.last[MachineState].commands_accepted > 10)
            again = start("operator", "dry_run", "--machine", "lathe-7", "--connect", endpoint, "--json")
            assert spy.until_guard("ARMED")
            assert until(lambda: again.ended() == 0)
            config = spy.bus._session.get("antiphase/lathe-7/config", timeout=5.0)
            assert [json.loads(reply.ok.payload.to_string())["case"]["title"] for reply in config]
        finally:
            spy.close()
        for process, number in ((controller, signal.SIGINT), (monitor, signal.SIGTERM), (machine, signal.SIGINT)):
            assert process.stop(number) == 0, process.told()
        assert machine.said()["stopped"] is True
        assert machine.said()["blocks"] > 10
        assert monitor.said()["handled"] > 10
        assert monitor.said()["blocks_lost"] == 0
        assert controller.said()["runs"] == 1


@pytest.mark.skipif(not TGKILL, reason="the number of Linux's tgkill is not known here")
def test_a_signal_that_any_thread_takes_ends_the_process(tmp_path):
    with processes(tmp_path) as start:
        router = start("router", "--listen", "tcp/127.0.0.1:0", "--json")
        assert until(lambda: "endpoint" in router.said())
        where = ("--connect", router.said()["endpoint"])
        monitor = start("monitor", CASE, *where)
        recorder = start("record", "--out", str(tmp_path / "recorded"), *where)
        assert until(lambda: "ready" in monitor.told()), monitor.told()
        assert until(lambda: (tmp_path / "recorded").exists()), recorder.told()
        for process in (monitor, recorder, router):
            assert process.stop_by_another_thread() == 0, process.told()


def test_a_second_of_a_kind_and_a_lonely_machine_are_refused(tmp_path, router):
    with processes(tmp_path) as start:
        common = (CASE, "--connect", router, "--json")
        first = start("controller", *common)
        assert until(lambda: "ready" in first.told())
        second = start("controller", *common)
        lonely = start("machine", *common, "--wait-s", "0.5")
        refused = ((second, "a controller of lathe-1 is alive already"), (lonely, "not alive after 0.5 s: monitor"))
        for process, words in refused:
            assert until(lambda process=process: process.ended() is not None)
            assert process.ended() == 3
            assert words in process.said()["reason"]
        assert first.ended() is None
        waiting = start("machine", *common, "--machine", "lathe-1")
        assert until(lambda: "waiting for monitor" in waiting.told())
        rival = start("machine", *common)
        assert until(lambda: rival.ended() is not None)
        assert rival.ended() == 3
        assert "a machine of lathe-1 is alive already" in rival.said()["reason"]
        assert waiting.stop() == first.stop() == 0


@pytest.mark.parametrize(
    ("options", "field"),
    [
        (("--listen", "TAKEN"), "listen"),
        (("--listen", "nonsense"), "listen"),
        (("--connect", "7447"), "connect"),
        (("--connect", "tcp/127.0.0.1:1", "--listen", "tcp/127.0.0.1:0"), "listen"),
        (("--machine", "a/b"), "machine"),
        (("--duration-s", "-1"), "duration-s"),
        (("--wait-s", "nan"), "wait-s"),
        (("--arm-after-s", "-1"), "arm-after-s"),
    ],
)
def test_wrong_use_of_machine_names_the_field(router, options, field, capsys):
    from services.cli.app import main

    arguments = [router if option == "TAKEN" else option for option in options]
    with pytest.raises(SystemExit) as ended:
        main(["machine", CASE, *arguments, "--json"])
    assert ended.value.code == 2
    assert json.loads(capsys.readouterr().out)["error"]["field"] == field


def test_a_request_to_nobody_is_refused(router, capsys):
    from services.cli.app import main

    for arguments, code in ((["arm", "--wait-s", "0.2"], 3), (["explode"], 2)):
        with pytest.raises(SystemExit) as ended:
            main(["operator", *arguments, "--connect", router, "--json"])
        assert ended.value.code == code
        answer = json.loads(capsys.readouterr().out)
        assert ("reason" in answer) == (code == 3)


def test_ctrl_c_leaves_what_was_seen(tmp_path):
    """The parent of a demonstration, interrupted: nothing hangs, and no process is left behind."""
    code = (
        "import json; from services.clock import WallClock; from services.config import load_case; "
        "from services.demo import run_demo; from services.messages import SampleBlock; "
        f"s = run_demo({CASE!r}, load_case({CASE!r}), 1, clock=WallClock(), say=lambda _: None, "
        "hear=lambda t, p, e, m: t.startswith('servo') and print(json.dumps({'block': m.sequence}), flush=True)); "
        "print(json.dumps({'interrupted': s.interrupted, 'seen': len(s.tape.of(SampleBlock)), "
        "'latencies': len(s.tape.latency_ms), 'endpoint': s.endpoint}))"
    )
    root = str(pathlib.Path(__file__).parents[2])
    with processes(tmp_path) as start:
        demo = start(line=[sys.executable, "-c", f"import sys; sys.path.insert(0, {root!r}); {code}"])
        assert until(lambda: demo.said().get("block", 0) > 30), demo.told()
        assert demo.stop(signal.SIGINT) == 0, demo.told()
        assert demo.said()["interrupted"] is True
        assert demo.said()["seen"] > 30
        assert demo.said()["latencies"] > 30


def test_without_up_the_machine_holds_and_then_gives_up_and_nobody_hangs(tmp_path):
    with processes(tmp_path) as start:
        router = start("router", "--listen", "tcp/127.0.0.1:0", "--json")
        assert until(lambda: "endpoint" in router.said())
        endpoint = router.said()["endpoint"]
        spy = Spy(endpoint)
        try:
            common = (CASE, "--connect", endpoint, "--json")
            monitor, controller = start("monitor", *common), start("controller", *common)
            machine = start("machine", *common, "--forever", "--arm-after-s", "0")
            assert spy.until_guard("ACTIVE")
            assert spy.new(TurretCommand, 5) is not None
            spy.look()
            killed = time.monotonic()
            monitor.popen.send_signal(signal.SIGKILL)
            assert spy.until(lambda: spy.seen("monitor", False, killed) is not None)
            assert spy.seen("monitor", False, killed) < 0.6
            assert spy.until_guard("HOLDING", seconds=10.0)
            assert spy.until_guard("FAULT", seconds=10.0)
            assert spy.until(lambda: any(e.kind == "peer" and "monitor is gone" in e.text for e in spy.of(Event)), 5.0)
            router.popen.send_signal(signal.SIGKILL)
            assert until(lambda: "monitor is gone" in controller.told() and "machine is gone" in controller.told(), 5.0)
        finally:
            spy.close()
        assert machine.ended() is controller.ended() is None
        assert machine.stop() == controller.stop() == 0
        assert machine.said()["guard_state"] == "FAULT"
