"""What every figure of a run needs, computed once: times, envelopes, the stretch worth looking at."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from services.figures.style import ALARM, CONTROLLED, MUTED, SHIFT, TWIN
from services.messages import BLOCK_S, Floats
from services.metrics import Summary, envelope_um
from services.record import RunRecord

Mark = tuple[float, str, str]
LEAD_S, TAIL_S = 0.25, 0.9
"""Shown before the tools enter and after the vibration is gone; the rest of a long, calm cut adds nothing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """A run made ready to be drawn.

    Attributes
    ----------
    time_s, report_time_s
        Time of each sample, shape (n,), and of each report, shape (b,), since the machine started (s).
    envelope_um, envelope_twin_um
        Vibration with and without control (um), shape (n,).
    window_s
        Stretch of time worth looking at (s).
    """

    record: RunRecord
    summary: Summary
    time_s: Floats
    report_time_s: Floats
    envelope_um: Floats
    envelope_twin_um: Floats
    window_s: tuple[float, float]

    @classmethod
    def of(cls, record: RunRecord, summary: Summary) -> View:
        """Prepare a run for drawing."""
        return cls(
            record=record,
            summary=summary,
            time_s=np.arange(record.controlled.shift_applied_deg.size) / record.sample_rate_hz,
            report_time_s=record.reports.first_sample / record.sample_rate_hz + BLOCK_S,
            envelope_um=envelope_um(record, record.controlled),
            envelope_twin_um=envelope_um(record, record.twin),
            window_s=_window(summary),
        )

    @property
    def cut_any(self) -> bool:
        """Whether the tools ever reached the part."""
        return self.summary.entered_cut_s is not None and self.time_s.size > 1

    @property
    def marks(self) -> list[Mark]:
        """Moments of the controlled cut."""
        s = self.summary
        named = [
            (s.entered_cut_s, "tools enter", MUTED), (s.detected_s, "chatter found", ALARM),
            (s.first_shift_s, "turret moves", SHIFT), (s.suppressed_s, "calm", CONTROLLED),
        ]  # fmt: skip
        return [(time_s, word, colour) for time_s, word, colour in named if time_s is not None]

    @property
    def marks_twin(self) -> list[Mark]:
        """Moments of the uncontrolled twin."""
        s = self.summary
        named = [(s.entered_cut_s, "tools enter", MUTED), (s.chatter_onset_s, "chatter begins", TWIN)]
        return [(time_s, word, colour) for time_s, word, colour in named if time_s is not None]

    def close_up(self, lead_s: float = 0.1, tail_s: float = 0.25) -> tuple[float, float]:
        """Stretch around the move and what led to it, else around detection or onset, else around entry (s)."""
        s = self.summary
        moments = [t for t in (s.chatter_onset_s, s.detected_s, s.first_shift_s, s.suppressed_s) if t is not None]
        if s.first_shift_s is not None:
            moments = [t for t in moments if t > s.first_shift_s - 0.4]
        first = min(moments) if moments else (s.entered_cut_s or 0.0)
        last = min(max(moments), first + 0.6) if moments else first
        return max(first - lead_s, 0.0), max(min(last + tail_s, s.simulated_s), first + 0.05)


def _window(summary: Summary) -> tuple[float, float]:
    start = max((summary.entered_cut_s or 0.0) - LEAD_S, 0.0)
    if summary.suppressed_s is None or summary.moves > 1:
        return start, summary.simulated_s
    return start, min(summary.simulated_s, summary.suppressed_s + TAIL_S)
