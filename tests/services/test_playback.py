"""A recording back onto a bus: as it was, when it was, and obeyed by nobody."""

import itertools

import msgspec
import pytest

from services.bus import InMemoryBus
from services.errors import InputError, RefusalError
from services.messages import Event, MachineState, OperatorRequest, SampleBlock, Tick, TurretCommand
from services.nodes.machine import MachineNode
from services.playback import Disguise, check_topics, publish, stretch
from services.process import StopSignal
from services.recording_file import RecordingReader
from services.wire import encode
from tests.services.test_replay import FakeClock


class FakeBus:
    """What playback needs of a bus."""

    machine, endpoint = "lathe-1", "nowhere"

    def __init__(self, alive=()):
        self.said, self.tokens, self._alive = [], [], set(alive)

    def alive(self):
        return self._alive

    def announce(self, service):
        self.tokens.append(service)

    def publish(self, message):
        self.said.append(message)

    def answer(self):
        pass


def play(path, clock, pace=1.0, **options):
    bus = FakeBus()
    _, messages = stretch(path, **options)
    return bus, publish(messages, bus, clock, StopSignal(), pace)


def test_everything_is_said_as_it_was_but_for_run_and_source(recorded):
    path, _, tape = recorded
    bus, played = play(path, FakeClock(), 7.0)
    then = [message for _, message, _ in RecordingReader(path).messages()]
    assert played.topics.total() == len(bus.said) == len(then)
    runs = {message.run for message in bus.said}
    assert len(runs) == 1
    assert runs.isdisjoint({tape.of(SampleBlock)[0].run})
    assert {message.source for message in bus.said} == {f"{message.source}-replay" for message in then}
    back = [msgspec.structs.replace(b, run=a.run, source=a.source) for a, b in zip(then, bus.said, strict=True)]
    assert [encode(message) for message in back] == [encode(message) for message in then]
    assert bus.tokens == ["replay"]


@pytest.mark.parametrize("pace", [0.5, 1.0, 20.0])
def test_it_takes_as_long_as_it_should(recorded, pace):
    clock = FakeClock()
    _, played = play(recorded[0], clock, pace, start_s=1.0, stop_s=2.0)
    assert played.topics["servo/turret1"] == 100
    assert played.played_s == pytest.approx(0.99, abs=0.011)
    assert clock.now() - 100.0 == pytest.approx(played.played_s / pace)
    assert played.as_dict()["pace"] == pytest.approx(pace)


def test_a_stretch_and_single_topics(recorded):
    bus, _ = play(recorded[0], FakeClock(), 9.0, start_s=0.5, stop_s=0.6, topics=check_topics(["servo/turret1"]))
    assert [message.sequence for message in bus.said] == list(range(50, 60))
    with pytest.raises(InputError, match="topic must be one of servo/turret1"):
        check_topics(["servo/turret9"])


def test_two_playbacks_are_two_runs():
    event = Event(run="r", source="machine", sequence=0, sample=0, kind="k", text="t")
    first, second = Disguise(), Disguise()
    assert first(event).run == first(event).run != second(event).run


def test_where_a_machine_is_alive_nothing_is_played(recorded):
    bus = FakeBus(alive={"machine", "monitor"})
    with pytest.raises(RefusalError, match="machine lathe-1 is alive"):
        publish(stretch(recorded[0])[1], bus, FakeClock(), StopSignal(), 1.0)
    assert bus.said == []


def machine_of(recorded, run, tape):
    node = MachineNode(recorded[1], 7, run)
    node.prepare()
    return node, InMemoryBus([node], tap=tape.append)


@pytest.mark.parametrize("fields", [("run", "source"), ("run",), ("source",), ()])
def test_no_machine_obeys_a_replayed_command(recorded, fields):
    """Not even one in the same run, armed, that is told exactly what once moved it: run or source alone keep it out."""
    tape = recorded[2]
    run = tape.of(SampleBlock)[0].run
    said = []
    node, bus = machine_of(recorded, run, said)
    disguise = Disguise()
    arm = next(message for message in tape.log if isinstance(message, OperatorRequest))
    commands = {command.issued_sample: command for command in tape.of(TurretCommand)}
    bus.publish(arm)
    for number in itertools.count():
        bus.publish(Tick(block=number))
        state = next(message for message in reversed(said) if isinstance(message, MachineState))
        command = commands.get(state.sample + 1)
        if command is None:
            break
        for original in (command, arm):
            hidden = disguise(original)
            changed = {name: getattr(hidden, name) for name in fields}
            if isinstance(original, TurretCommand):
                changed["session"] = state.session
            bus.publish(msgspec.structs.replace(original, **changed))
    assert number > 300
    assert any(command.action == "move" for command in commands.values())
    largest = max(abs(message.shift_applied_deg) for message in said if isinstance(message, MachineState))
    if fields:
        assert (state.commands_accepted, state.commands_rejected >= number, largest < 0.01) == (0, True, True)
    else:  # the same commands without a disguise
        assert (state.commands_accepted > 300, largest > 2.0) == (True, True)
