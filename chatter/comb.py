"""Which lines of a spectrum repeat with the spindle, and which stand for themselves.

Forced vibration is periodic: all its lines are multiples of one fundamental. Chatter has a frequency of its own, its
harmonics, and sidebands at the distance of tooth passing; those are multiples of tooth passing plus or minus multiples
of the chatter. Which of the two explains the lines better is a question of counting: how many of the places that it
foresees hold a line, against how many would by chance.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from chatter.lines import Lines

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

PRECISION, WANDER = 0.35, 3e-4
"""How far a harmonic may lie off its place: bins, for interpolation, and a part of its frequency, for the speed."""
LEAST_SPREAD = 0.1
"""Misfit of lines over their slack (rms) below which they cannot fit any better."""
LEAST = 9.0
"""Evidence for a comb (log likelihood ratio): 1 in 8000 by chance."""
FOLDS = 1.5
"""Highest multiple over the sampling rate that is looked for below half of it; a filter is missing, not bandwidth."""
SPEED_RANGE, SPEED_SPREAD = 0.015, 0.004
"""Most that the lines may correct a stated speed by, and what stated speeds err by (rms)."""
CEILINGS_HZ = (300.0, 600.0, 1200.0, 2500.0, np.inf)
"""A comb is judged up to each of these: where its harmonics have died out, empty places say nothing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Base:
    """A fundamental that lines were found to be multiples of, or sidebands at a distance of.

    Parameters
    ----------
    fundamental_hz : float
        Fundamental (Hz).
    evidence : float
        Log likelihood ratio against chance.
    source : str
        ``stated`` speed, ``comb`` of forced lines, or ``sidebands`` of a free line.
    """

    fundamental_hz: float
    evidence: float
    source: Literal["stated", "comb", "sidebands"]


def tolerance(frequency_hz: Floats, spacing_hz: float) -> Floats:
    """Return how far harmonics may lie from their places (Hz), shape (n,).

    Parameters
    ----------
    frequency_hz : ndarray, shape (n,)
        Frequencies (Hz).
    spacing_hz : float
        Distance of the bins (Hz).
    """
    return np.asarray(PRECISION * spacing_hz + WANDER * frequency_hz, dtype=np.float64)


def evidence(fits: Flags, misfit: Floats, places: Floats, chance: float) -> Floats:
    """Return the log likelihood ratio of so many of so many places filled, and filled so exactly, shape (m,).

    One line is spent on the fundamental. Lines that hit a place by chance lie anywhere within their slack; those that
    belong there lie closer, as close as all of them together show.

    Parameters
    ----------
    fits : ndarray, shape (m, n)
        Which lines lie in a place.
    misfit : ndarray, shape (m, n)
        How far from its middle, over the slack.
    places : ndarray, shape (m,)
        Places that could hold a line.
    chance : float
        Probability that a place holds a line by chance.
    """
    count = fits.sum(axis=1)
    matched = np.minimum(count, places)
    p = min(max(chance, 1e-6), 0.9)
    q = np.clip(matched / np.maximum(places, 1.0), 1e-9, 1.0 - 1e-9)
    ratio = matched * np.log(q / p) + (places - matched) * np.log((1.0 - q) / (1.0 - p)) + np.log(p)
    spread = np.where(fits, misfit**2, 0.0).sum(axis=1) / np.maximum(count - 1, 1)
    spread = np.maximum(spread, LEAST_SPREAD**2)
    exact = (matched - 1.0) * (np.log(2.0) - 0.5 * np.log(2.0 * np.pi * np.e * spread)) - 1.0
    return np.where((q > p) & (matched >= 2.0), ratio + np.maximum(exact, 0.0), -1.0)


def refined(fundamental_hz: Floats, frequency_hz: Floats, slack_hz: Floats) -> Floats:
    """Return fundamentals fitted to the lines near their multiples, low orders first, shape (m,).

    Parameters
    ----------
    fundamental_hz : ndarray, shape (m,)
        Where to start (Hz).
    frequency_hz : ndarray, shape (n,)
        Lines (Hz).
    slack_hz : ndarray, shape (n,)
        How far they may lie from a multiple (Hz).
    """
    weight = 1.0 / slack_hz**2
    for most in (6.0, 20.0, 60.0, np.inf):
        order = np.round(frequency_hz / fundamental_hz[:, None])
        near = np.abs(frequency_hz - order * fundamental_hz[:, None]) <= slack_hz
        order = np.where(near & (order <= most), order, 0.0)
        square = order**2 @ weight
        fitted = (order @ (weight * frequency_hz)) / np.where(square > 0.0, square, 1.0)
        fundamental_hz = np.where(square > 0.0, fitted, fundamental_hz)
    return fundamental_hz


def on_comb(frequency_hz: Floats, fundamental_hz: float, slack_hz: Floats) -> Flags:
    """Return which lines are multiples of a fundamental, shape (n,).

    Parameters
    ----------
    frequency_hz : ndarray, shape (n,)
        Lines (Hz).
    fundamental_hz : float
        Fundamental (Hz).
    slack_hz : ndarray, shape (n,)
        How far they may lie from a multiple (Hz).
    """
    order = np.round(frequency_hz / fundamental_hz)
    return (np.abs(frequency_hz - order * fundamental_hz) <= slack_hz) & (order > 0)


def folded(frequency_hz: Floats, fundamental_hz: float, sample_rate_hz: float, spacing_hz: float) -> Flags:
    """Return which lines are multiples above half the sampling rate that a recorder without a filter folds down.

    Parameters
    ----------
    frequency_hz : ndarray, shape (n,)
        Lines (Hz).
    fundamental_hz : float
        Fundamental (Hz).
    sample_rate_hz : float
        Sampling rate (Hz).
    spacing_hz : float
        Distance of the bins (Hz).
    """
    multiples = fundamental_hz * np.arange(
        np.ceil(0.5 * sample_rate_hz / fundamental_hz), FOLDS / fundamental_hz * sample_rate_hz
    )
    seen = np.abs(multiples - sample_rate_hz * np.round(multiples / sample_rate_hz))
    near = np.abs(frequency_hz[:, None] - seen) <= tolerance(multiples, spacing_hz)
    return np.asarray(near.any(axis=1), dtype=np.bool_)


def stated(lines: Lines, spindle_hz: float, tools: int | None = None) -> Base:
    """Return the comb of a stated speed, corrected by the lines where they tell.

    Parameters
    ----------
    lines : Lines
        Lines.
    spindle_hz : float
        Stated speed (Hz).
    tools : int or None
        Cutting edges that pass per revolution.
    """
    slack = tolerance(lines.frequency_hz, lines.spacing_hz)
    tried = spindle_hz * (1.0 + SPEED_RANGE * np.linspace(-1.0, 1.0, 151))
    tried = refined(tried, lines.frequency_hz, slack)
    tried = tried[np.abs(tried / spindle_hz - 1.0) <= 1.2 * SPEED_RANGE]
    best, most = spindle_hz, -1.0
    if len(lines.frequency_hz) and tried.size:
        found = comb_evidence(tried, lines.frequency_hz, slack)
        if tools is not None and tools > 1:
            found = np.maximum(found, comb_evidence(tools * tried, lines.frequency_hz, slack))
        far = 0.5 * ((tried / spindle_hz - 1.0) / SPEED_SPREAD) ** 2
        k = int(np.argmax(found - far))
        best, most = float(tried[k]), float(found[k])
    return Base(fundamental_hz=best if most >= LEAST else spindle_hz, evidence=most, source="stated")


def comb_evidence(fundamental_hz: Floats, frequency_hz: Floats, slack_hz: Floats) -> Floats:
    """Return the evidence for combs among all lines, shape (m,).

    Parameters
    ----------
    fundamental_hz : ndarray, shape (m,)
        Fundamentals (Hz).
    frequency_hz : ndarray, shape (n,)
        Lines (Hz), n > 0.
    slack_hz : ndarray, shape (n,)
        How far they may lie from a multiple (Hz).
    """
    column = fundamental_hz[:, None]
    order = np.round(frequency_hz / column)
    misfit = np.abs(frequency_hz - order * column) / slack_hz
    fits = (misfit <= 1.0) & (order > 0)
    best = np.full(len(fundamental_hz), -1.0)
    for ceiling in CEILINGS_HZ:
        used = frequency_hz <= ceiling
        if used.sum() < 3:
            continue
        highest = float(frequency_hz[used].max())
        places = np.floor(highest / fundamental_hz + 0.1)
        chance = 2.0 * float(slack_hz[used].mean()) * int(used.sum()) / highest
        best = np.maximum(best, evidence(fits & used, misfit, places, chance))
    return best
