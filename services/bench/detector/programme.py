"""What happens in a stable cut: passes, and in them changes of speed or feed, knocks, or slots in the bar."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np

from services.messages import BLOCK_S, Floats

Kind = Literal["passes", "speed", "feed", "knocks", "slots"]
KINDS: tuple[Kind, ...] = ("passes", "speed", "feed", "knocks", "slots")
"""Short passes with the tools entering and leaving; speed ramped and overridden; feed overridden; blows on the tools;
a bar with two opposite slots, which interrupt the cut of both tools twice a turn."""

SPEEDS, FEEDS = (0.7, 1.2), (0.5, 1.2)
"""Overrides of speed and feed, over the nominal ones."""
PASS_S, SHORT_PASS_S, AIR_S, FIRST_AIR_S = (5.0, 20.0), (1.0, 6.0), (0.3, 2.0), 2.0
HOLD_S, RAMP_S, FEED_RAMP_S, FEED_STEP_S = (0.5, 4.0), (0.1, 2.0), 0.2, 1e-3
KNOCKS_PER_S, KNOCK_S, KNOCK = 0.5, (0.5e-3, 2e-3), (0.3, 5.0)
"""Rate of knocks, length of their half sine, and the vibration that each starts, over the threshold."""
SLOT = (2e-3, 6e-3)
"""Width of a slot (m)."""
PIECE_S = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Piece:
    """A stretch of at most half a second in which one thing happens.

    Attributes
    ----------
    samples
        How long it lasts.
    engaged
        Whether the machine says that the tools cut; it knows nothing of slots.
    speed
        Spindle speed over the nominal one at each sample, shape (samples,).
    feed
        Feed over the nominal one.
    enter
        Whether the tools begin a pass with this piece.
    slot
        Samples at its start for which the tools are over a slot.
    knocks
        For each knock its first sample, length in samples, tool (0 or 1) and vibration over the threshold.
    """

    samples: int
    engaged: bool
    speed: Floats
    feed: float = 1.0
    enter: bool = False
    slot: int = 0
    knocks: tuple[tuple[int, int, int, float], ...] = ()


def conditions(kind: Kind) -> list[tuple[float, float]]:
    """Return the speeds and feeds (over the nominal ones) at which a process must be stable for this kind."""
    if kind == "speed":
        return [(float(speed), 1.0) for speed in np.linspace(*SPEEDS, 51)]
    if kind == "feed":
        return [(1.0, float(feed)) for feed in np.linspace(*FEEDS, 8)]
    return [(1.0, 1.0)]


def programme(
    kind: Kind, rng: np.random.Generator, cut_s: float, *, rate: float, spindle_hz: float, longest_s: float,
    circumference: float,
) -> Iterator[Piece]:  # fmt: skip
    """Yield the pieces of a run, whole blocks between any two changes of `engaged`.

    Parameters
    ----------
    kind
        What happens.
    rng
        Of everything that is left to chance.
    cut_s
        Time in the cut (s).
    rate
        Servo rate (Hz).
    spindle_hz
        Nominal speed (Hz).
    longest_s
        Longest pass that the bar allows (s).
    circumference
        Of the bar (m).
    """
    left, speed = _blocks(cut_s), 1.0
    yield from _air(FIRST_AIR_S, rate, speed)
    while left > 0:
        wanted = rng.uniform(*(SHORT_PASS_S if kind == "passes" else PASS_S))
        blocks = min(left, _blocks(min(wanted, longest_s)))
        left -= blocks
        samples = round(blocks * BLOCK_S * rate)
        course = np.full(samples, speed)
        if kind == "speed":
            course = _course(rng, samples, rate, speed)
            speed = float(course[-1])
        if kind == "slots":
            width = rng.uniform(*SLOT) / circumference / spindle_hz
            yield from _slotted(samples, 0.5 * rate / spindle_hz, round(width * rate), course)
        elif kind == "feed":
            yield from _fed(rng, samples, rate, course)
        else:
            knocks = _knocks(rng, samples, rate) if kind == "knocks" else []
            yield from _cut(samples, rate, course, knocks)
        yield from _air(rng.uniform(*AIR_S), rate, speed)


def _blocks(seconds: float) -> int:
    return max(round(seconds / BLOCK_S), 1)


def _air(seconds: float, rate: float, speed: float) -> Iterator[Piece]:
    samples = round(_blocks(seconds) * BLOCK_S * rate)
    for start, stop in _cuts(samples, rate):
        yield Piece(samples=stop - start, engaged=False, speed=np.full(stop - start, speed))


def _cuts(samples: int, rate: float, step_s: float = PIECE_S) -> Iterator[tuple[int, int]]:
    step = round(step_s * rate)
    for start in range(0, samples, step):
        yield start, min(start + step, samples)


def _cut(samples: int, rate: float, course: Floats, knocks: list[tuple[int, int, int, float]]) -> Iterator[Piece]:
    for start, stop in _cuts(samples, rate):
        inside = tuple((at - start, *rest) for at, *rest in knocks if start <= at < stop)
        yield Piece(samples=stop - start, engaged=True, speed=course[start:stop], enter=start == 0, knocks=inside)  # pyright: ignore[reportArgumentType]


def _course(rng: np.random.Generator, samples: int, rate: float, speed: float) -> Floats:
    """Return a speed that is held, ramped to another override, held again, and so on."""
    times, values = [0.0], [speed]
    while times[-1] * rate < samples:
        target = rng.uniform(*SPEEDS)
        times += [times[-1] + rng.uniform(*HOLD_S)]
        times += [times[-1] + rng.uniform(*RAMP_S)]
        values += [values[-1], target]
    return np.interp(np.arange(samples) / rate, times, values)


def _fed(rng: np.random.Generator, samples: int, rate: float, course: Floats) -> Iterator[Piece]:
    """Yield a pass in which the feed is held, then taken to another override within 0.2 s, and so on."""
    feed, at, first = 1.0, 0, True
    while at < samples:
        held = min(at + round(_blocks(rng.uniform(*HOLD_S)) * BLOCK_S * rate), samples)
        for start, stop in _cuts(held - at, rate):
            yield Piece(samples=stop - start, engaged=True, speed=course[start:stop], feed=feed, enter=first)
            first = False
        at, target = held, rng.uniform(*FEEDS)
        ramp = min(round(FEED_RAMP_S * rate), samples - at)
        for start, stop in _cuts(ramp, rate, FEED_STEP_S):
            part = feed + (target - feed) * stop / ramp
            yield Piece(samples=stop - start, engaged=True, speed=course[at + start : at + stop], feed=part)
        at, feed = at + ramp, target


def _knocks(rng: np.random.Generator, samples: int, rate: float) -> list[tuple[int, int, int, float]]:
    count = int(rng.poisson(KNOCKS_PER_S * samples / rate))
    at = np.sort(rng.integers(samples, size=count))
    low, high = math.log(KNOCK[0]), math.log(KNOCK[1])
    return [
        (int(k), max(round(rng.uniform(*KNOCK_S) * rate), 2), int(rng.integers(2)), math.exp(rng.uniform(low, high)))
        for k in at
    ]


def _slotted(samples: int, half_turn: float, slot: int, course: Floats) -> Iterator[Piece]:
    """Yield a pass over a bar with two opposite slots: at equal pitch both tools are over one at the same time.

    Half a turn is no whole number of samples, but the slots turn with the bar all the same.
    """
    edges = [round(k * half_turn) for k in range(math.ceil(samples / half_turn))]
    for start, stop in pairwise([*edges, samples]):
        if stop > start:
            yield Piece(
                samples=stop - start, engaged=True, speed=course[start:stop], enter=start == 0,
                slot=min(slot, stop - start) if start else 0,
            )  # fmt: skip
