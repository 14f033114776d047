"""One run of the loop as a recording."""

from services.clock import WallClock
from services.closed_loop import Loop
from services.config import load_case
from services.nodes.recorder import RecorderNode
from services.recording_writer import McapRecorder, run_metadata
from services.tape import Tape

BLOCKS = 330
"""3.3 s: air, entry, chatter, the first shift and what follows."""


class RecordingTape(Tape):
    """A tape that records beside."""

    def __init__(self, recorder):
        super().__init__()
        self.recorder = recorder

    def add(self, message):
        super().add(message)
        if type(message).__name__ != "Tick":
            assert self.recorder.handle(message) == []


def metadata_of(case):
    return run_metadata(
        case=case.name, seed=7, run="", config=case.text, digest=case.digest, version="0", clock="samples"
    )


def record_loop(path):
    """Record the loop in lockstep; returns path, case and what was said."""
    case = load_case("thesis-652")
    loop = Loop(case, 7, WallClock())
    with McapRecorder(path, metadata_of(case)) as recorder:
        loop.tape = RecordingTape(RecorderNode(recorder, "run", case.settings.sample_rate_hz))
        for number in range(BLOCKS):
            loop.step(number)
    return path, case, loop.tape
