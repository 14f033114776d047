"""Butterworth filters as streams of second-order sections, without a transient at the start."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chatter import _kernels
from chatter.blocks import as_block, positive_integer, reject_non_finite

Kind = Literal["lowpass", "highpass", "bandpass"]


def butterworth(order: int, cutoff_hz: ArrayLike, sample_rate_hz: float, kind: Kind = "lowpass") -> NDArray[np.float64]:
    """Return the sections b0 b1 b2 a1 a2 of a Butterworth filter, bilinear with prewarping, shape (sections, 5).

    Parameters
    ----------
    order : int
        Order of the low-pass prototype; a band-pass has twice as many poles.
    cutoff_hz : float or (float, float)
        Frequency (Hz) where the gain is 1/sqrt(2); the two edges of a band-pass.
    sample_rate_hz : float
        Sampling rate (Hz).
    kind : {"lowpass", "highpass", "bandpass"}
        Which side passes.
    """
    order = positive_integer("order", order)
    edges = np.atleast_1d(np.asarray(cutoff_hz, dtype=np.float64))
    wanted = {"lowpass": 1, "highpass": 1, "bandpass": 2}
    if kind not in wanted:
        raise ValueError(f"kind must be one of {sorted(wanted)}, got {kind!r}")
    if edges.shape != (wanted[kind],) or not np.all((edges > 0.0) & (edges < 0.5 * sample_rate_hz)):
        raise ValueError(f"cutoff_hz must be {wanted[kind]} value(s) in (0, {0.5 * sample_rate_hz}), got {cutoff_hz}")
    if kind == "bandpass" and edges[0] >= edges[1]:
        raise ValueError(f"cutoff_hz must be (low, high) with low < high, got {cutoff_hz}")
    warped = np.tan(np.pi * edges / sample_rate_hz)
    half = np.exp(1j * np.pi * (0.5 + (2 * np.arange((order + 1) // 2) + 1) / (2 * order)))  # upper half plane
    if order % 2:
        half[-1] = -1.0
    if kind == "bandpass":
        return _bandpass(half, order, warped)
    poles = half * warped[0] if kind == "lowpass" else warped[0] / half
    zero = -1.0 if kind == "lowpass" else 1.0
    sections = [_section(p, (zero, zero) if i < order // 2 else (zero, None)) for i, p in enumerate(poles)]
    return np.array([_unit_gain(row, -zero) for row in sections])


def _bandpass(half: NDArray[np.complex128], order: int, warped: NDArray[np.float64]) -> NDArray[np.float64]:
    centre_squared, width = warped[0] * warped[1], warped[1] - warped[0]
    centre = np.exp(2j * np.arctan(np.sqrt(centre_squared)))
    sections = []
    for i, pole in enumerate(half):
        scaled = 0.5 * width * pole
        root = np.sqrt(scaled**2 - centre_squared + 0j)
        pair = (scaled + root, scaled - root)
        if i < order // 2:
            sections += [_section(p, (1.0, -1.0)) for p in pair]
        elif abs(pair[0].imag) > 0.0:
            sections.append(_section(pair[0], (1.0, -1.0)))
        else:
            z1, z2 = ((1.0 + p.real) / (1.0 - p.real) for p in pair)
            sections.append(np.array([1.0, 0.0, -1.0, -(z1 + z2), z1 * z2]))
    return np.array([_unit_gain(row, centre) for row in sections])


def _section(pole: complex, zeros: tuple[float, float | None]) -> NDArray[np.float64]:
    """Return b0 b1 b2 a1 a2 of an analogue pole (with its conjugate, or alone) and the digital zeros given."""
    z = (1.0 + pole) / (1.0 - pole)
    if zeros[1] is None:
        return np.array([1.0, -zeros[0], 0.0, -z.real, 0.0])
    return np.array([1.0, -(zeros[0] + zeros[1]), zeros[0] * zeros[1], -2.0 * z.real, abs(z) ** 2])


def _unit_gain(section: NDArray[np.float64], at: complex) -> NDArray[np.float64]:
    """Scale a section to gain 1 at a point of the unit circle."""
    powers = np.array([1.0, 1.0 / at, 1.0 / at**2])
    gain = (section[:3] @ powers) / (1.0 + section[3:] @ powers[1:])
    return np.concatenate([section[:3] / abs(gain), section[3:]])


def response(sections: NDArray[np.float64], frequency_hz: ArrayLike, sample_rate_hz: float) -> NDArray[np.complex128]:
    """Return the complex gain of sections at frequencies (Hz).

    Parameters
    ----------
    sections : ndarray, shape (sections, 5)
        Rows b0 b1 b2 a1 a2.
    frequency_hz : array_like
        Frequencies (Hz).
    sample_rate_hz : float
        Sampling rate (Hz).
    """
    delay = np.exp(-2j * np.pi * np.asarray(frequency_hz, dtype=np.float64) / sample_rate_hz)
    gain = np.ones_like(delay)
    for b0, b1, b2, a1, a2 in sections:
        gain = gain * (b0 + (b1 + b2 * delay) * delay) / (1.0 + (a1 + a2 * delay) * delay)
    return gain


def group_delay(sections: NDArray[np.float64], frequency_hz: float, sample_rate_hz: float) -> float:
    """Return the group delay (s) of sections at one frequency (Hz).

    Parameters
    ----------
    sections : ndarray, shape (sections, 5)
        Rows b0 b1 b2 a1 a2.
    frequency_hz : float
        Frequency (Hz).
    sample_rate_hz : float
        Sampling rate (Hz).
    """
    step = 1e-4 * sample_rate_hz
    after, before = response(sections, [frequency_hz + step, frequency_hz - step], sample_rate_hz)
    return float(-np.angle(after / before) / (4.0 * np.pi * step))


def steady_state(sections: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the state of every section under a constant input of one, shape (sections, 2).

    Parameters
    ----------
    sections : ndarray, shape (sections, 5)
        Rows b0 b1 b2 a1 a2.
    """
    state = np.empty((len(sections), 2))
    level = 1.0
    for row, (b0, b1, b2, a1, a2) in zip(state, sections, strict=True):
        out = level * (b0 + b1 + b2) / (1.0 + a1 + a2)
        row[1] = b2 * level - a2 * out
        row[0] = b1 * level - a1 * out + row[1]
        level = out
    return state


@dataclass(frozen=True, slots=True, kw_only=True)
class BiquadFilterState:
    """Copy of the whole state of a `BiquadFilter`."""

    seen: int
    delays: NDArray[np.float64]


class BiquadFilter:
    """Second-order sections over a stream of samples, transposed direct form II.

    Parameters
    ----------
    sections : array_like, shape (sections, 5)
        Rows b0 b1 b2 a1 a2 (a0 = 1), as from `butterworth`.
    channels : int
        Number of channels.
    steady_start : bool
        Start as if the first sample had stood for ever, instead of from zero.
    """

    def __init__(self, sections: ArrayLike, channels: int = 1, steady_start: bool = True) -> None:
        self.sections = np.array(sections, dtype=np.float64, ndmin=2)
        self.channels = positive_integer("channels", channels)
        self.steady_start = steady_start
        if self.sections.ndim != 2 or self.sections.shape[1] != 5 or not np.isfinite(self.sections).all():
            raise ValueError(f"sections must be finite and of shape (sections, 5), got {self.sections.shape}")
        self.sections.flags.writeable = False
        self._steady = steady_state(self.sections) if steady_start else np.zeros((len(self.sections), 2))
        self._delays = np.zeros((self.channels, len(self.sections), 2))
        self._seen = 0

    def update(self, block: ArrayLike) -> NDArray[np.float64]:
        """Take a block and return it filtered, shape (n, channels).

        Parameters
        ----------
        block : array_like, shape (n,) or (n, channels)
            New samples.
        """
        samples = as_block(block, self.channels)
        out = np.empty_like(samples)
        bad = _kernels.biquads(samples, self._seen == 0, self.sections, self._steady, self._delays, out)
        if bad >= 0:
            reject_non_finite(samples, bad, self._seen)
        self._seen += samples.shape[0]
        return out

    def prepare(self) -> None:
        """Compile the kernel; the state stays as it is."""
        BiquadFilter(self.sections, self.channels).update(np.zeros((2, self.channels)))

    def reset(self) -> None:
        """Forget every sample."""
        self._delays[:] = 0.0
        self._seen = 0

    def snapshot(self) -> BiquadFilterState:
        """Return a copy of the whole state."""
        return BiquadFilterState(seen=self._seen, delays=self._delays.copy())

    def restore(self, state: BiquadFilterState) -> None:
        """Continue from a copy of the state.

        Parameters
        ----------
        state : BiquadFilterState
            What `snapshot` of a filter of the same shape returned.
        """
        if state.delays.shape != self._delays.shape:
            raise ValueError(f"state must be of shape {self._delays.shape}, got {state.delays.shape}")
        self._seen = state.seen
        self._delays[:] = state.delays
