"""The spectrum of a sliding window at chosen frequencies, exact for ever."""

from dataclasses import dataclass
from math import ceil, isqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chatter import _kernels
from chatter.blocks import as_block, positive_integer, reject_non_finite

_GRID = 90
"""Samples per table span: one 10 ms block at 9 kHz, so that blocks on the grid fall on whole spans."""
_LANES = 8
"""Bins are padded to a multiple of this many float64 lanes."""


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
    parts = [np.fmod(part * index, sample_rate_hz) for part in (low, middle, high)]
    cycles = np.fmod(parts[0] + parts[1] + parts[2], sample_rate_hz) / sample_rate_hz
    quarter = np.rint(4.0 * cycles)
    angle = 2.0 * np.pi * (cycles - 0.25 * quarter)
    cosine, sine = np.cos(angle), np.sin(angle)
    turn = quarter.astype(np.int64) % 4
    return np.stack([np.choose(turn, [cosine, -sine, -cosine, sine]), np.choose(turn, [sine, cosine, -sine, -cosine])])


@dataclass(frozen=True, slots=True, kw_only=True)
class SlidingDFTState:
    """Copy of the whole state of a `SlidingDFT`."""

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
        bins = self.frequencies_hz.size
        padded = np.zeros(_LANES * ceil(bins / _LANES))
        padded[:bins] = self.frequencies_hz
        self._span = _GRID * ceil(isqrt(self.window) / (2 * _GRID))
        rows = np.concatenate([np.arange(self._span), np.arange(0, self.window, self._span), [self.window]])
        self._tables = twiddles(padded, rows, self.sample_rate_hz)
        self._ring = np.zeros((self.window, self.channels))
        self._state = np.zeros((3, self.channels, 2, padded.size))
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
        return self._advance(samples, max(samples.shape[0], 1), 1)[0]

    def spectra(self, block: ArrayLike, hop: int = 1) -> NDArray[np.complex128]:
        """Take a block and return the spectrum after each hop-th of its samples, shape (n // hop, channels, bins).

        Parameters
        ----------
        block : array_like, shape (n,) or (n, channels)
            New samples; those after the last whole hop are taken in as well.
        hop : int
            Samples from one spectrum to the next.
        """
        samples = as_block(block, self.channels)
        hop = positive_integer("hop", hop)
        return self._advance(samples, hop, samples.shape[0] // hop)

    def power(self, block: ArrayLike, hop: int = 1) -> NDArray[np.float64]:
        """Take a block and return abs(X)**2 after each hop-th of its samples, shape (n // hop, channels, bins).

        Parameters
        ----------
        block : array_like, shape (n,) or (n, channels)
            New samples; those after the last whole hop are taken in as well.
        hop : int
            Samples from one spectrum to the next.
        """
        spectra = self.spectra(block, hop)
        return spectra.real**2 + spectra.imag**2

    @property
    def seen(self) -> int:
        """Samples of the stream so far."""
        return self._seen

    def _advance(self, samples: NDArray[np.float64], hop: int, spectra: int) -> NDArray[np.complex128]:
        out = np.empty((spectra, self.channels, self.frequencies_hz.size), dtype=np.complex128)
        bad = _kernels.sliding_dft(samples, hop, self._ring, self._state, self._tables, self._span, self._position, out)
        if bad >= 0:
            reject_non_finite(samples, bad, self._seen)
        self._seen += samples.shape[0]
        self._position = (self._position + samples.shape[0]) % self.window
        return out

    def prepare(self) -> None:
        """Compile the kernel; the state stays as it is."""
        SlidingDFT([0.0], 2, 1.0, self.channels).update(np.zeros((2, self.channels)))

    def reset(self) -> None:
        """Forget every sample."""
        self._seen = self._position = 0
        self._ring[:] = 0.0
        self._state[:] = 0.0

    def snapshot(self) -> SlidingDFTState:
        """Return a copy of the whole state."""
        return SlidingDFTState(
            seen=self._seen,
            position=self._position,
            ring=self._ring.copy(),
            sums=self._state[:2, ..., : self.frequencies_hz.size].copy(),
        )

    def restore(self, state: SlidingDFTState) -> None:
        """Continue from a copy of the state.

        Parameters
        ----------
        state : SlidingDFTState
            What `snapshot` of an object with the same window, channels and frequencies returned.
        """
        sums = self._state[:2, ..., : self.frequencies_hz.size]
        if state.ring.shape != self._ring.shape or state.sums.shape != sums.shape:
            raise ValueError(
                f"state must be of (window, channels) {self._ring.shape} and sums {sums.shape},"
                f" got {state.ring.shape} and {state.sums.shape}"
            )
        self._seen, self._position = state.seen, state.position
        self._ring[:] = state.ring
        sums[:] = state.sums
