"""The runners of nodes with a bus and a clock that are not there: what comes from outside, pace, and the barrier."""

import pytest

from services.bus import Received
from services.errors import RefusalError
from services.messages import Event, OperatorRequest, SampleBlock, Tick, TurretCommand
from services.node import SILENCE_S, Herald, Tenancy
from services.pace import MOST_LATENCIES, MOST_TAKEN, Paced, PacedMachine
from services.process import StopSignal
from services.shelf import Shelf
from services.wire import encode, encoding_of, topic_of
from tests.system.kit import block, command


class FakeClock:
    """Time passes only while somebody waits, or when told."""

    def __init__(self):
        self.time = 100.0

    def now(self):
        return self.time

    def sleep_until(self, moment):
        self.time = max(self.time, moment)


class FakePresence:
    def __init__(self, alive):
        self.alive, self.coming = set(alive), []

    def changes(self):
        coming, self.coming = self.coming, []
        for who, came in coming:
            (self.alive.add if came else self.alive.discard)(who)
        return coming

    def close(self):
        pass


class FakeInbox:
    def __init__(self):
        self.waiting = []

    def take(self):
        waiting, self.waiting = self.waiting, []
        return waiting


class FakeBus:
    machine, endpoint = "m", "nowhere"

    def __init__(self, alive=("monitor", "controller")):
        self.sent, self.inbox, self.there = [], FakeInbox(), FakePresence(alive)
        self.on_publish = lambda message: None

    def alive(self):
        return self.there.alive

    def presence(self):
        return self.there

    def subscribe(self, *kinds):
        return self.inbox

    def offer(self, *kinds):
        pass

    announce = offer

    def answer(self):
        pass

    def publish(self, message):
        self.sent.append(message)
        self.on_publish(message)

    def of(self, kind):
        return [message for message in self.sent if isinstance(message, kind)]


class Recorder:
    """A node that answers a tick with a block, and notes what it was given."""

    subscribes = (Tick, TurretCommand, OperatorRequest)

    def __init__(self, run="run-1"):
        self.run, self.given = run, []

    def prepare(self):
        pass

    def handle(self, message):
        self.given.append(message)
        return [block(message.block, run=self.run)] if isinstance(message, Tick) else []


def received(message):
    kind = type(message)
    return Received(topic_of(kind), encode(message), encoding_of(kind))


def paced(bus, clock, node=None):
    return PacedMachine(node or Recorder(), bus, "run-1", clock=clock, stop=StopSignal(), say=lambda _: None)


def test_blocks_go_out_every_ten_milliseconds():
    bus, clock, times = FakeBus(), FakeClock(), []
    bus.on_publish = lambda message: times.append(clock.time)
    counts = paced(bus, clock).run(50, arm_block=None, wait_s=1.0)
    assert times == pytest.approx([100.0 + 0.01 * k for k in range(50)])
    assert (counts.blocks, counts.overruns, counts.stopped) == (50, 0, False)
    assert counts.wall_s == pytest.approx(0.49)


def test_a_clock_that_jumps_moves_the_schedule_and_is_counted():
    bus, clock, times = FakeBus(), FakeClock(), []

    def jump(message):
        if isinstance(message, SampleBlock):
            times.append(clock.time)
            clock.time += 5.0 if message.sequence == 9 else 0.0

    bus.on_publish = jump
    counts = paced(bus, clock).run(20, arm_block=None, wait_s=1.0)
    assert counts.overruns == 1
    assert counts.slipped_s == pytest.approx(4.99)
    assert times[10:] == pytest.approx([times[9] + 5.0 + 0.01 * k for k in range(10)])
    assert [event.kind for event in bus.of(Event)] == ["overrun"]


def test_commands_are_taken_before_the_block_and_timed_by_their_cause():
    bus, clock, node = FakeBus(), FakeClock(), Recorder()

    def answer(message):
        if isinstance(message, SampleBlock):
            clock.time += 0.001
            bus.inbox.waiting.append(received(command(message.sequence)))

    bus.on_publish = answer
    counts = paced(bus, clock, node).run(5, arm_block=None, wait_s=1.0)
    order = [m.block if isinstance(m, Tick) else f"command {m.sequence}" for m in node.given]
    assert order == [0, "command 0", 1, "command 1", 2, "command 2", 3, "command 3", 4, "command 4"]
    assert list(counts.latency_ms) == pytest.approx([1.0] * 5)


def test_a_machine_that_runs_for_weeks_keeps_the_latest_latencies_only():
    counts = Paced()
    counts.latency_ms.extend(float(k) for k in range(3 * MOST_LATENCIES))
    told = counts.summary(every_latency=True)
    assert told["latency_ms"] == [float(k) for k in range(2 * MOST_LATENCIES, 3 * MOST_LATENCIES)]
    assert told["loop_p50_ms"] == pytest.approx(2.5 * MOST_LATENCIES - 0.5)


def test_arming_is_a_request_that_everybody_hears():
    bus, node = FakeBus(), Recorder()
    paced(bus, FakeClock(), node).run(5, arm_block=2, wait_s=1.0)
    assert [type(m) for m in node.given] == [Tick, Tick, OperatorRequest, Tick, Tick, Tick]
    assert [(m.request, m.source) for m in bus.of(OperatorRequest)] == [("arm", "operator")]


def test_a_flood_is_thrown_away_and_garbage_is_counted():
    bus, node = FakeBus(), Recorder()
    garbage, many = [Received("pitch/command", b"{", "")] * 10, range(10 * MOST_TAKEN)
    bus.inbox.waiting = garbage + [received(command(k)) for k in many]
    machine = paced(bus, FakeClock(), node)
    machine.run(3, arm_block=None, wait_s=1.0)
    assert sum(isinstance(m, TurretCommand) for m in node.given) <= 2 * MOST_TAKEN
    assert machine.noticed()["decode_errors"] == 10
    assert machine.noticed()["thrown_away"] > 8 * MOST_TAKEN
    assert len(bus.of(Event)) == 2  # one of each kind within a second


def test_sample_0_waits_for_monitor_and_controller():
    bus, clock = FakeBus(alive=["monitor"]), FakeClock()
    with pytest.raises(RefusalError, match="not alive after 2 s: controller"):
        paced(bus, clock).run(3, arm_block=None, wait_s=2.0)
    assert not bus.sent
    bus.there.coming = [("controller", True)]
    assert paced(bus, clock).run(3, arm_block=None, wait_s=2.0).blocks == 3


def test_who_leaves_is_said_and_the_machine_goes_on():
    bus = FakeBus()
    bus.on_publish = lambda m: bus.there.coming.append(("monitor", False)) if getattr(m, "sequence", 0) == 2 else None
    assert paced(bus, FakeClock()).run(6, arm_block=None, wait_s=1.0).blocks == 6
    assert "machine sees that monitor is gone" in [event.text for event in bus.of(Event)]


def test_a_second_machine_of_the_name_is_refused():
    with pytest.raises(RefusalError, match="a machine of m is alive already"):
        paced(FakeBus(alive=["machine", "monitor", "controller"]), FakeClock()).run(1, arm_block=None, wait_s=1.0)


class Learner(Recorder):
    def __init__(self, run):
        super().__init__(run)
        self.learned = None

    def handle(self, message):
        super().handle(message)
        return [block(message.sequence, run=self.run)]

    def snapshot(self):
        return {"learned": len(self.given)}

    def restore(self, saved):
        if not isinstance(saved.get("learned"), int):
            raise ValueError("no number")
        self.learned = saved["learned"]


def tenancy(shelf=None):
    clock, bus = FakeClock(), FakeBus()
    herald = Herald("monitor", bus, clock, lambda _: None)
    return Tenancy(Learner, herald, clock, shelf), clock, bus, herald


def test_a_second_run_is_ignored_while_the_first_goes_on():
    lodger, clock, bus, herald = tenancy()
    for k in range(20):
        assert lodger.handle(block(k, run="first"))
        assert not lodger.handle(block(k, run="second"))
        clock.time += 0.01
    assert herald.counts["foreign_run"] == 20
    assert [event.kind for event in bus.of(Event)] == ["foreign_run"]
    clock.time += SILENCE_S
    assert lodger.handle(block(0, run="second"))
    assert (lodger.run, lodger.runs) == ("second", 2)


def test_when_the_machine_is_gone_the_next_run_begins_at_once():
    lodger, *_ = tenancy()
    lodger.handle(block(0, run="first"))
    lodger.vacant = True
    assert lodger.handle(block(0, run="second"))[0].run == "second"


def test_what_was_learned_is_handed_over_within_a_run_only(tmp_path):
    first, *_ = tenancy(Shelf(tmp_path))
    for k in range(150):
        first.save(first.handle(block(k, run="r")))
    again, _, bus, _ = tenancy(Shelf(tmp_path))
    again.handle(block(150, run="r"))
    assert again.node.learned == 100
    assert [event.kind for event in bus.of(Event)] == ["limits_restored"]
    other, *_ = tenancy(Shelf(tmp_path))
    other.handle(block(0, run="another"))
    assert other.node.learned is None


@pytest.mark.parametrize(
    "text", ["", "{", "[]", '{"run": "r"}', '{"run": "r", "state": 5}', '{"run": "x", "state": {}}']
)
def test_a_damaged_shelf_is_an_empty_one(tmp_path, text):
    shelf = Shelf(tmp_path)
    shelf.save("r", {"learned": 1})
    next(tmp_path.glob("*.json")).write_text(text)
    assert shelf.load("r") is None


def test_what_does_not_fit_is_said_and_left(tmp_path):
    Shelf(tmp_path).save("r", {"learned": "much"})
    lodger, _, bus, _ = tenancy(Shelf(tmp_path))
    assert lodger.handle(block(0, run="r"))
    assert [event.kind for event in bus.of(Event)] == ["limits_lost"]


def test_the_same_complaint_is_made_once_a_second():
    clock, bus = FakeClock(), FakeBus()
    herald = Herald("monitor", bus, clock, lambda _: None)
    for _ in range(300):
        herald.note("decode_error", "rubbish")
        clock.time += 0.01
    assert [event.text for event in bus.of(Event)] == ["rubbish", *["rubbish (99 more before)"] * 2]
    assert herald.counts["decode_error"] == 300
