"""From blocks of a signal to one estimate for every block of the grid; the class that others use."""

from copy import deepcopy
from dataclasses import dataclass
from math import ceil
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chatter.blocks import as_block, positive_integer
from chatter.context import Context
from chatter.detector import Detector
from chatter.estimate import ChatterEstimate, MonitorConfig
from chatter.filters import BiquadFilter, butterworth, response
from chatter.line_kinds import Scene
from chatter.moving_variance import MovingVariance
from chatter.sliding_dft import SlidingDFT
from chatter.spectrum import hann_power

__all__ = ["ChatterEstimate", "ChatterMonitor", "MonitorConfig", "MonitorState"]

Floats = NDArray[np.float64]

ORDER = 3
"""Order of the band-pass: 18 dB per octave on either side, a delay of some 3 ms for 500...750 Hz."""
IMPLAUSIBLE = 1e75
"""Larger samples count as not finite: their squares must stay far from overflow."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MonitorState:
    """Copy of the whole state of a `ChatterMonitor`."""

    next_sample: int
    pending: Floats
    lost: int
    late: int
    parts: tuple[Any, ...]


class ChatterMonitor:
    """Two indicators of chatter on the 10 ms grid: moving variance of the band, and its strongest line.

    Input may be cut anywhere: it is re-blocked on the grid anchored at sample 0, and what `in_cut`, `spindle_hz` and
    `moving` say of a call holds for every block completed by it. Samples lost empty the windows and are reported in
    the next estimate; samples that come again are ignored and counted.

    Parameters
    ----------
    config : MonitorConfig
        Parameters.
    sample_rate_hz : float
        Sampling rate (Hz).
    channels : int
        Number of channels.
    """

    def __init__(self, config: MonitorConfig, sample_rate_hz: float, channels: int = 1) -> None:
        self.config = config
        self.sample_rate_hz = float(sample_rate_hz)
        self.channels = positive_integer("channels", channels)
        low, high = config.band_hz
        if not high < 0.5 * self.sample_rate_hz:
            raise ValueError(
                f"band_hz must end below {0.5 * self.sample_rate_hz} (half of the sampling rate), got {config.band_hz}"
            )
        self.block = max(round(config.block * self.sample_rate_hz), 1)
        self._window = round(config.window * self.sample_rate_hz)
        spacing = self.sample_rate_hz / self._window
        bins = np.arange(max(ceil(low / spacing - 1e-9), 1), int(high / spacing + 1e-9) + 1)
        self._frequencies_hz = np.asarray(bins * spacing, dtype=np.float64)
        around = np.concatenate([bins[:1] - 1, bins, bins[-1:] + 1]) * spacing
        sections = butterworth(ORDER, (low, high), self.sample_rate_hz, "bandpass")
        self._filter = BiquadFilter(sections, self.channels)
        self._inverse_gain = 1.0 / np.abs(response(sections, self._frequencies_hz, self.sample_rate_hz)) ** 2
        self._dft = SlidingDFT(np.minimum(around, 0.5 * self.sample_rate_hz), self._window, self.sample_rate_hz,
                               self.channels)  # fmt: skip
        self._variance = MovingVariance(self._window, self.channels)
        self._detector = Detector(
            config, self._frequencies_hz, 2.0 * (high - low) * config.window, self.sample_rate_hz, self.channels
        )
        self._context = Context(config, self.sample_rate_hz, self.channels)
        self.reset()

    def reset(self) -> None:
        """Forget everything, learned limits too; the stream may begin at any sample again."""
        self._next: int | None = None
        self._pending = np.zeros((0, self.channels))
        self._lost = self._late = 0
        self._restart()
        self._detector.reset()
        self._context.reset()

    def _restart(self) -> None:
        """Empty the windows; learned limits stay."""
        for part in (self._filter, self._dft, self._variance):
            part.reset()
        self._detector.restart()
        self._context.restart()

    def prepare(self) -> None:
        """Compile every kernel; the state stays as it is."""
        twin = ChatterMonitor(self.config, self.sample_rate_hz, self.channels)
        time = np.arange(2 * self._window + self.block) / self.sample_rate_hz
        tone = np.sin(2.0 * np.pi * float(np.mean(self.config.band_hz)) * time)
        twin.process(np.repeat(tone[:, None], self.channels, axis=1), 0)

    def process(
        self,
        block: ArrayLike,
        first_sample: int,
        *,
        in_cut: bool | None = None,
        spindle_hz: float | None = None,
        moving: bool = False,
        encoder_hz: tuple[float, ...] = (),
    ) -> list[ChatterEstimate]:
        """Take samples and return the estimate of every block of the grid that they complete.

        Parameters
        ----------
        block : array_like, shape (n, channels)
            New samples.
        first_sample : int
            Index of the first of them.
        in_cut : bool or None
            Whether the tools cut; None when nobody knows.
        spindle_hz : float or None
            Spindle speed, when known (Hz).
        moving : bool
            Whether a turret moves.
        encoder_hz : tuple of float
            Signal periods per second of every encoder of a moving axis (Hz), always in the same order: its errors
            make lines there and at multiples.
        """
        samples = as_block(block, self.channels)
        if first_sample < 0:
            raise ValueError(f"first_sample must not be negative, got {first_sample}")
        samples = self._join(samples, int(first_sample))
        if self._next is None or not len(samples):
            return []
        data = np.concatenate([self._pending, samples]) if len(self._pending) else samples
        first = self._next - len(self._pending)
        whole = len(data) // self.block
        self._pending = data[whole * self.block :].copy()
        self._next += len(samples)
        told = Scene(in_cut=in_cut, spindle_hz=spindle_hz, moving=bool(moving), encoder_hz=tuple(encoder_hz))
        size = self.block
        return [self._estimate(data[i * size : (i + 1) * size], first + i * size, told) for i in range(whole)]

    def _join(self, samples: Floats, first_sample: int) -> Floats:
        """Return the samples that continue the stream on the grid, after noting what is lost or late."""
        if self._next is None:
            self._next = first_sample - first_sample % self.block
        end = first_sample + len(samples)
        if first_sample < self._next:
            ignored = min(self._next, end) - first_sample
            self._late += ignored
            return samples[ignored:]
        if first_sample == self._next:
            return samples
        self._restart()
        start = self.block * ceil(first_sample / self.block)
        self._lost += start - (self._next - len(self._pending))
        self._pending = np.zeros((0, self.channels))
        self._next = start
        if end < start:  # not even the first whole block begins in here
            self._lost -= start - end
            self._next = end
            return samples[:0]
        return samples[start - first_sample :]

    def _estimate(self, block: Floats, first: int, told: Scene) -> ChatterEstimate:
        gap, late, self._lost, self._late = self._lost, self._late, 0, 0
        common: dict[str, Any] = {
            "first_sample": first,
            "samples": len(block),
            "gap": gap,
            "late": late,
            "moving": told.moving,
        }
        fields = self._fields(block, told)
        if gap and fields["state"] != "invalid":
            fields |= {"state": "gap", "confidence": 0.0}
        return ChatterEstimate(**common, **fields)

    def _fields(self, block: Floats, told: Scene) -> dict[str, Any]:
        """Return the fields of the estimate that follow from the samples."""
        usable, wrong = False, ()
        if np.abs(block).max() <= IMPLAUSIBLE:
            usable, wrong = self._context.examine(block, told.in_cut)
        if not usable:
            self._restart()
            return {"state": "invalid", "cutting": told.in_cut, "notes": wrong}
        band, power, square = self._analyse(block)
        scene, notes, comb_hz = self._context.complete(block, power, told)
        fields = self._detector.step(band, power, square, scene)
        return {**fields, "cutting": scene.in_cut, "comb_hz": comb_hz, "notes": (*notes, *wrong)}

    def _analyse(self, block: Floats) -> tuple[Floats, Floats, float]:
        """Return the band-passed block, the squared line amplitude of every bin and the mean square of the window."""
        band = self._filter.update(block)
        power = hann_power(self._dft.update(band), self._window) * self._inverse_gain
        return band, power, float(self._variance.update(band)[-1].sum())

    def snapshot(self) -> MonitorState:
        """Return a copy of the whole state."""
        return MonitorState(
            next_sample=-1 if self._next is None else self._next,
            pending=self._pending.copy(),
            lost=self._lost,
            late=self._late,
            parts=tuple(part.snapshot() for part in self._parts),
        )

    def restore(self, state: MonitorState) -> None:
        """Continue from a copy of the state.

        Parameters
        ----------
        state : MonitorState
            What `snapshot` of a monitor with the same parameters returned.
        """
        self._next = None if state.next_sample < 0 else state.next_sample
        self._pending, self._lost, self._late = state.pending.copy(), state.lost, state.late
        for part, saved in zip(self._parts, state.parts, strict=True):
            part.restore(deepcopy(saved))

    @property
    def _parts(self) -> tuple[Any, ...]:
        return self._filter, self._dft, self._variance, self._context, self._detector
