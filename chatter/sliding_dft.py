"""The spectrum of a sliding window at chosen frequencies, exact for ever."""

from dataclasses import dataclass
from math import ceil, isqrt, log2
from sys import getrefcount

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.fft import rfft

from chatter import _dft_kernels as kernels
from chatter._dft_kernels import MAXIMUM, PLAN, POSITION, POWER, SEEN, SPECTRUM
from chatter._kernels import first_non_finite
from chatter._row_kernels import ROW, TILE, Plan
from chatter.blocks import aligned, as_block, positive_integer, reject_non_finite
from chatter.twiddles import neighbours, tables

_GRID = 90
"""Samples per span, or a divisor of them: one 10 ms block at 9 kHz, so that blocks on the grid fall on whole spans."""
_LONG = 2 * _GRID
"""Samples of a hop up to which no whole window is transformed, however many the bins."""
_EFFORT = 20
"""What a transform takes for each sample and halving of the window, in tiles times rank of a sample of a span."""
_COMPLEX = np.dtype(np.complex128)
_CHUNK = 32
"""Spectra taken at a time where they are weighted afterwards."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SlidingDFTState:
    """Copy of the whole state of a `SlidingDFT`."""

    frequencies_hz: NDArray[np.float64]
    window: int
    hann: bool
    clock: NDArray[np.int64]
    memory: NDArray[np.float64]


class SlidingDFT:
    """Spectrum ``X_k = sum_i y[i] exp(-2j pi f_k i / f_s)``, i = 0 the oldest of the last ``window`` samples.

    Samples before the start of the stream count as zeros. Any frequencies may be asked for, not only multiples of
    ``f_s / window``. Nothing that leaves the window is ever taken out of a sum that lasts longer than a span of some 90
    samples, and the twiddles have exactly reduced phases: the error does not grow. A call does the work that its hop
    needs: sample by sample for short ones, whole spans by a product of low rank for long ones, whole windows by a fast
    transform where the bins are many and on its grid; the sums are then made up for by the next call that needs them.

    Parameters
    ----------
    frequencies_hz : array_like, shape (bins,)
        Frequencies (Hz), in [0, sample_rate_hz / 2].
    window : int
        Samples in the window.
    sample_rate_hz : float
        Sampling rate (Hz).
    channels : int
        Number of channels.
    hann : bool
        Weight the window by (1 - cos(2 pi i / window)) / 2, in the frequency domain.
    """

    def __init__(
        self,
        frequencies_hz: ArrayLike,
        window: int,
        sample_rate_hz: float,
        channels: int = 1,
        *,
        hann: bool = False,
    ) -> None:
        self.frequencies_hz = np.array(frequencies_hz, dtype=np.float64, ndmin=1)
        self.window = positive_integer("window", window)
        self.sample_rate_hz = float(sample_rate_hz)
        self.channels = positive_integer("channels", channels)
        self.hann = hann
        self._check()
        self.frequencies_hz.flags.writeable = False
        all_hz, steps, self._distance = self.frequencies_hz, 0, 0
        if hann:
            all_hz, steps, self._distance = neighbours(self.frequencies_hz, self.window, self.sample_rate_hz)
        self._bins = self.frequencies_hz.size
        on_grid = np.rint(all_hz * (self.window / self.sample_rate_hz)).astype(np.int64) + steps
        self._turned = (on_grid % self.window) > self.window // 2
        self._places = np.where(self._turned, -on_grid, on_grid) % self.window
        span = _GRID * ceil(isqrt(self.window) / (2 * _GRID))
        self._lay_out(span, *tables(all_hz, steps, self.window, self.sample_rate_hz, span))

    def _check(self) -> None:
        if not (np.isfinite(self.sample_rate_hz) and self.sample_rate_hz > 0.0):
            raise ValueError(f"sample_rate_hz must be positive, got {self.sample_rate_hz}")
        if self.frequencies_hz.ndim != 1 or self.frequencies_hz.size == 0:
            raise ValueError(f"frequencies_hz must be of shape (bins,), got {self.frequencies_hz.shape}")
        outside = ~((self.frequencies_hz >= 0.0) & (self.frequencies_hz <= 0.5 * self.sample_rate_hz))
        if outside.any():
            raise ValueError(
                f"frequencies_hz must be in [0, {0.5 * self.sample_rate_hz}], got {self.frequencies_hz[outside][0]}"
            )
        if self.window >= 2**26:
            raise ValueError(f"window must be below 2**26, got {self.window}")

    def _lay_out(
        self,
        span: int,
        table: NDArray[np.float64],
        middles: NDArray[np.float64],
        fold: NDArray[np.float64],
        rank: int,
        late: int,
    ) -> None:
        """Put tables and state into one array and describe it for the kernel."""
        tiles, spans, width, group = len(table), len(middles), fold.shape[2], isqrt(len(middles))
        rows, constants = tiles * self.channels, [table, middles, fold]
        sizes = [part.size for part in constants]
        sizes += [3 * span, 2 * width * (kernels.MANY * self.channels + 2), *[rows * ROW] * 3, spans * rows * ROW,
                  ceil(spans / group) * rows * ROW, self.channels * self.window, self.channels * 2 * span]  # fmt: skip
        places = [int(place) for place in np.cumsum([0, *(8 * ceil(size / 8) for size in sizes)])]
        self._work = aligned(places[-1])
        self._work[:] = 0.0
        for part, place in zip(constants, places, strict=False):
            self._work[place : place + part.size] = part.ravel()
        numbers = (span, spans, group, late, rank, width, table[0].size)
        plan = Plan(self.window, self.channels, tiles, *numbers, *places[1:-1])
        self._clock = np.array([*[0] * PLAN, *plan])
        self._state, self._ring_at, self._behind = plan.part, plan.ring, False
        pays = ceil(_EFFORT * self.window * log2(self.window) / (tiles * rank))
        self._long = 2**62 if late else max(_LONG, pays)
        self._shape = (self.channels, tiles * TILE)
        self._last = self._before = np.empty(self._shape, _COMPLEX)  # memory of the last two answers
        self._long_last = self._long_before = aligned(0)
        self._asked = (slice(None), slice(self._bins))

    @property
    def _memory(self) -> NDArray[np.float64]:
        return self._work[self._state :]

    @property
    def _ring(self) -> NDArray[np.float64]:
        ring = self._work[self._ring_at : self._ring_at + self.channels * self.window]
        return ring.reshape(self.channels, self.window)

    @property
    def seen(self) -> int:
        """Samples of the stream so far."""
        return int(self._clock[SEEN])

    def update(self, block: ArrayLike) -> NDArray[np.complex128]:
        """Take a block and return the spectrum after its last sample, shape (channels, bins).

        Parameters
        ----------
        block : array_like, shape (n,) or (n, channels)
            New samples; an empty block returns the present spectrum.
        """
        samples = as_block(block, self.channels)
        hop = len(samples)
        if self.hann:
            return self._weighted(samples, hop, SPECTRUM).view(np.complex128).reshape(-1, self._bins)
        self._last, self._before = self._before, self._last
        if getrefcount(self._last) > 2:  # somebody holds that answer still; else its memory serves again
            self._last = np.empty(self._shape, _COMPLEX)
        out = self._last
        if self._behind or hop >= self._long:
            self._advance(samples, hop, SPECTRUM, out)
            return out[self._asked]
        bad = kernels.sliding_dft(samples, hop, SPECTRUM, self._work, self._clock, out)
        if bad >= 0:
            reject_non_finite(samples, bad, self.seen)
        return out[self._asked]

    def spectra(self, block: ArrayLike, hop: int = 1) -> NDArray[np.complex128]:
        """Take a block and return the spectrum after each hop-th of its samples, shape (n // hop, channels, bins).

        Parameters
        ----------
        block : array_like, shape (n,) or (n, channels)
            New samples; those after the last whole hop are taken in as well.
        hop : int
            Samples from one spectrum to the next.
        """
        samples, hop = as_block(block, self.channels), positive_integer("hop", hop)
        if self.hann:
            return self._weighted(samples, hop, SPECTRUM).view(np.complex128).reshape(-1, self.channels, self._bins)
        channels, width = self._shape
        out = self._room(len(samples) // hop * channels * width * 2).view(np.complex128)
        self._advance(samples, hop, SPECTRUM, out.reshape(-1, width))
        return out.reshape(-1, channels, width)[..., : self._bins]

    def power(self, block: ArrayLike, hop: int = 1) -> NDArray[np.float64]:
        """Take a block and return abs(X)**2 after each hop-th of its samples, shape (n // hop, channels, bins).

        Parameters
        ----------
        block : array_like, shape (n,) or (n, channels)
            New samples; those after the last whole hop are taken in as well.
        hop : int
            Samples from one spectrum to the next.
        """
        samples, hop = as_block(block, self.channels), positive_integer("hop", hop)
        if self.hann:
            return self._weighted(samples, hop, POWER).reshape(-1, self.channels, self._bins)
        if hop >= self._long:
            found = self.spectra(samples, hop)
            return found.real**2 + found.imag**2
        channels, width = self._shape
        out = self._room(len(samples) // hop * channels * width)
        self._advance(samples, hop, POWER, out.view(np.complex128).reshape(-1, TILE // 2))
        return out.reshape(-1, channels, width)[..., : self._bins]

    def maximum(self, block: ArrayLike) -> NDArray[np.float64]:
        """Take a block and return the largest abs(X)**2 of each bin after any of its samples, shape (channels, bins).

        So it is the largest since it was last asked for. An empty block returns the present power.

        Parameters
        ----------
        block : array_like, shape (n,) or (n, channels)
            New samples.
        """
        samples = as_block(block, self.channels)
        hop = min(len(samples), 1)
        if not self.hann:
            out = np.zeros(self._shape)
            self._advance(samples, hop, MAXIMUM, out.view(np.complex128))
            return out[:, : self._bins]
        self._refuse(samples)
        out = np.zeros((self.channels, self._bins))
        for start in range(0, max(len(samples), 1), _CHUNK):
            powers = self._weighted(samples[start : start + _CHUNK], hop, POWER)
            np.maximum(out, powers.reshape(-1, *out.shape).max(axis=0), out=out)
        return out

    def _room(self, numbers: int) -> NDArray[np.float64]:
        """Return memory for an answer: that of the one before the last, if it has the size and nobody holds it."""
        self._long_last, self._long_before = self._long_before, self._long_last
        if self._long_last.size != numbers or getrefcount(self._long_last.base) > 2:
            self._long_last = aligned(numbers)
        return self._long_last

    def _weighted(self, samples: NDArray[np.float64], hop: int, mode: int) -> NDArray[np.float64]:
        """Return weighted spectra as pairs of floats, or their squared sizes, flat."""
        rows = (len(samples) // hop if hop else 1) * self.channels
        raw = np.empty((rows, self._shape[1]), np.complex128)
        self._advance(samples, hop, SPECTRUM, raw)
        out = np.empty(rows * self._bins * (1 if mode == POWER else 2))
        kernels.weigh_hann(raw, rows, self._distance, self._bins, mode, out)
        return out

    def _advance(self, samples: NDArray[np.float64], hop: int, mode: int, out: NDArray[np.complex128]) -> None:
        if hop >= self._long:
            self._transform(samples, hop, out)
            return
        if self._behind:
            self._catch_up()
        bad = kernels.sliding_dft(samples, hop, mode, self._work, self._clock, out)
        if bad >= 0:
            reject_non_finite(samples, bad, self.seen)

    def _transform(self, samples: NDArray[np.float64], hop: int, out: NDArray[np.complex128]) -> None:
        """Write the spectra by a fast transform of each window, and leave the sums behind."""
        self._refuse(samples)
        for start in range(0, len(samples), hop):
            piece = samples[start : start + hop]
            self._keep(piece)
            if len(piece) == hop:
                position = int(self._clock[POSITION])
                window = np.concatenate([self._ring[:, position:], self._ring[:, :position]], axis=1)
                found = np.asarray(rfft(window, axis=1))[:, self._places]
                first = start // hop * self.channels
                rows = out[first : first + self.channels, : self._places.size]
                rows[:] = np.where(self._turned, found.conj(), found)
        self._behind = True

    def _keep(self, samples: NDArray[np.float64]) -> None:
        """Take samples into the ring alone."""
        self._clock[SEEN] += len(samples)
        position = (int(self._clock[POSITION]) + max(len(samples) - self.window, 0)) % self.window
        last = samples[-self.window :].T
        room = min(self.window - position, last.shape[1])
        self._ring[:, position : position + room] = last[:, :room]
        self._ring[:, : last.shape[1] - room] = last[:, room:]
        self._clock[POSITION] = (position + last.shape[1]) % self.window

    def _catch_up(self) -> None:
        """Make the sums of what is in the ring."""
        position, seen, ring = int(self._clock[POSITION]), self.seen, self._ring.T.copy()
        self.reset()
        nothing = np.empty((1, TILE), np.complex128)
        for start, stop in ((position, self.window), (0, position)):
            epoch = np.zeros((stop, self.channels))
            epoch[start:] = ring[start:stop]
            kernels.sliding_dft(epoch, 2**62, SPECTRUM, self._work, self._clock, nothing)
        self._clock[SEEN] = seen

    def _refuse(self, samples: NDArray[np.float64]) -> None:
        bad = first_non_finite(samples)
        if bad >= 0:
            reject_non_finite(samples, bad, self.seen)

    def prepare(self) -> None:
        """Compile the kernels; the state stays as it is."""
        twin = SlidingDFT([0.0], 2, 1.0, self.channels, hann=self.hann)
        twin.update(np.zeros((2, self.channels)))

    def reset(self) -> None:
        """Forget every sample."""
        self._behind = False
        self._clock[:PLAN] = 0
        self._memory[:] = 0.0

    def snapshot(self) -> SlidingDFTState:
        """Return a copy of the whole state."""
        if self._behind:
            self._catch_up()
        return SlidingDFTState(
            frequencies_hz=self.frequencies_hz,
            window=self.window,
            hann=self.hann,
            clock=self._clock[:PLAN].copy(),
            memory=self._memory.copy(),
        )

    def restore(self, state: SlidingDFTState) -> None:
        """Continue from a copy of the state.

        Parameters
        ----------
        state : SlidingDFTState
            What `snapshot` of an object with the same window, channels and frequencies returned.
        """
        same = state.hann == self.hann and np.array_equal(state.frequencies_hz, self.frequencies_hz)
        if not same or (state.window, state.memory.size) != (self.window, self._memory.size):
            raise ValueError(
                f"state must be of {self.channels} channels, a window of {self.window} and the same {self._bins}"
                f" frequencies, got a window of {state.window} and {state.frequencies_hz.size} frequencies"
            )
        self._behind = False
        self._clock[:PLAN] = state.clock
        self._memory[:] = state.memory
