"""A frequency response as a small linear model: rational fractions, iterated, in partial fractions.

The iterated and weighted least squares of a rational fraction polynomial (Sanathanan and Koerner, IEEE TAC 8 (1963) 56)
loses its digits in powers of s; with the poles of the step before as its basis it keeps them (Gustavsen and Semlyen,
IEEE Trans. Power Delivery 14 (1999) 1052; Hendrickx and Dhaene, ibid. 21 (2006) 441, for the two being one).
Frequencies are divided by the largest; poles on the right are mirrored; the model has a real block of two states for
each pair.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chatter.observers.kalman import ForceModel

Floats = NDArray[np.float64]
Complexes = NDArray[np.complexfloating[Any, Any]]

ITERATIONS = 30
MOST_ORDER = 16
ENOUGH = 1.3
"""Times the least error of any order: the smallest order that comes so near is taken."""
_DAMPING, _EXACT = 0.01, 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class ResponseFit:
    """A model and how well it holds.

    Parameters
    ----------
    model : ForceModel
        State space, continuous.
    poles : ndarray of complex
        (rad/s), shape (order,).
    relative_error : float
        Norm of the weighted residual over that of the response.
    flags : tuple of str
        What is doubtful.
    """

    model: ForceModel
    poles: Complexes
    relative_error: float
    flags: tuple[str, ...] = ()


def model_of_response(
    frequency_hz: ArrayLike, response: ArrayLike, *, order: int | None = None, weight: ArrayLike | None = None
) -> ResponseFit:
    """Return the state space that has a frequency response.

    Parameters
    ----------
    frequency_hz : array_like, shape (lines,)
        (Hz)
    response : array_like, shape (lines,)
        Complex: thrust over force for the Kalman filter.
    order : int or None
        States; None for the smallest even number that more states do not better.
    weight : array_like or None
        shape (lines,); None for all lines alike, relative to the largest response.
    """
    hz, h = np.asarray(frequency_hz, dtype=np.float64), np.asarray(response, dtype=np.complex128)
    w = np.ones(hz.size) if weight is None else np.asarray(weight, dtype=np.float64)
    if hz.ndim != 1 or h.shape != hz.shape or w.shape != hz.shape:
        raise ValueError(f"response must be of the shape of frequency_hz {hz.shape}, got {h.shape} and {w.shape}")
    if not (np.isfinite(hz).all() and (hz > 0.0).all() and np.isfinite(h).all() and (w >= 0.0).all()):
        raise ValueError("frequency_hz must be positive, response finite, weight at least 0, got others")
    if order is not None and not 1 <= order <= MOST_ORDER:
        raise ValueError(f"order must be in 1..{MOST_ORDER}, got {order}")
    if hz.size < 2 * (order or 2) + 2:
        raise ValueError(f"frequency_hz must have at least {2 * (order or 2) + 2} lines, got {hz.size}")
    if order is not None:
        return _fit(hz, h, w, order)
    found = [_fit(hz, h, w, even) for even in range(2, max(2, min(MOST_ORDER, hz.size // 4)) + 1, 2)]
    enough = max(ENOUGH * min(one.relative_error for one in found), _EXACT)
    return next(one for one in found if one.relative_error <= enough)


def _fit(hz: Floats, h: Complexes, w: Floats, order: int) -> ResponseFit:
    top = 2.0 * np.pi * float(hz.max())
    s = 2j * np.pi * hz / top
    poles = _start(hz / hz.max(), order)
    best: tuple[float, Complexes] | None = None
    for _ in range(ITERATIONS):
        poles = _moved(s, h, w, poles)
        error = _residues(s, h, w, poles)[1]
        if best is None or error < best[0]:
            best = (error, poles)
    error, poles = best if best is not None else (np.inf, poles)
    coefficients, _ = _residues(s, h, w, poles)
    flags: list[str] = []
    if error > 0.1:
        flags.append(f"the model leaves {100.0 * error:.0f} % of the response")
    beyond = int(np.count_nonzero(np.abs(poles) > 3.0))
    if beyond:
        flags.append(f"{beyond} poles lie far above the highest line")
    model = _state_space(poles * top, coefficients, top)
    return ResponseFit(model=model, poles=poles * top, relative_error=error, flags=tuple(flags))


def _start(hz: Floats, order: int) -> Complexes:
    """Return pairs of lightly damped poles spread over the band, and a real one if the order is odd."""
    omega = np.geomspace(max(float(hz.min()), 1e-3), 1.0, order // 2) if order > 1 else np.zeros(0)
    pairs = omega * (-_DAMPING + 1j)
    real = np.array([-1.0 + 0j]) if order % 2 else np.zeros(0, dtype=np.complex128)
    return _paired(np.concatenate([pairs, pairs.conj(), real]))


def _paired(poles: Complexes) -> Complexes:
    """Return stable poles: real ones first, then each upper one before its conjugate."""
    left = -np.maximum(np.abs(poles.real), 1e-9) + 1j * poles.imag
    flat = np.abs(left.imag) < 1e-9 * np.maximum(np.abs(left), 1e-12)
    upper = left[~flat & (left.imag > 0.0)]
    upper = upper[np.argsort(upper.imag)]
    pairs = np.column_stack([upper, upper.conj()]).ravel()
    return np.concatenate([np.sort(left[flat].real).astype(np.complex128), pairs])


def _basis(s: Complexes, poles: Complexes) -> Complexes:
    """Return the partial fractions with real coefficients, shape (lines, order)."""
    parts = 1.0 / (s[:, None] - poles)
    out = parts.copy()
    for k in np.flatnonzero(poles.imag > 0.0):
        out[:, k], out[:, k + 1] = parts[:, k] + parts[:, k + 1], 1j * (parts[:, k] - parts[:, k + 1])
    return out


def _real(rows: Complexes) -> Floats:
    return np.concatenate([rows.real, rows.imag]).astype(np.float64)


def _solved(rows: Floats, side: Floats) -> Floats:
    size = np.linalg.norm(rows, axis=0)
    size = np.where(size > 0.0, size, 1.0)
    return np.linalg.lstsq(rows / size, side, rcond=None)[0] / size


def _moved(s: Complexes, h: Complexes, w: Floats, poles: Complexes) -> Complexes:
    """Return the poles of the next step: zeros of the denominator in the basis of the poles before."""
    phi = _basis(s, poles)
    rows = np.hstack([phi, np.ones((s.size, 1)), -h[:, None] * phi]) * w[:, None]
    found = _solved(_real(rows), _real(h * w))[poles.size + 1 :]
    a, b = _blocks(poles)
    return _paired(np.asarray(np.linalg.eigvals(a - np.outer(b, found)), dtype=np.complex128))


def _residues(s: Complexes, h: Complexes, w: Floats, poles: Complexes) -> tuple[Floats, float]:
    """Return the coefficients of the partial fractions and the constant, shape (order + 1,), and the relative error."""
    rows = np.hstack([_basis(s, poles), np.ones((s.size, 1))])
    found = _solved(_real(rows * w[:, None]), _real(h * w))
    size = float(np.linalg.norm(h * w))
    return found, float(np.linalg.norm((rows @ found - h) * w)) / size if size > 0.0 else np.inf


def _blocks(poles: Complexes) -> tuple[Floats, Floats]:
    a, b = np.diag(poles.real.astype(np.float64)), np.ones(poles.size)
    for k in np.flatnonzero(poles.imag > 0.0):
        a[k, k + 1], a[k + 1, k] = poles[k].imag, -poles[k].imag
        b[k], b[k + 1] = 2.0, 0.0
    return a, b


def _state_space(poles: Complexes, coefficients: Floats, top: float) -> ForceModel:
    a, b = _blocks(poles)
    return ForceModel(a=a, b=b, c=top * coefficients[:-1], d=float(coefficients[-1]))
