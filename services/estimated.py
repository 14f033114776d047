"""The cutting force in a recording of a servo axis: estimate, what idles taken off, and how wrong it may be."""

from __future__ import annotations

import csv
import dataclasses
import math
import pathlib
from dataclasses import dataclass
from typing import Any

import numpy as np

from services.compare import CUTOFF_OVER_RATE, FRICTION_LEFT, LEAST_THRUST_NOISE_N, UNKNOWN, WITHOUT_SCALE
from services.drives import NamedDrive
from services.errors import InputError, RefusalError
from services.importers.servo import Axis
from services.messages import Floats

LEAST_BAND_HZ = 1.0
SLIDES = 1e-3
"""Speed (m/s) over which Coulomb friction turns about, where the drive tells none."""
SETTLED = 3.0
"""Periods of the low-pass after which its start counts no more."""
_ROWS = 1 << 16


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimated:
    """Force over time.

    Attributes
    ----------
    estimator, drive
        Names.
    time_s
        When the force acted: time of the samples less the latency, shape (n,).
    force_n
        Against the motion along + when positive; NaN where it is not known, shape (n,).
    position_m, speed_m_s
        At that time, shape (n,).
    latency_ms
        By which the estimate lags behind the samples.
    predicted_error_n
        Standard deviation that is expected of its error, None where nothing predicts it.
    cutoff_hz
        Edge of its low-pass.
    idle_share
        Part of the samples from which the idling axis was taken off, None without a recording of it.
    notes
        What a reader should know.
    """

    estimator: str
    drive: str
    time_s: Floats
    force_n: Floats
    position_m: Floats
    speed_m_s: Floats
    latency_ms: float
    predicted_error_n: float | None
    cutoff_hz: float
    idle_share: float | None
    notes: tuple[str, ...]

    def keys(self) -> dict[str, Any]:
        """Return the keys of the command line."""
        known = self.force_n[np.isfinite(self.force_n)]
        return {
            "estimator": self.estimator, "drive": self.drive, "mean_n": float(known.mean()),
            "std_n": float(known.std()), "samples": int(known.size), "peak_n": float(np.abs(known).max()),
            "predicted_error_n": self.predicted_error_n, "latency_ms": self.latency_ms, "cutoff_hz": self.cutoff_hz,
            "idle_share": self.idle_share, "notes": list(self.notes),
        }  # fmt: skip

    def write(self, path: pathlib.Path) -> pathlib.Path:
        """Write the series as CSV."""
        with path.open("w", newline="", encoding="utf-8") as file:
            csv.writer(file).writerow(["time_s", "force_n", "position_mm", "speed_mm_s"])
            table = np.column_stack([self.time_s, self.force_n, 1e3 * self.position_m, 1e3 * self.speed_m_s])
            for first in range(0, len(table), _ROWS):
                np.savetxt(file, table[first : first + _ROWS], delimiter=",", fmt="%.9g")
        return path


def estimated(
    axis: Axis, named: NamedDrive, *, name: str | None = None, idle: Axis | None = None,
    spindle_hz: float | None = None, tools: int | None = None,
) -> Estimated:  # fmt: skip
    """Return the cutting force of an axis.

    Parameters
    ----------
    axis
        Its signals.
    named
        Its drive.
    name
        Of the estimator; None for `load_side` with a scale, `dob` without.
    idle
        The same axis while nothing cuts.
    spindle_hz, tools
        Speed (Hz) and cutting edges, for `fitted` and for the lines of `kalman`.
    """
    from chatter.identification.idling_runs import learned, speed_of, taken_off

    name = _chosen(name, axis)
    notes = list(axis.notes)
    made, cutoff, predicted = _observer(name, named, axis, spindle_hz, tools)
    force = _run(made, axis, cutoff)
    late = made.latency
    index = np.arange(force.size, dtype=np.float64) - late * axis.rate_hz
    position = np.interp(index, np.arange(force.size), _filled(axis.position_m))
    speed = speed_of(position, axis.rate_hz)
    friction, said = _friction(named, made, name, speed)
    share = None
    if idle is not None:
        if abs(idle.rate_hz / axis.rate_hz - 1.0) > 0.02:
            raise InputError("idle", idle.rate_hz, f"recorded at the rate of the cut, {axis.rate_hz:g} Hz")
        places = np.interp(np.arange(idle.position_m.size) - late * idle.rate_hz, np.arange(idle.position_m.size),
                           _filled(idle.position_m))  # fmt: skip
        table = learned(places, _run(made, idle, cutoff), idle.rate_hz)
        off = taken_off(table, position, axis.rate_hz)
        share = float(np.isfinite(off[np.isfinite(force)]).mean())
        notes += _idle_notes(table, share)
        friction = np.where(np.isfinite(off), off, friction)
    if said and (share is None or share < 1.0):
        notes.append(said)
    force = force - friction
    if not np.isfinite(force).any():
        raise RefusalError("the recording is too short for this estimator", {"estimator": name, "samples": 0})
    return Estimated(
        estimator=name, drive=named.name, time_s=index / axis.rate_hz, force_n=force, position_m=position,
        speed_m_s=speed, latency_ms=1e3 * late, predicted_error_n=predicted(force), cutoff_hz=cutoff, idle_share=share,
        notes=tuple(notes),
    )  # fmt: skip


def _chosen(name: str | None, axis: Axis) -> str:
    from chatter.observers.named import NAMES

    possible = WITHOUT_SCALE if axis.stage_m is None else NAMES
    if name is None:
        return "dob" if axis.stage_m is None else "load_side"
    if name not in NAMES:
        raise InputError("estimator", name, f"one of {', '.join(NAMES)}")
    if name not in possible:
        rule = f"one of {', '.join(possible)}: the recording has no second encoder (--map CHANNEL=stage:mm names it)"
        raise InputError("estimator", name, rule)
    return name


def _observer(name: str, named: NamedDrive, axis: Axis, spindle_hz: float | None, tools: int | None) -> Any:
    """Return the estimator, the edge of its low-pass (Hz), and what predicts its error from a force."""
    from chatter.observers.linear import LinearObserver
    from chatter.observers.named import observer
    from chatter.observers.prediction import predicted_error
    from chatter.observers.stage_model import NominalControl

    if name == "fitted" and spindle_hz is None:
        raise InputError("speed-rpm", None, "given for the estimator fitted")
    if name == "kalman" and named.control is None:
        raise InputError("drive", named.name, "a drive with its loops for the estimator kalman: a table [control]")
    names = ("position_gain", "velocity_gain", "disturbance_bandwidth", "derivative_bandwidth")
    control = None if named.control is None else NominalControl(**{k: getattr(named.control, k) for k in names})
    cutoff = min(named.settings.force_cutoff_hz, CUTOFF_OVER_RATE * axis.rate_hz)
    scene = _scene(named, control, cutoff, 1.0)
    tooth = None if spindle_hz is None or tools is None else spindle_hz * tools
    made: Any = observer(
        name, named.nominal(), axis.rate_hz, cutoff_hz=cutoff, control=control, scene=scene, spindle_hz=spindle_hz,
        tooth_pass_hz=tooth, thrust_noise=max(_noise(axis.thrust_n), LEAST_THRUST_NOISE_N),
    )  # fmt: skip

    def predicted(force: Floats) -> float | None:
        if not isinstance(made, LinearObserver):
            return float(made.force_std) if hasattr(made, "force_std") else None
        return predicted_error(made, _scene(named, control, cutoff, float(np.nanstd(force)))).total

    return made, cutoff, predicted


def _scene(named: NamedDrive, control: Any, cutoff: float, force: float) -> Any:
    from chatter.observers.prediction import Scene

    rub = [f.coulomb if f else 0.0 for f in (named.drive.motor_friction, named.drive.stage_friction)]
    return Scene(
        band_hz=(min(LEAST_BAND_HZ, 0.1 * cutoff), cutoff), force=force, motor_friction=FRICTION_LEFT * rub[0],
        stage_friction=FRICTION_LEFT * rub[1], uncertainty=UNKNOWN, control=control,
    )  # fmt: skip


def _noise(x: Floats) -> float:
    left = np.diff(x[np.isfinite(x)], 4)
    return float(1.4826 * np.median(np.abs(left)) / math.sqrt(70.0)) if left.size else 0.0


def _run(made: Any, axis: Axis, cutoff: float) -> Floats:
    """Return the force, stretch by stretch without missing samples; NaN in between and while filters settle."""
    from chatter.identification.servo import stretches

    signals = [axis.position_m, axis.thrust_n, *([] if axis.stage_m is None else [axis.stage_m])]
    good = np.all([np.isfinite(signal) for signal in signals], axis=0)
    out = np.full(good.size, np.nan)
    settling = math.ceil(SETTLED * axis.rate_hz / cutoff)
    for part in stretches(good):
        made.reset()
        motor = axis.position_m[part]
        stage = np.zeros(motor.size) if axis.stage_m is None else axis.stage_m[part]
        found = np.asarray(made.update(motor, stage, axis.thrust_n[part]), dtype=np.float64).reshape(motor.size)
        found[: max(made.first_valid_sample, settling)] = np.nan
        out[part] = found
    return out


def _filled(x: Floats) -> Floats:
    good = np.isfinite(x)
    return np.interp(np.arange(x.size), np.flatnonzero(good), x[good])


def _friction(named: NamedDrive, made: Any, name: str, speed: Floats) -> tuple[Floats, str]:
    """Return what the file of the drive tells of dry friction and constant load as the estimator sees it (N)."""
    drive, weight = named.drive, getattr(made, "weight", None)
    of_motor = 1.0 if weight is None else float(weight)
    off = np.zeros(speed.size)
    for share, friction in ((of_motor, drive.motor_friction), (1.0, drive.stage_friction)):
        if friction is not None and share != 0.0:
            slow = friction.stribeck_velocity or SLIDES
            dry = dataclasses.replace(friction, viscous=0.0) if name != "thrust" else friction
            off += share * np.abs(dry.steady(speed)) * np.tanh(speed / slow)
    told = ["friction"] if off.any() else []
    if drive.load:
        off += drive.load
        told.append(f"a constant load of {drive.load:g} N")
    return off, f"{' and '.join(told)} was taken off, as the drive's file tells" if told else ""


def _idle_notes(table: Any, share: float) -> list[str]:
    speeds = ", ".join(f"{1e3 * t.velocity:.3g} mm/s ({n} runs)" for t, n in zip(table.tables, table.runs, strict=True))
    stands = "" if table.standing is None else f"{', ' if speeds else ''}standing"
    if not speeds and not stands:
        return ["the idling recording has no run at constant speed: nothing was taken off for it"]
    notes = [f"idling axis taken off at {speeds}{stands}: {100.0 * share:.0f} % of the samples"]
    if any(count < 3 for count in table.runs):
        notes.append("fewer than three idling runs at a speed: what changes from run to run stays in the force")
    return notes
