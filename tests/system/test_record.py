"""The recorder on a real bus: what it hears is in the file, whatever ends it."""

import contextlib
import json
import signal
import threading
import time

import numpy as np
import pytest

from services.bus_recorder import BusRecorder
from services.clock import WallClock
from services.config import load_case
from services.messages import Event, SampleBlock
from services.playback import publish, serve_recorded_config, stretch
from services.process import StopSignal, command_line
from services.recording_file import RecordingReader, part_path
from services.recording_writer import McapRecorder
from services.zenoh_bus import ZenohBus
from tests.system.kit import Spy, block, processes, until

pytestmark = pytest.mark.system
CALM_BLOCKS, CALM_S = 30, 0.025
BEGUN = 100
"""Bytes from which on a file is a recording: its magic is behind them."""


class Talker:
    """A machine that says a block every 10 ms and its configuration to whoever asks."""

    def __init__(self):
        self.bus = ZenohBus.router("lathe-1", "tcp/127.0.0.1:0")
        self.endpoint = self.bus.endpoint
        self.bus.offer(SampleBlock)
        self.bus.announce("machine")
        self.bus.serve_config(load_case("thesis-652").text)
        self.sent, self._end = [], threading.Event()
        self._thread = threading.Thread(target=self._talk, daemon=True)
        self._thread.start()

    def _talk(self):
        start, noise = time.monotonic(), np.random.default_rng(1)
        while not self._end.wait(max(0.0, start + 0.01 * len(self.sent) - time.monotonic())):
            self.bus.publish(block(len(self.sent), session=noise.bytes(1500).hex()))
            self.sent.append(time.monotonic())
            self.bus.answer()

    def calm(self):
        """Whether the last blocks went out in time: a busy machine only delays the test."""
        return np.max(np.diff(self.sent[-CALM_BLOCKS:]), initial=0.0) < CALM_S

    def close(self):
        self._end.set()
        self._thread.join()
        self.bus.close()


@pytest.fixture
def talker():
    with contextlib.closing(Talker()) as machine:
        yield machine


def numbers(path):
    reader = RecordingReader(path)
    return [m.sequence for topic, m, _ in reader.messages() if topic == "servo/turret1"], reader


def heard(path, count=20):
    return until(lambda: path.exists() and path.stat().st_size > BEGUN and len(numbers(path)[0]) > count)


def test_what_is_heard_is_in_the_file_and_ctrl_c_ends_it_whole(tmp_path, talker):
    path, full = tmp_path / "run.mcap", tmp_path / "full.mcap"
    options = ("--connect", talker.endpoint, "--json", "--out")
    with processes(tmp_path) as start, contextlib.closing(Spy(talker.endpoint)) as spy:
        first = start("record", "--part-s", "1", *options, str(path))
        line = command_line("record", *options, str(full))
        stuffed = start(line=["bash", "-c", 'ulimit -f 60; exec "$@"', "bash", *line])  # a disk of 60 KB
        assert heard(path)
        second = start("record", *options, str(path))
        assert until(lambda: "configuration" in first.told())
        assert until(lambda: second.ended() is not None)
        assert (second.ended(), "another recorder is writing" in second.said()["reason"]) == (3, True)
        assert spy.until(lambda: "recording_stopped" in {event.kind for event in spy.of(Event)})
        assert until(lambda: stuffed.ended() is not None)
        assert (stuffed.ended(), stuffed.said()["failure"].startswith("full.mcap ends early")) == (1, True)
        assert until(lambda: part_path(path, 2).exists())
        assert first.stop(signal.SIGINT) == 0
        said = first.said()
    assert said["parts"] >= 2
    got, reader = numbers(path)
    assert reader.whole
    assert reader.notes == []
    assert got == list(range(got[0], got[0] + len(got)))
    assert (said["missing"], said["lost"], said["undecodable"]) == (0, 0, 0)
    assert said["topics"]["servo/turret1"] == len(got)
    assert said["runs"] == ["run-1"]
    case = load_case("thesis-652")
    wanted = {"case": "thesis-652", "config": case.text, "sha256": case.digest, "run": "run-1", "machine": "lathe-1"}
    assert wanted.items() <= reader.metadata.items()
    assert json.loads(json.dumps(reader.metadata))["version"]
    assert 0 < len(numbers(full)[0]) < len(got)


def test_a_recording_goes_back_onto_a_bus_and_is_recorded_again(tmp_path, recorded):
    path, clock = tmp_path / "again.mcap", WallClock()
    with contextlib.ExitStack() as stack:
        router = stack.enter_context(ZenohBus.router("copy", "tcp/127.0.0.1:0"))
        bus = stack.enter_context(ZenohBus.client("copy", router.endpoint))
        writer = stack.enter_context(McapRecorder(path, {}))
        recorder = BusRecorder(bus, writer, {}, clock=clock, say=lambda _: None)
        assert until(lambda: "recorder" in router.alive())  # its subscription came before its sign of life
        serve_recorded_config(recorded[0], router)
        _, messages = stretch(recorded[0], stop_s=2.0)
        played = publish(messages, router, clock, StopSignal(), 20.0)

        def whole():
            router.answer()
            recorder.look()
            return recorder.config_known and recorder.topics.total() >= played.topics.total()

        assert until(whole)
        assert recorder.gaps.missing() == {}
        assert recorder.topics == played.topics
        assert recorder.runs[0].startswith("replay-")
    got, reader = numbers(path)
    assert got == list(range(200))
    assert reader.metadata["case"] == "thesis-652"
    assert {e.text for _, e, _ in reader.messages() if e.source == "recorder"} == {"replay is alive"}


def test_a_recorder_that_is_killed_loses_less_than_100_ms(tmp_path, talker):
    path = tmp_path / "run.mcap"
    with processes(tmp_path) as start:
        process = start("record", "--connect", talker.endpoint, "--out", str(path))
        assert heard(path, 2 * CALM_BLOCKS)
        assert until(talker.calm)
        killed = time.monotonic()
        process.popen.kill()
        process.popen.wait()
    got, reader = numbers(path)
    due = [number for number, sent in enumerate(talker.sent) if sent < killed - 0.1]
    assert "no end" in reader.notes[-1]
    assert got[-1] >= due[-1]
    assert got == list(range(got[0], got[-1] + 1))
    assert reader.metadata["case"] == "thesis-652"
