"""What was identified from a swept sine and from cuts at several feeds: for programs, for people."""

from __future__ import annotations

from typing import Any

import numpy as np

from services.errors import InputError
from services.identified import Answer
from services.importers.quantities import in_si, si_factor
from services.importers.recording import Recording
from services.importers.roles import told
from services.importers.servo import Axis
from services.importers.vocabulary import words
from services.messages import Floats

_DRIVE = {
    "rotor_mass": ("rotor_mass_kg", 1.0), "stage_mass": ("stage_mass_kg", 1.0),
    "rotor_viscosity": ("rotor_viscosity_n_s_m", 1.0), "stage_damping": ("stage_damping_n_s_m", 1.0),
    "screw_damping": ("screw_damping_n_s_m", 1.0), "screw_stiffness": ("screw_stiffness_n_m", 1.0),
    "motor_dead_time": ("motor_dead_time_ms", 1e3), "stage_dead_time": ("stage_dead_time_ms", 1e3),
}  # fmt: skip
_LEAST_ALIKE = 0.9
_FEEDS = ("feed", "vorschub", "fz", "fn", "feedrate", "f")
_MM2 = 1e-6


def sweep_answer(
    recording: Recording, axis: Axis, period_s: float | None, band_hz: tuple[float, float] | None, omega_current: float
) -> Answer:
    """Return the parameters of a drive.

    Parameters
    ----------
    recording
        It comes from.
    axis
        Its signals: thrust, motor and stage.
    period_s
        Of the sweep (s); None to find it in the thrust.
    band_hz
        Of the sweep (Hz); None for where the thrust is strong.
    omega_current
        Bandwidth of the current loop (rad/s).
    """
    from chatter.identification import drive_of_sweep, sweep_frf

    if axis.stage_m is None:
        found = ", ".join(told(recording))
        raise InputError("map", None, f"said: a sweep needs thrust, motor and stage; {recording.source} holds {found}")
    good = np.isfinite(axis.thrust_n) & np.isfinite(axis.position_m) & np.isfinite(axis.stage_m)
    if not good.all():
        missing = int(np.count_nonzero(~good))
        raise InputError("file", recording.source, f"a sweep without gaps ({missing} samples are missing)")
    period = round(period_s * axis.rate_hz) if period_s is not None else _period(axis.thrust_n)
    if period is None:
        raise InputError("period-s", None, f"given: the thrust in {recording.source} does not repeat")
    rest = slice(period if axis.thrust_n.size >= 3 * period + 1 else 0, None)
    band = band_hz or (3.0 * axis.rate_hz / period, 0.4 * axis.rate_hz)
    try:
        frf = sweep_frf(axis.thrust_n[rest], axis.position_m[rest], axis.stage_m[rest], axis.rate_hz, period, band)
        fit = drive_of_sweep(frf, omega_current)
    except ValueError as error:
        raise InputError("file", recording.source, f"a periodic sweep ({error})") from error
    keys: dict[str, Any] = {
        **{key: fit.value[name] * unit for name, (key, unit) in _DRIVE.items()},
        "resonance_hz": fit.resonance_hz, "damping_ratio": fit.damping_ratio, "relative_error": fit.relative_error,
        "std": {key: fit.std[name] * unit for name, (key, unit) in _DRIVE.items()}, "period_s": period / axis.rate_hz,
        "band_hz": [float(frf.frequency_hz[0]), float(frf.frequency_hz[-1])], "rate_hz": axis.rate_hz,
        "channels": dict(axis.channels), "flags": list(fit.flags), "notes": [*recording.notes, *axis.notes],
    }  # fmt: skip
    lines = [f"{key:24}{keys[key]:12.5g} +- {keys['std'][key]:.2g}" for key, _ in _DRIVE.values()]
    lines.append(f"resonance {fit.resonance_hz:.2f} Hz, damping {100 * fit.damping_ratio:.2f} %; "
                 f"{100 * fit.relative_error:.2g} % of the responses are left")  # fmt: skip
    return Answer(keys=keys, text="\n".join(lines), made=fit)


def _period(x: Floats) -> int | None:
    """Return the samples after which a signal repeats, None if it does not."""
    level = x - x.mean()
    size = 2 * level.size
    alike = np.fft.irfft(np.abs(np.fft.rfft(level, size)) ** 2)[: level.size]
    overlap = np.arange(level.size, 0, -1)
    alike = alike / overlap / max(float(alike[0]) / level.size, 1e-300)
    usable = alike[: 2 * level.size // 3]
    low = int(np.argmax(usable < 0.3))
    if low == 0:
        return None
    peak = low + int(np.argmax(usable[low:]))
    first = [k for k in (peak // n for n in range(8, 0, -1)) if k > low and usable[max(k - 2, 0) : k + 3].max() >=
             0.98 * usable[peak]]  # fmt: skip
    return None if usable[peak] < _LEAST_ALIKE else first[0] if first else peak


def cutting_answer(recording: Recording, depth_mm: float, teeth: int | None) -> Answer:
    """Return cutting coefficients from forces at several feeds.

    Parameters
    ----------
    recording
        A column of feed and columns of force; samples or means.
    depth_mm
        Of cut (mm).
    teeth
        Of a mill in a full slot; None for turning.
    """
    from chatter.identification import Coefficient, cutting_coefficient, slotting_coefficient

    names = list(recording.names)
    feeds = [k for k, name in enumerate(names) if _is_feed(name, recording.units[k])]
    forces = [k for k, role in enumerate(recording.roles) if role in ("thrust", "force") and k not in feeds]
    if len(feeds) != 1 or not forces:
        rule = f"with one column of feed and columns of force; it holds {', '.join(told(recording))}"
        raise InputError("file", recording.source, rule)
    feed = _feed(recording, feeds[0])
    rows: list[dict[str, Any]] = []
    for k in forces:
        force, direction = in_si(recording, k, "force"), _direction(names[k])
        try:
            one: Coefficient = (
                cutting_coefficient(feed, force, 1e-3 * depth_mm) if teeth is None
                else slotting_coefficient(feed, force, 1e-3 * depth_mm, teeth, direction)
            )  # fmt: skip
        except ValueError as error:
            raise InputError("file", recording.source, f"forces over feed ({error})") from error
        rows.append(
            {
                "channel": names[k], "direction": direction if teeth else None, "coefficient_n_mm2": one.cutting * _MM2,
                "edge_n_mm": 1e-3 * one.edge, "std_n_mm2": one.cutting_std * _MM2, "edge_std_n_mm": 1e-3 * one.edge_std,
                "half_width_95_n_mm2": one.half_width * _MM2, "r_squared": one.r_squared, "flags": list(one.flags),
            }
        )  # fmt: skip
    keys: dict[str, Any] = {
        "rows": rows, "feeds_mm": sorted({round(1e3 * float(f), 6) for f in feed[np.isfinite(feed)]}),
        "depth_mm": depth_mm, "teeth": teeth, "notes": list(recording.notes),
        "flags": [f"{row['channel']}: {flag}" for row in rows for flag in row["flags"]],
    }  # fmt: skip
    text = "\n".join(
        f"{row['channel']:12}{row['coefficient_n_mm2']:9.4g} +- {row['std_n_mm2']:.2g} N/mm2, edge "
        f"{row['edge_n_mm']:.3g} +- {row['edge_std_n_mm']:.2g} N/mm, R2 {row['r_squared']:.4f}"
        for row in rows
    )
    return Answer(keys=keys, text=text, made=None)


def _is_feed(name: str, unit: str) -> bool:
    parts = words(name)
    force = unit.strip().lower() in ("n", "kn", "lbf")
    return bool(parts) and not force and (parts[0] in _FEEDS or "feed" in parts)


def _feed(recording: Recording, k: int) -> Floats:
    unit = recording.units[k].lower().split("/")[0].strip()
    factor = si_factor(unit) if unit in ("m", "mm", "um", "µm", "in", "inch") else 1e-3
    feed = recording.samples[:, k] * factor
    if float(np.nanmax(feed, initial=0.0)) > 0.01:
        raise InputError(f"channel {recording.names[k]}", recording.units[k], "a feed per revolution or tooth in mm")
    return feed


def _direction(name: str) -> str:
    parts = "".join(words(name))
    if any(mark in parts for mark in ("fz", "axial", "forcez", "zforce")):
        return "axial"
    return "radial" if any(mark in parts for mark in ("fx", "radial", "forcex", "xforce")) else "tangential"
