"""Modes from frequency responses: stable poles, each refined on the lines around it and asked whether it is needed."""

from dataclasses import dataclass, replace
from math import inf

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from chatter.identification.frf import Frf
from chatter.identification.poles import Candidate, Diagram, diagram_of

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

MOST = 25
LEAST_COHERENCE = 0.6
LEAST_GAIN = 1.5
"""By how much the residual must grow when a mode is left out."""
LEAST_DAMPING = 2e-5
MOST_SPREAD = 0.4
"""Standard deviation over damping of a mode that is still told."""
BACKGROUND = 3
"""Terms of the polynomial that stands for all other modes."""
_MOST_TOGETHER = 5
_WIDTHS, _LINES = 6.0, 6
_MOST_NEIGHBOURS = 10
_STEPS = (1.5, 1.2)
"""How far a pole may move: in half widths, and the logarithm of its damping."""
_LEAST_LINES = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class Mode:
    """A mode of vibration.

    Parameters
    ----------
    frequency_hz, damping_ratio : float
        Undamped natural frequency (Hz) and damping ratio.
    frequency_std_hz, damping_std : float
        Their standard deviations.
    peak : float
        Largest response that it makes at its frequency, in the unit of the responses.
    channel : int
        Where that is.
    residue : ndarray of complex, shape (channels,)
        Of the term residue/(j omega - pole).
    coherence : float or None
        At its frequency, of the best channel.
    share : float
        Part of the model orders in which its pole stands.
    resolved : bool
        Whether its width at half power is at least one line: if not, its damping rests on the length of the record.
    """

    frequency_hz: float
    damping_ratio: float
    frequency_std_hz: float
    damping_std: float
    peak: float
    channel: int
    residue: Complexes
    coherence: float | None
    share: float
    resolved: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class ModalFit:
    """What frequency responses tell.

    Parameters
    ----------
    modes : tuple of Mode
        By frequency.
    diagram : Diagram
        All poles.
    band_hz : (float, float)
        Where modes were looked for (Hz).
    notes : tuple of str
        What was left out, and why.
    """

    modes: tuple[Mode, ...]
    diagram: Diagram
    band_hz: tuple[float, float]
    notes: tuple[str, ...]


def modes_of(frf: Frf, band_hz: tuple[float, float] | None = None, most: int = MOST) -> ModalFit:
    """Return the modes that frequency responses show.

    Parameters
    ----------
    frf : Frf
        Of all channels to one input.
    band_hz : (float, float) or None
        Where to look (Hz); None for where the input excites.
    most : int
        Of more modes only the strongest are kept.
    """
    hz, line = frf.frequency_hz, float(frf.frequency_hz[1] - frf.frequency_hz[0])
    low, high = band_hz or frf.band_hz
    low, high = max(low, float(hz[0]), 4.0 * line), min(high, float(hz[-1]) - 2.0 * line)
    inside = (hz >= low) & (hz <= high)
    if np.count_nonzero(inside) < 4 * _LEAST_LINES:
        raise ValueError(f"band_hz must hold at least {4 * _LEAST_LINES} lines of {line:.3g} Hz, got {low:g}..{high:g}")
    alive = np.abs(frf.response[:, inside]).max(axis=1) > 0.0
    if not alive.any():
        raise ValueError("response must not be zero in the band, got zeros in all channels")
    diagram = diagram_of(hz, frf.response[alive], (low, high))
    found = [
        mode
        for group in _groups(diagram.candidates, line)
        for mode in _refined(frf, group, [c for c in diagram.candidates if c not in group], line, alive)
    ]
    modes = _apart(sorted(found, key=lambda mode: mode.frequency_hz), line)
    notes: list[str] = []
    if len(modes) > most:
        notes.append(f"{len(modes)} modes were found; the {most} strongest are told")
        modes = sorted(sorted(modes, key=lambda m: -_weight(m))[:most], key=lambda m: m.frequency_hz)
    if frf.coherence is None:
        notes.append("there is no coherence (one tap, or none in the file): noise and modes are told apart less well")
    coarse = [f"{mode.frequency_hz:.2f}" for mode in modes if not mode.resolved]
    if coarse:
        notes.append(f"narrower than a line of {line:.3g} Hz: {', '.join(coarse)} Hz; their damping is uncertain")
    return ModalFit(modes=tuple(modes), diagram=diagram, band_hz=(low, high), notes=tuple(notes))


def _weight(mode: Mode) -> float:
    return mode.share * (mode.coherence or 1.0) * mode.damping_ratio / max(mode.damping_std, 1e-3 * mode.damping_ratio)


def _groups(candidates: tuple[Candidate, ...], line: float) -> list[list[Candidate]]:
    """Return candidates so near that they must be fitted together."""
    groups: list[list[Candidate]] = []
    for one in candidates:
        last = groups[-1][-1] if groups else None
        near = last is not None and _gap(last, one) < 1.5 * (_reach(one, line) + _reach(last, line))
        if near and len(groups[-1]) < _MOST_TOGETHER:
            groups[-1].append(one)
        else:
            groups.append([one])
    return groups


def _gap(one: Candidate, other: Candidate) -> float:
    return other.frequency_hz - one.frequency_hz


def _reach(one: Candidate, line: float) -> float:
    return max(2.0 * one.damping_ratio * one.frequency_hz, line)


class _Local:
    """Lines around a group of poles, and the fit of residues and background to them.

    Neighbours stay where they are; their tails are fitted too.
    """

    def __init__(
        self, frf: Frf, group: list[Candidate], others: list[Candidate], line: float, alive: NDArray[np.bool_]
    ) -> None:
        low = min(c.frequency_hz - max(_WIDTHS * _reach(c, line), _LINES * line) for c in group)
        high = max(c.frequency_hz + max(_WIDTHS * _reach(c, line), _LINES * line) for c in group)
        hz = frf.frequency_hz
        self.lines = np.flatnonzero((hz >= max(low, hz[0] + 2.0 * line)) & (hz <= high))
        self.hz, self.line = hz[self.lines], line
        self.h = frf.response[alive][:, self.lines].T
        self.scale = np.maximum(np.sqrt(np.mean(np.abs(self.h) ** 2, axis=0)), 1e-300)
        self.start = np.array([[c.frequency_hz, c.damping_ratio] for c in group])
        centre, half = 0.5 * (self.hz[0] + self.hz[-1]), max(0.5 * (self.hz[-1] - self.hz[0]), line)
        near = sorted(others, key=lambda c: abs(c.frequency_hz - centre))[:_MOST_NEIGHBOURS]
        near = [c for c in near if abs(c.frequency_hz - centre) < 3.0 * half]
        tails = [_term(self.hz, c.frequency_hz, c.damping_ratio) for c in near]
        plain = ((self.hz - centre) / half)[:, None] ** np.arange(BACKGROUND)
        self.background = np.column_stack([plain, *tails])
        self.weight = np.ones(self.h.shape[1])

    def solve(self, poles: Floats) -> tuple[Complexes, Complexes]:
        """Return residues, shape (poles, channels), and weighted residuals, shape (lines, channels)."""
        basis = np.column_stack([*(_term(self.hz, f, zeta) for f, zeta in poles), self.background])
        target = self.h / self.scale * self.weight
        found = np.linalg.lstsq(basis, target, rcond=None)[0]
        return found[: len(poles)] * self.scale / self.weight, target - basis @ found

    def cost(self, poles: Floats) -> float:
        return float(np.sum(np.abs(self.solve(poles)[1]) ** 2))

    def residual(self, x: Floats) -> Floats:
        flat = self.solve(self.unpack(x))[1].ravel()
        return np.concatenate([flat.real, flat.imag])

    def unpack(self, x: Floats) -> Floats:
        steps = x.reshape(-1, 2)
        width = np.maximum(self.start[:, 1] * self.start[:, 0], 0.1 * self.line)
        return np.column_stack([self.start[:, 0] + steps[:, 0] * width, self.start[:, 1] * np.exp(steps[:, 1])])


def _term(hz: Floats, frequency_hz: float, zeta: float) -> Complexes:
    """Return the partial fraction of a mode, of size 1 at its frequency, shape (lines,)."""
    omega = 2.0 * np.pi * frequency_hz
    pole = omega * (-zeta + 1j * np.sqrt(max(1.0 - zeta**2, 0.0)))
    return omega * max(zeta, 1e-6) / (2j * np.pi * hz - pole)


def _refined(
    frf: Frf, group: list[Candidate], others: list[Candidate], line: float, alive: NDArray[np.bool_]
) -> list[Mode]:
    """Return those modes of a group that the lines around them need."""
    while group:
        local = _Local(frf, group, others, line, alive)
        unknowns = 2 * len(group) + 2 * (len(group) + local.background.shape[1]) * local.h.shape[1]
        if 2 * local.h.size <= unknowns + 2:
            return []
        x, jacobian = _settled(local)
        poles = local.unpack(x)
        cost = local.cost(poles)
        gains = [local.cost(np.delete(poles, k, axis=0)) / max(cost, 1e-300) for k in range(len(group))]
        stds = _standard_deviations(local, x, jacobian, unknowns)
        moved = (np.abs(x.reshape(-1, 2)) > 0.98 * np.array(_STEPS)).any(axis=1)
        wide = (poles[:, 1] > 0.2) | (poles[:, 1] < LEAST_DAMPING) | (stds[:, 1] > MOST_SPREAD) | moved
        worst = int(np.argmin(np.where(wide, 0.0, gains)))
        if not wide[worst] and gains[worst] >= LEAST_GAIN:
            return _modes(frf, local, group, poles, stds, alive)
        group = [one for k, one in enumerate(group) if k != worst]
    return []


def _settled(local: _Local) -> tuple[Floats, Floats]:
    """Return the steps to the poles of best fit and the Jacobian there; channels weigh by what is left of them."""
    x, most = np.zeros(local.start.size), np.tile(_STEPS, len(local.start))
    for _ in range(2):
        made = least_squares(local.residual, x, bounds=(-most, most), max_nfev=40)
        x = made.x
        left = np.sqrt(np.mean(np.abs(local.solve(local.unpack(x))[1] / local.weight) ** 2, axis=0))
        local.weight = 1.0 / np.maximum(left, max(1e-3 * float(left.max()), 1e-12))
        local.weight /= float(local.weight.max())
    final = least_squares(local.residual, x, bounds=(-most, most), max_nfev=40)
    return np.asarray(final.x, dtype=np.float64), np.asarray(final.jac, dtype=np.float64)


def _standard_deviations(local: _Local, x: Floats, jacobian: Floats, unknowns: int) -> Floats:
    """Return the standard deviations of the steps, shape (poles, 2); residuals that hang together weigh less."""
    count = x.size // 2
    left = local.residual(x)
    degrees = max(left.size - unknowns, 1)
    try:
        spread = np.linalg.inv(jacobian.T @ jacobian).diagonal()
    except np.linalg.LinAlgError:
        return np.full((count, 2), inf)
    rows = left.reshape(2, len(local.hz), -1)
    power = float(np.sum(rows**2))
    alike = float(np.sum(rows[:, 1:] * rows[:, :-1])) / power if power > 0.0 else 0.0
    inflation = (1.0 + max(alike, 0.0)) / (1.0 - min(max(alike, 0.0), 0.95))
    return np.sqrt(np.maximum(spread, 0.0) * power / degrees * inflation).reshape(count, 2)


def _modes(
    frf: Frf, local: _Local, group: list[Candidate], poles: Floats, stds: Floats, alive: NDArray[np.bool_]
) -> list[Mode]:
    residues = local.solve(poles)[0]
    found: list[Mode] = []
    for k, one in enumerate(group):
        f, zeta = float(poles[k, 0]), float(poles[k, 1])
        peaks = np.abs(residues[k])
        near = np.abs(frf.frequency_hz - f) <= max(zeta * f, local.line)
        coherence = None if frf.coherence is None else float(frf.coherence[:, near].mean(axis=1).max())
        if coherence is not None and coherence < LEAST_COHERENCE:
            continue
        whole = np.zeros(alive.size, dtype=np.complex128)
        whole[alive] = residues[k] * 2.0 * np.pi * f * zeta
        width = max(local.start[k, 0] * local.start[k, 1], 0.1 * local.line)
        found.append(
            Mode(
                frequency_hz=f, damping_ratio=zeta, frequency_std_hz=float(stds[k, 0] * width),
                damping_std=float(stds[k, 1] * zeta), peak=float(peaks.max()),
                channel=int(np.flatnonzero(alive)[int(np.argmax(peaks))]), residue=whole, coherence=coherence,
                share=one.share, resolved=2.0 * zeta * f >= local.line,
            )  # fmt: skip
        )
    return found


def _apart(modes: list[Mode], line: float) -> list[Mode]:
    """Return modes of which no two are one."""
    kept: list[Mode] = []
    for mode in modes:
        if kept and mode.frequency_hz - kept[-1].frequency_hz < 0.3 * max(line, mode.damping_ratio * mode.frequency_hz):
            kept[-1] = max(kept[-1], mode, key=_weight)
        else:
            kept.append(mode)
    return [replace(mode) for mode in kept]
