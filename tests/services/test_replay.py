"""A recording gives the same verdicts again, to the bit, and says where it does not."""

import dataclasses

import msgspec
import pytest

from services.clock import WallClock
from services.closed_loop import judge
from services.errors import InputError
from services.messages import ChatterReport, Event, ForceBlock, SampleBlock, TurretCommand
from services.nodes.recorder import RecorderNode
from services.recording_file import RecordingReader
from services.recording_writer import McapRecorder
from services.replay import case_of, replay, run_of
from services.wire import encode
from tests.recorded import BLOCKS, metadata_of


def copy(path, target, change, metadata=None):
    """Write a recording again with each message changed, or left out."""
    reader = RecordingReader(path)
    messages = list(reader.messages())
    with McapRecorder(target, reader.metadata if metadata is None else metadata) as recorder:
        for _, message, time in messages:
            changed = change(message)
            if changed is not None:
                recorder.record(changed, time, wait=True)
    return target


def test_the_case_is_in_the_file(recorded):
    path, case, tape = recorded
    found = case_of(path)
    assert (found.text, found.digest, found.name) == (case.text, case.digest, case.name)
    assert dataclasses.replace(found, text="") == dataclasses.replace(case, text="")
    assert run_of(path) == tape.of(SampleBlock)[0].run


def test_verdicts_commands_and_evaluation_are_the_same_to_the_bit(recorded):
    path, case, tape = recorded
    again = replay(path, WallClock())
    assert again.comparison.same, again.comparison.examples
    assert again.comparison.compared["ChatterReport"] == BLOCKS
    assert again.comparison.compared["TurretCommand"] == len(tape.of(TurretCommand)) > 0
    assert again.comparison.compared["ForceBlock"] == BLOCKS
    assert any(command.action == "move" for command in again.tape.of(TurretCommand))
    for kind in (SampleBlock, ForceBlock, ChatterReport, TurretCommand):
        assert [encode(message) for message in again.tape.of(kind)] == [encode(message) for message in tape.of(kind)]
    assert (again.seed, again.notes) == (7, ())
    before = judge(case, 7, tape, interrupted=True).summary.as_dict()
    after = judge(again.case, again.seed, again.tape, interrupted=True).summary.as_dict()
    wall = {name for name in before if name.startswith(("loop_", "real_time", "total_"))}
    assert {k: v for k, v in before.items() if k not in wall} == {k: v for k, v in after.items() if k not in wall}


def test_a_stretch_is_judged_with_what_was_learned_before_it(recorded):
    path, _, tape = recorded
    again = replay(path, WallClock(), start_s=2.5, stop_s=3.0)
    assert again.comparison.same
    assert again.comparison.compared["ChatterReport"] == again.comparison.compared["ForceBlock"] == 50
    assert len(again.tape.of(SampleBlock)) == 300
    assert len(tape.of(SampleBlock)) == BLOCKS


class FakeClock:
    """Time passes only by waiting."""

    def __init__(self):
        self.time, self.waits = 100.0, []

    def now(self):
        return self.time

    def sleep_until(self, moment):
        self.waits.append(moment)
        self.time = max(self.time, moment)


def test_pace_counts_from_the_start(recorded):
    clock = FakeClock()
    replay(recorded[0], clock, start_s=1.0, stop_s=2.0, pace=4.0)
    assert clock.waits == pytest.approx([100.0 + 0.0025 * number for number in range(100)])


def test_differences_are_named(recorded, tmp_path):
    def change(message):
        if isinstance(message, TurretCommand) and message.sequence == 300:
            return msgspec.structs.replace(message, shift_deg=message.shift_deg + 1e-12)
        if isinstance(message, ChatterReport) and message.sequence == 310:
            return None
        return message

    comparison = replay(copy(recorded[0], tmp_path / "changed.mcap", change), WallClock()).comparison
    assert not comparison.same
    assert comparison.different == {"TurretCommand": 1}
    assert comparison.unrecorded == {"ChatterReport": 1}
    assert comparison.examples[0].startswith("TurretCommand 300: shift_deg ")


def test_a_lost_block_changes_the_verdicts_and_is_counted(recorded, tmp_path):
    lost = copy(
        recorded[0],
        tmp_path / "lost.mcap",
        lambda message: None if isinstance(message, SampleBlock) and message.sequence == 100 else message,
    )
    again = replay(lost, WallClock())
    assert again.tape.blocks_lost == 1
    assert again.comparison.unexpected == {"ForceBlock": 1, "ChatterReport": 1, "TurretCommand": 1}
    assert not again.comparison.same


def test_a_recording_cut_off_is_replayed_as_far_as_it_goes(recorded, tmp_path):
    path = tmp_path / "cut.mcap"
    whole = recorded[0].read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    again = replay(path, WallClock())
    assert 50 < len(again.tape.of(SampleBlock)) < BLOCKS
    assert again.comparison.same, again.comparison.examples
    assert "no end" in again.notes[-1]


def test_latencies_are_those_of_the_recording_when_it_had_a_clock(recorded, tmp_path):
    path, case, tape = recorded
    wall = metadata_of(case) | {"clock": "wall"}
    again = replay(copy(path, tmp_path / "wall.mcap", lambda message: message, wall), WallClock())
    assert len(again.tape.latency_ms) == len(tape.of(TurretCommand))
    assert max(again.tape.latency_ms) == pytest.approx(1e3 / case.settings.sample_rate_hz, abs=1e-3)


def test_a_recording_without_its_configuration_is_refused(recorded, tmp_path):
    path, case, _ = recorded
    metadata = metadata_of(case)
    for number, change in enumerate([{"config": "{}"}, {"sha256": "0"}]):
        other = copy(path, tmp_path / f"{number}.mcap", lambda _: None, metadata | change)
        with pytest.raises(InputError, match="configuration"):
            replay(other, WallClock())
    bare = copy(path, tmp_path / "bare.mcap", lambda message: message, {"case": "x"})
    with pytest.raises(InputError, match="begins with its configuration"):
        replay(bare, WallClock())
    again = replay(bare, WallClock(), case, stop_s=0.5)
    assert again.comparison.same
    assert len(again.tape.of(SampleBlock)) == 50


def test_the_recorder_says_once_that_it_stopped(tmp_path):
    with McapRecorder(tmp_path / "run.mcap", {}) as recorder:
        node = RecorderNode(recorder, "run", 9000.0)
        node.prepare()
        recorder.failure = "run.mcap ends early: No space left on device"
        event = Event(run="run", source="machine", sequence=5, sample=90, kind="k", text="t")
        [said] = node.handle(event)
        assert (said.kind, said.text, said.cause, said.sample) == ("recording_stopped", recorder.failure, 5, 90)
        assert node.handle(event) == []
        recorder.failure = ""
