"""Estimators that weigh the balances of motor and stage: F = H (E_t + lambda E_m), and the two that know one signal.

================  ===========  ========================================================================================
name              lambda       property
================  ===========  ========================================================================================
medob             1            independent of the stiffness of the screw; all the noise of the motor encoder
vibration         -alpha       motor friction and motor encoder noise scaled by alpha = M_t/M_r
load_side         0            no current, no rotor inertia, no motor friction; needs the stiffness at low frequency
standing          0            load_side; above an edge the motor moves as its thrust bids, without its counts
blended           low-pass     1 below an edge, 0 above: for a moving axis with a valid idling table
dob               (motor)      the drive taken as rigid; wrong from a fraction of its resonance on
thrust            (command)    what the position loop pushes back with; wrong from a fraction of its bandwidth on
================  ===========  ========================================================================================

Yamada, PhD thesis, Keio University, 2017, chapter 2.
"""

import numpy as np
from numpy.typing import ArrayLike

from chatter.observers.balance import motor_balance, rigid_balance, stage_balance, thrust_itself
from chatter.observers.linear import Drives, LinearObserver, single_or_turret
from chatter.observers.motor_motion import MotorMotion
from chatter.observers.nominal import NominalFeedDrive

BLEND_HZ = 20.0
"""Edge of the blended member when none is given (Hz): below the first tooth-pass line of ordinary milling."""
WEIGHTS = {"medob": 1.0, "load_side": 0.0}


def two_encoder(
    drives: NominalFeedDrive | Drives, sample_rate_hz: float, weight: ArrayLike, *, name: str = "two_encoder",
    cutoff_hz: float = 1000.0, order: int = 4, compensation: str = "full",
) -> LinearObserver:  # fmt: skip
    """Return the member of the family with given weights of the motor balance.

    Parameters
    ----------
    drives : NominalFeedDrive, SingleAxis or NominalTurret
        Nominal drives.
    sample_rate_hz : float
        Sampling rate (Hz).
    weight : array_like
        lambda, one for all axes or shape (axes,).
    name : str
        Of the estimator.
    cutoff_hz : float
        Edge of the low-pass (Hz).
    order : int
        Its order.
    compensation : {"full", "thrust", "none", "raw"}
        See `LinearObserver`.
    """
    system = single_or_turret(drives)
    weights = np.broadcast_to(np.asarray(weight, dtype=np.float64), (len(system.drives),))
    if not np.isfinite(weights).all():
        raise ValueError(f"weight must be finite, got {weight}")
    gains = stage_balance(system, sample_rate_hz)
    gains += motor_balance(system, sample_rate_hz) * weights[None, :, None]
    return LinearObserver(
        name, system, sample_rate_hz, gains, cutoff_hz=cutoff_hz, order=order, compensation=compensation,
        weight=float(weights[0]) if weights.size == 1 else None,
    )  # fmt: skip


def linear_observer(
    name: str, drives: NominalFeedDrive | Drives, sample_rate_hz: float, *, cutoff_hz: float = 1000.0,
    order: int = 4, compensation: str = "full", blend_hz: float = BLEND_HZ,
) -> LinearObserver:  # fmt: skip
    """Return an estimator of the table above by its name.

    Parameters
    ----------
    name : str
        One of medob, vibration, load_side, standing, blended, dob, thrust.
    drives : NominalFeedDrive, SingleAxis or NominalTurret
        Nominal drives.
    sample_rate_hz : float
        Sampling rate (Hz).
    cutoff_hz : float
        Edge of the low-pass (Hz).
    order : int
        Its order.
    compensation : {"full", "thrust", "none", "raw"}
        See `LinearObserver`; thrust alone is always taken as it was commanded.
    blend_hz : float
        Edge of the blended member (Hz).
    """
    system = single_or_turret(drives)
    if name in ("medob", "load_side", "vibration"):
        weight = WEIGHTS.get(name, [-drive.mass_ratio for drive in system.drives])
        return two_encoder(
            system, sample_rate_hz, weight, name=name, cutoff_hz=cutoff_hz, order=order, compensation=compensation
        )
    if name == "standing":
        gains = stage_balance(system, sample_rate_hz)
        motion = MotorMotion(system.drives, sample_rate_hz, delayed=compensation == "full")
        return LinearObserver(
            name, system, sample_rate_hz, gains, cutoff_hz=cutoff_hz, order=order, compensation=compensation,
            motion=motion,
        )  # fmt: skip
    if name == "blended":
        rows = [stage_balance(system, sample_rate_hz), motor_balance(system, sample_rate_hz)]
        return LinearObserver(
            name, system, sample_rate_hz, np.concatenate(rows, axis=1), cutoff_hz=cutoff_hz, order=order,
            compensation=compensation, blend_hz=blend_hz,
        )  # fmt: skip
    if name == "dob":
        gains = rigid_balance(system, sample_rate_hz)
    elif name == "thrust":
        gains, compensation = thrust_itself(system), "raw"
    else:
        raise ValueError(
            f"name must be one of medob, vibration, load_side, standing, blended, dob, thrust, got {name!r}"
        )
    return LinearObserver(
        name, system, sample_rate_hz, gains, cutoff_hz=cutoff_hz, order=order, compensation=compensation
    )
