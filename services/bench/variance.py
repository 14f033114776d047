"""The moving variance beside its peers: how fast, and how true where the mean is a million times the deviation."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import scipy.ndimage

from chatter import MovingVariance
from services.bench.peers import Way, beside, installed, repeated
from services.bench.rounds import Row, Say, row, silent
from services.messages import Floats

WINDOWS = (90, 900, 9000)
CHANNELS = 6
MEAN = 1e6
SAMPLE, ERROR = (1e9, "ns/sample (less is faster)"), "largest relative error (less is truer)"
Moving = Callable[[Floats, int], Any]


def measure(*, rounds: int = 9, samples: int = 100_000, say: Say = silent) -> list[Row]:
    """Return the rows of the table.

    Parameters
    ----------
    rounds
        How often each way is timed.
    samples
        Length of the stream.
    say
        Told what is being measured.
    """
    stream = MEAN + np.random.default_rng(1).standard_normal(samples)
    rows: list[Row] = []
    for window in WINDOWS:
        say(f"window of {window}")
        rows += speed_rows(stream, window, rounds)
    say("error")
    for window in WINDOWS:
        rows += error_rows(stream, window)
    return rows


def peers() -> dict[str, Moving | None]:
    """Return the population variance of moving windows by each peer; None for what is not installed."""
    bottleneck, talib, numbagg, pandas = (installed(name) for name in ("bottleneck", "talib", "numbagg", "pandas"))
    return {
        "bottleneck": bottleneck and (lambda y, window: bottleneck.move_var(y, window)),
        "TA-Lib": talib and (lambda y, window: talib.VAR(y, window)),
        "numbagg": numbagg and (lambda y, window: numbagg.move_var(y, window=window)),
        "pandas": pandas and (lambda y, window: pandas.Series(y).rolling(window).var(ddof=0).to_numpy()),
        "numpy cumsum": _cumsum,
        "scipy uniform_filter1d": _uniform_filter,
    }


def speed_rows(stream: Floats, window: int, rounds: int) -> list[Row]:
    """Return what a sample costs, ours and each peer's."""
    ways = {
        name: None if moving is None else repeated(partial(moving, stream, window), stream.size)
        for name, moving in peers().items()
    }
    ours = repeated(partial(MovingVariance(window).update, stream), stream.size)
    rows = beside(f"window {window}", ours, ways, rounds, *SAMPLE)
    return [*rows, *channel_rows(stream, window, rounds)]


def channel_rows(stream: Floats, window: int, rounds: int) -> list[Row]:
    """Return what a number of several channels side by side costs."""
    block = stream[: stream.size // CHANNELS * CHANNELS].reshape(-1, CHANNELS)
    ours = repeated(partial(MovingVariance(window, CHANNELS).update, block), block.size)
    module = installed("bottleneck")
    way: Way | None = module and repeated(partial(module.move_var, block, window, axis=0), block.size)
    case = f"window {window}, {CHANNELS} channels"
    return beside(case, ours, {"bottleneck": way}, rounds, *SAMPLE)


def error_rows(stream: Floats, window: int) -> list[Row]:
    """Return the largest relative error of some hundred windows, ours and each peer's."""
    ends = np.arange(window, stream.size, max(window // 7, 97))[-300:]
    exact = np.array([_two_passes(stream[end - window : end]) for end in ends])

    def error(variance: Floats) -> float:
        return float(np.max(np.abs(variance[ends - 1] / exact - 1.0)))

    ours, rows = error(MovingVariance(window).update(stream)[:, 0]), list[Row]()
    for name, moving in peers().items():
        case = f"window {window}, mean {MEAN:g}, deviation 1, beside {name}"
        if moving is None:
            rows.append(row(f"{case} (not installed)", ours, None, ERROR))
            continue
        share = (window - 1.0) / window if name == "numbagg" else 1.0  # it knows only the variance of a sample
        rows.append(row(case, ours, error(share * np.asarray(moving(stream, window))), ERROR))
    return rows


def _two_passes(window: Floats) -> float:
    long = window.astype(np.longdouble)
    return float(np.mean((long - long.mean()) ** 2))


def _cumsum(y: Floats, window: int) -> Floats:
    sums, squares = (np.concatenate([[0.0], np.cumsum(x)]) for x in (y, y * y))
    mean = (sums[window:] - sums[:-window]) / window
    return np.concatenate([np.full(window - 1, np.nan), (squares[window:] - squares[:-window]) / window - mean**2])


def _uniform_filter(y: Floats, window: int) -> Floats:
    mean, square = (scipy.ndimage.uniform_filter1d(x, window, origin=(window - 1) // 2) for x in (y, y * y))
    return square - mean**2
