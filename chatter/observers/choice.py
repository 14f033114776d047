"""The member of the two-encoder family that will be least wrong.

F = H (E_t + lambda E_m) is linear in lambda, and so is each part of its error: encoder counts, unknown friction, wrong
parameters. Their mean square is a parabola in lambda, known from three points; its vertex is the best weight.
"""

import numpy as np

from chatter.observers.family import two_encoder
from chatter.observers.linear import LinearObserver
from chatter.observers.nominal import NominalFeedDrive
from chatter.observers.prediction import Scene, predicted_error


def optimal_weight(
    drive: NominalFeedDrive, sample_rate_hz: float, scene: Scene, *, cutoff_hz: float = 1000.0, order: int = 4
) -> float:
    """Return the lambda of least predicted error.

    Parameters
    ----------
    drive : NominalFeedDrive
        Nominal drive.
    sample_rate_hz : float
        Sampling rate (Hz).
    scene : Scene
        What the axis will have to do with.
    cutoff_hz : float
        Edge of the low-pass (Hz).
    order : int
        Its order.
    """

    def square(weight: float) -> float:
        observer = two_encoder(drive, sample_rate_hz, weight, cutoff_hz=cutoff_hz, order=order)
        return predicted_error(observer, scene).total ** 2

    step, origin, best = 1.0, 0.0, 0.0
    for _ in range(2):  # the second time close to the vertex, where nothing large cancels
        below, at, above = (square(origin + k * step) for k in (-1.0, 0.0, 1.0))
        curvature = below - 2.0 * at + above
        best = origin if curvature <= 0.0 else origin + 0.5 * step * (below - above) / curvature
        origin, step = best, max(abs(best), 1e-3)
    return float(best)


def optimal_observer(
    drive: NominalFeedDrive, sample_rate_hz: float, scene: Scene, *, cutoff_hz: float = 1000.0, order: int = 4,
    compensation: str = "full",
) -> LinearObserver:  # fmt: skip
    """Return the member of the family of least predicted error; its name is `optimal`.

    Parameters
    ----------
    drive : NominalFeedDrive
        Nominal drive.
    sample_rate_hz : float
        Sampling rate (Hz).
    scene : Scene
        What the axis will have to do with.
    cutoff_hz : float
        Edge of the low-pass (Hz).
    order : int
        Its order.
    compensation : {"full", "thrust", "none", "raw"}
        See `LinearObserver`.
    """
    weight = optimal_weight(drive, sample_rate_hz, scene, cutoff_hz=cutoff_hz, order=order)
    return two_encoder(
        drive, sample_rate_hz, np.array([weight]), name="optimal", cutoff_hz=cutoff_hz, order=order,
        compensation=compensation,
    )  # fmt: skip
