"""The spectrum of a sliding window at chosen frequencies, exact for ever."""

from dataclasses import dataclass
from math import ceil, isqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chatter import _dft_kernels
from chatter._dft_kernels import PAIR, PARTS, TILE
from chatter.blocks import as_block, positive_integer, reject_non_finite

_GRID = 90
"""Samples per table span: one 10 ms block at 9 kHz, so that blocks on the grid fall on whole spans."""


def twiddles(frequencies_hz: NDArray[np.float64], samples: ArrayLike, sample_rate_hz: float) -> NDArray[np.float64]:
    """Return cosine and sine of 2 pi f i / f_s with the phase reduced exactly, shape (2, samples, frequencies).

    Parameters
    ----------
    frequencies_hz : ndarray, shape (k,)
        Frequencies (Hz).
    samples : array_like of int, shape (n,)
        Sample indices i, below 2**26.
    sample_rate_hz : float
        Sampling rate (Hz).
    """
    index = np.asarray(samples, dtype=np.float64)[:, None]
    high = frequencies_hz.astype(np.float32).astype(np.float64)  # 24 bits: high * index is exact, and so is the rest
    middle = (frequencies_hz - high).astype(np.float32).astype(np.float64)
    low = frequencies_hz - high - middle
    rest, quarters = 0.0, 0.0
    for part in (low, middle, high):  # each reduced to an eighth of a cycle without rounding, then smallest first
        left = np.fmod(part * index, sample_rate_hz)
        quarter = np.rint(4.0 * left / sample_rate_hz)
        rest = rest + (left - quarter * (0.25 * sample_rate_hz))
        quarters = quarters + quarter
    angle = 2.0 * np.pi * (rest / sample_rate_hz)
    cosine, sine = np.cos(angle), np.sin(angle)
    turn = quarters.astype(np.int64) % 4
    return np.stack([np.choose(turn, [cosine, -sine, -cosine, sine]), np.choose(turn, [sine, cosine, -sine, -cosine])])


@dataclass(frozen=True, slots=True, kw_only=True)
class SlidingDFTState:
    """Copy of the whole state of a `SlidingDFT`."""

    frequencies_hz: NDArray[np.float64]
    seen: int
    position: int
    ring: NDArray[np.float64]
    sums: NDArray[np.float64]


class SlidingDFT:
    """Spectrum ``X_k = sum_i y[i] exp(-2j pi f_k i / f_s)``, i = 0 the oldest of the last ``window`` samples.

    Samples before the start of the stream count as zeros. Any frequencies may be asked for, not only multiples of
    ``f_s / window``. The sums are kept in the frame of the present epoch of ``window`` samples, with twiddles whose
    phase is reduced exactly, and are replaced by freshly built ones at the end of every epoch: the error does not grow.

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
    """

    def __init__(self, frequencies_hz: ArrayLike, window: int, sample_rate_hz: float, channels: int = 1) -> None:
        self.frequencies_hz = np.array(frequencies_hz, dtype=np.float64, ndmin=1)
        self.window = positive_integer("window", window)
        self.sample_rate_hz = float(sample_rate_hz)
        self.channels = positive_integer("channels", channels)
        self._check()
        self.frequencies_hz.flags.writeable = False
        self._tiles = ceil(self.frequencies_hz.size / TILE)
        span = _GRID * ceil(isqrt(self.window) / (2 * _GRID))
        padded = np.zeros(TILE * self._tiles)
        padded[: self.frequencies_hz.size] = self.frequencies_hz
        rows = np.concatenate([np.arange(span + 1), np.arange(0, self.window, span), [self.window]])
        table = twiddles(padded, rows, self.sample_rate_hz) * np.array([1.0, -1.0])[:, None, None]
        self._tables = _aligned(table.size)
        self._tables[:] = table.reshape(2, rows.size, self._tiles, TILE).transpose(2, 1, 0, 3).ravel()
        self._ring = np.zeros((self.window, self.channels))
        self._series = np.zeros((self.channels, 2, span))
        self._state = _aligned(self._tiles * self.channels * PARTS * PAIR)
        self._seen = self._position = 0

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

    def update(self, block: ArrayLike) -> NDArray[np.complex128]:
        """Take a block and return the spectrum after its last sample, shape (channels, bins).

        Parameters
        ----------
        block : array_like, shape (n,) or (n, channels)
            New samples; an empty block returns the present spectrum.
        """
        samples = as_block(block, self.channels)
        return self._advance(samples, samples.shape[0], 1, False).view(np.complex128)[0, :, : self.frequencies_hz.size]

    def spectra(self, block: ArrayLike, hop: int = 1) -> NDArray[np.complex128]:
        """Take a block and return the spectrum after each hop-th of its samples, shape (n // hop, channels, bins).

        Parameters
        ----------
        block : array_like, shape (n,) or (n, channels)
            New samples; those after the last whole hop are taken in as well.
        hop : int
            Samples from one spectrum to the next.
        """
        out = self._every(block, hop, False).view(np.complex128)
        return out[..., : self.frequencies_hz.size]

    def power(self, block: ArrayLike, hop: int = 1) -> NDArray[np.float64]:
        """Take a block and return abs(X)**2 after each hop-th of its samples, shape (n // hop, channels, bins).

        Parameters
        ----------
        block : array_like, shape (n,) or (n, channels)
            New samples; those after the last whole hop are taken in as well.
        hop : int
            Samples from one spectrum to the next.
        """
        return self._every(block, hop, True)[..., : self.frequencies_hz.size]

    def _every(self, block: ArrayLike, hop: int, power: bool) -> NDArray[np.float64]:
        samples = as_block(block, self.channels)
        hop = positive_integer("hop", hop)
        if samples.shape[0] == 0:
            return np.empty((0, self.channels, TILE * self._tiles * (1 if power else 2)))
        return self._advance(samples, hop, samples.shape[0] // hop, power)

    @property
    def seen(self) -> int:
        """Samples of the stream so far."""
        return self._seen

    def _advance(self, samples: NDArray[np.float64], hop: int, spectra: int, power: bool) -> NDArray[np.float64]:
        out = np.empty((spectra, self.channels, TILE * self._tiles * (1 if power else 2)))
        bad = _dft_kernels.sliding_dft(
            samples, hop, power, self._ring, self._series, self._tables, self._state, self._tiles, self._position,
            out.reshape(-1),
        )  # fmt: skip
        if bad >= 0:
            reject_non_finite(samples, bad, self._seen)
        self._seen += samples.shape[0]
        self._position = (self._position + samples.shape[0]) % self.window
        return out

    def prepare(self) -> None:
        """Compile the kernel; the state stays as it is."""
        twin = SlidingDFT([0.0], 2, 1.0, self.channels)
        twin.update(np.zeros((2, self.channels)))
        twin.power(np.zeros((2, self.channels)))

    def reset(self) -> None:
        """Forget every sample."""
        self._seen = self._position = 0
        self._ring[:] = 0.0
        self._state[:] = 0.0

    def snapshot(self) -> SlidingDFTState:
        """Return a copy of the whole state."""
        return SlidingDFTState(
            frequencies_hz=self.frequencies_hz,
            seen=self._seen,
            position=self._position,
            ring=self._ring.copy(),
            sums=self._state.copy(),
        )

    def restore(self, state: SlidingDFTState) -> None:
        """Continue from a copy of the state.

        Parameters
        ----------
        state : SlidingDFTState
            What `snapshot` of an object with the same window, channels and frequencies returned.
        """
        if state.ring.shape != self._ring.shape or not np.array_equal(state.frequencies_hz, self.frequencies_hz):
            raise ValueError(
                f"state must be of (window, channels) {self._ring.shape} and the same {self.frequencies_hz.size}"
                f" frequencies, got {state.ring.shape} and {state.frequencies_hz.size}"
            )
        self._seen, self._position = state.seen, state.position
        self._ring[:], self._state[:] = state.ring, state.sums


def _aligned(size: int) -> NDArray[np.float64]:
    """Return zeros whose first stands at the start of a cache line, shape (size,)."""
    raw = np.zeros(size + 8)
    skip = -raw.ctypes.data % 64 // 8
    return raw[skip : skip + size]
