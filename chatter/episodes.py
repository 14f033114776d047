"""Estimates of a whole recording joined to episodes."""

from dataclasses import dataclass

import numpy as np

from chatter.estimate import ChatterEstimate

PAUSE = 3.0
"""Windows of pause that do not end an episode: as long as an alarm takes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Episode:
    """A stretch in which one line dominates.

    Parameters
    ----------
    start, end : float
        Time from sample 0 (s).
    frequency_hz : float
        Frequency of the strongest line (Hz).
    weight : float
        Energy of that line times time, to tell which of two episodes is the stronger.
    """

    start: float
    end: float
    frequency_hz: float
    weight: float


def episodes(estimates: list[ChatterEstimate], rate: float, window: float) -> list[Episode]:
    """Return the episodes in order of time.

    Parameters
    ----------
    estimates : list of ChatterEstimate
        One for every block, in order.
    rate : float
        Sampling rate (Hz).
    window : float
        Window of detection (s); an edge is where the middle of the window passed it.
    """
    if not estimates:
        return []
    patience = round(window * rate / estimates[0].samples)
    alarm = [e.state == "chatter" for e in estimates]
    raised = [e.raised and e.kind == "regenerative" for e in estimates]
    spans = [_widened(a, b, raised, patience) for a, b in _runs(alarm)]
    return [_episode(estimates, a, b, rate, window) for a, b in spans]


def joined(found: list[Episode], window: float) -> list[Episode]:
    """Return episodes with those joined that follow on each other; the frequency is that of the strongest.

    Parameters
    ----------
    found : list of Episode
        In order of time.
    window : float
        Window of detection (s).
    """
    out: list[Episode] = []
    for episode in found:
        if out and episode.start - out[-1].end <= PAUSE * window:
            last = out.pop()
            strongest = max(last, episode, key=lambda e: e.weight)
            out.append(
                Episode(
                    start=last.start,
                    end=max(last.end, episode.end),
                    frequency_hz=strongest.frequency_hz,
                    weight=last.weight + episode.weight,
                )
            )
        else:
            out.append(episode)
    return out


def _runs(flags: list[bool]) -> list[tuple[int, int]]:
    """Return first and last index of every run of true."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], np.asarray(flags, dtype=int), [0]])))
    return [(int(a), int(b) - 1) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _widened(start: int, stop: int, raised: list[bool], patience: int) -> tuple[int, int]:
    """Return a run of alarm from where the line rose to where it was last seen."""
    first = k = start
    while k > 0 and first - k <= patience:
        k -= 1
        first = k if raised[k] else first
    last = stop
    while last > start and not raised[last]:
        last -= 1
    return first, last


def _episode(estimates: list[ChatterEstimate], first: int, last: int, rate: float, window: float) -> Episode:
    chosen = [e for e in estimates[first : last + 1] if e.frequency_hz is not None]
    frequency = np.array([e.frequency_hz for e in chosen])
    weight = np.array([e.line for e in chosen]) ** 2
    order = np.argsort(frequency)
    frequency, weight = frequency[order], weight[order]
    total = np.concatenate([[0.0], np.cumsum(weight)])
    low = np.searchsorted(frequency, frequency - 0.5 / window)
    high = np.searchsorted(frequency, frequency + 0.5 / window, side="right")
    centre = int(np.argmax(total[high] - total[low]))
    near = slice(int(low[centre]), int(high[centre]))
    weight_near = float(total[high[centre]] - total[low[centre]])
    start, end = estimates[first], estimates[last]
    return Episode(
        start=max((start.first_sample + start.samples) / rate - 0.5 * window, 0.0) if first else 0.0,
        end=(end.first_sample + end.samples) / rate - (0.5 * window if last < len(estimates) - 1 else 0.0),
        frequency_hz=float(np.average(frequency[near], weights=weight[near])),
        weight=weight_near,
    )
