"""Cutting force from the balance of the stages alone: no current, no rotor inertia, no motor friction."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chatter.filters import response
from chatter.observers.balance import stage_balance
from chatter.observers.linear import LinearObserver, ObserverState
from chatter.observers.nominal import NominalFeedDrive, NominalTurret

__all__ = ["LoadSideObserver", "LoadSideState", "NominalFeedDrive", "NominalTurret"]

LoadSideState = ObserverState


class LoadSideObserver(LinearObserver):
    """Force on the tool of a two-slide turret from motor and stage positions.

    Member lambda = 0 of the two-encoder family H (E_t + lambda E_m), E_t the force balance of the stage and E_m that of
    the motor (thesis chapter 2). Each balance holds the acceleration of the other slide through the cross mass.

    Parameters
    ----------
    turret : NominalTurret
        Nominal drives, upper mass and angle of the slides.
    sample_rate_hz : float
        Sampling rate (Hz).
    cutoff_hz : float
        Edge of the low-pass that all terms share (Hz).
    order : int
        Order of that Butterworth filter.
    """

    def __init__(self, turret: NominalTurret, sample_rate_hz: float, cutoff_hz: float = 1000.0, order: int = 4) -> None:
        gains = stage_balance(turret, sample_rate_hz)
        super().__init__("load_side", turret, sample_rate_hz, gains, cutoff_hz=cutoff_hz, order=order)
        self.turret = turret

    def response(self, frequency_hz: ArrayLike) -> NDArray[np.complex128]:
        """Return estimate over true force as it is with exact parameters: delay, kernel weight (1, 10, 1)/12, low-pass.

        Parameters
        ----------
        frequency_hz : array_like
            Frequencies (Hz).
        """
        angle = 2.0 * np.pi * np.asarray(frequency_hz, dtype=np.float64) / self.sample_rate_hz
        kernel = (5.0 + np.cos(angle)) / 6.0 * np.exp(-1j * angle * (self._alignment.age + 1.0))
        return kernel * response(self.sections, frequency_hz, self.sample_rate_hz)
