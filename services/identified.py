"""What was identified from a recording: for programs, for people."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from services.errors import InputError, RefusalError
from services.importers.quantities import kind_of_unit, si_factor
from services.importers.recording import Recording
from services.importers.roles import told
from services.importers.servo import Axis

_KEYS = ("mass_kg", "viscous_n_s_m", "coulomb_n", "offset_n")


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """Keys of the command line, the words for people, and what the figure needs."""

    keys: dict[str, Any]
    text: str
    made: Any


def servo_answer(
    recording: Recording, axis: Axis, cutoff_hz: float | None, dead_time: float | None = None
) -> Answer:
    """Return mass and friction of an axis.

    Parameters
    ----------
    recording
        It comes from.
    axis
        Its signals.
    cutoff_hz
        Edge of the low-pass (Hz), None for the best.
    dead_time
        By which the position is late beside the thrust (s), None to find it.
    """
    from chatter.identification import identify_servo

    try:
        fit = identify_servo(axis.position_m, axis.thrust_n, axis.rate_hz, cutoff_hz=cutoff_hz, dead_time=dead_time)
    except ValueError as error:
        raise InputError("file", recording.source, f"a record of a moving axis ({error})") from error
    values = (fit.mass, fit.viscous, fit.coulomb, fit.offset)
    named = zip(_KEYS, values, fit.half_width, strict=True)
    keys: dict[str, Any] = {
        **dict(zip(_KEYS, values, strict=True)),
        "relative_error": fit.relative_error,
        "std": dict(zip(_KEYS, fit.std, strict=True)),
        "interval_95": {key: [value - half, value + half] for key, value, half in named},
        "asymmetric": {
            "viscous_forward_n_s_m": fit.forward.viscous, "viscous_backward_n_s_m": fit.backward.viscous,
            "coulomb_forward_n": fit.forward.coulomb, "coulomb_backward_n": fit.backward.coulomb,
            "relative_error": fit.asymmetric_error,
        },
        "constant_speed": {"std_n": fit.steady_std, "peak_n": fit.steady_peak},
        "dead_time_ms": 1e3 * fit.dead_time, "cutoff_hz": fit.cutoff_hz,
        "rate_hz": axis.rate_hz, "duration_s": recording.duration_s,
        "channels": dict(axis.channels), "flags": list(fit.flags), "notes": [*recording.notes, *axis.notes],
    }  # fmt: skip
    if math.isnan(fit.mass) and math.isnan(fit.coulomb) and math.isnan(fit.viscous):
        raise RefusalError(f"this record determines nothing: {'; '.join(fit.flags)}", keys)
    return Answer(keys=keys, text=_servo_words(keys, fit.std), made=fit)


def _servo_words(keys: dict[str, Any], std: tuple[float, ...]) -> str:
    units = ("kg", "N s/m", "N", "N")
    names = ("mass", "viscous friction", "Coulomb friction", "offset")
    lines = [
        f"{name:17}{'unknown' if math.isnan(keys[key]) else f'{keys[key]:10.4g} +- {s:.2g} {unit}'}"
        for name, key, s, unit in zip(names, _KEYS, std, units, strict=True)
    ]
    two = keys["asymmetric"]
    lines.append(
        f"each direction:   forward {two['viscous_forward_n_s_m']:.4g} N s/m, {two['coulomb_forward_n']:.4g} N; "
        f"backward {two['viscous_backward_n_s_m']:.4g} N s/m, {two['coulomb_backward_n']:.4g} N"
    )
    lines.append(f"left unexplained: {100 * keys['relative_error']:.1f} % of the thrust, "
                 f"{100 * two['relative_error']:.1f} % with friction of each direction")  # fmt: skip
    if not math.isnan(keys["constant_speed"]["std_n"]):
        steady = keys["constant_speed"]
        lines.append(f"at constant speed {steady['std_n']:.2g} N (at most {steady['peak_n']:.2g} N) are left")
    return "\n".join(lines)


def hammer_answer(recording: Recording, band_hz: tuple[float, float] | None, sure: bool = False) -> Answer:
    """Return the modes of a hammer test.

    Parameters
    ----------
    recording
        With roles.
    band_hz
        Where to look (Hz), None for where the hammer excites.
    sure
        Whether the user has said which channel is the hammer.
    """
    from chatter.identification import find_taps, frf_of_taps

    notes = list(recording.notes)
    hammer, responses = hammer_channels(recording, notes, sure)
    force = recording.samples[:, hammer] * si_factor(recording.units[hammer])
    factors = [si_factor(recording.units[k]) if _known(recording, k) else 1.0 for k in responses]
    try:
        taps = find_taps(force, recording.samples[:, responses] * np.array(factors), recording.rate_hz)
    except ValueError as error:
        raise InputError("file", recording.source, f"a hammer test ({error})") from error
    names = [recording.names[k] for k in responses]
    found = {
        "taps": len(taps.start), "double_hits": len(taps.doubled), "rate_hz": recording.rate_hz,
        "hammer": recording.names[hammer], "responses": names, "notes": [*notes, *taps.notes],
    }  # fmt: skip
    return modes_answer(recording.source, frf_of_taps(taps), found, band_hz)


def modes_answer(source: str, frf: Any, found: dict[str, Any], band_hz: tuple[float, float] | None) -> Answer:
    """Return the modes of frequency responses.

    Parameters
    ----------
    source
        File, for messages.
    frf
        `chatter.identification.Frf`.
    found
        Keys that are known already: `taps`, `responses`, `notes` and more.
    band_hz
        Where to look (Hz), None for where there is something.
    """
    from chatter.identification import modes_of

    try:
        fit = modes_of(frf, band_hz)
    except ValueError as error:
        raise InputError("file", source, f"one with frequency responses ({error})") from error
    modes = [
        {
            "frequency_hz": m.frequency_hz, "damping_ratio": m.damping_ratio, "frequency_std_hz": m.frequency_std_hz,
            "damping_std": m.damping_std, "coherence": m.coherence, "peak": m.peak,
            "channel": found["responses"][m.channel], "share": m.share, "resolved": m.resolved,
        }
        for m in fit.modes
    ]  # fmt: skip
    keys: dict[str, Any] = {
        "modes": modes, **found, "band_hz": list(fit.band_hz),
        "line_hz": float(frf.frequency_hz[1] - frf.frequency_hz[0]), "notes": [*found["notes"], *fit.notes],
    }  # fmt: skip
    if not modes:
        raise RefusalError("no mode stands out of the noise: tap harder, more often, or give --band", keys)
    return Answer(keys=keys, text=_hammer_words(keys), made=(frf, fit))


def _known(recording: Recording, k: int) -> bool:
    return kind_of_unit(recording.units[k]) is not None


def _hammer_words(keys: dict[str, Any]) -> str:
    low, high = keys["band_hz"]
    source = f"{keys['taps']} taps" if keys["taps"] else "the responses in the file"
    lines = [f"{len(keys['modes'])} modes from {source}, {low:.3g} to {high:.4g} Hz:",
             "  frequency Hz        damping %          coherence  strongest in"]  # fmt: skip
    for m in keys["modes"]:
        seen = "-" if m["coherence"] is None else f"{m['coherence']:.3f}"
        lines.append(
            f"{m['frequency_hz']:10.3f} +- {m['frequency_std_hz']:<7.2g}{100 * m['damping_ratio']:7.3f} +- "
            f"{100 * m['damping_std']:<7.2g} {seen:>9}  {m['channel']}" + ("" if m["resolved"] else "  (one line)")
        )
    return "\n".join(lines)


def hammer_channels(recording: Recording, notes: list[str], sure: bool) -> tuple[int, list[int]]:
    """Return which channel is the hammer and which are responses; a name that its shape belies is told.

    Parameters
    ----------
    recording
        With roles.
    notes
        What was assumed is appended.
    sure
        Whether the user has said which it is.
    """
    alive = [k for k in range(len(recording.names)) if _spread(recording.samples[:, k]) > 0.0]
    if len(alive) < 2:
        rule = f"with a hammer and a response; it holds {', '.join(told(recording))}"
        raise InputError("file", recording.source, rule)
    length = {k: pulse_length(recording.samples[:, k]) for k in alive}
    shortest = min(alive, key=lambda k: length[k])
    said = [k for k in alive if recording.roles[k] in ("hammer",)] or [
        k for k in alive if recording.roles[k] in ("thrust", "force")
    ]
    hammer = said[0] if said else shortest
    if not said:
        notes.append(f"{recording.names[hammer]} holds the shortest pulses and was taken for the hammer")
    elif not sure and length[hammer] > 4.0 * length[shortest]:
        notes.append(
            f"{recording.names[hammer]} is called the hammer but rings on; {recording.names[shortest]} holds the "
            "pulses and was taken for it: the channels look swapped (--map CHANNEL=hammer says otherwise)"
        )
        hammer = shortest
    named = [k for k in alive if recording.roles[k] == "response" and k != hammer]
    others = [k for k in alive if k != hammer and recording.roles[k] != "reference"]
    return hammer, named or others


def _spread(x: np.ndarray) -> float:
    finite = x[np.isfinite(x)]
    return float(np.ptp(finite)) if finite.size else 0.0


def pulse_length(x: np.ndarray) -> float:
    """Return how many samples hold most of the energy of a channel.

    Parameters
    ----------
    x
        shape (n,)
    """
    finite = x[np.isfinite(x)]
    power = np.sort((finite - np.median(finite)) ** 2)[::-1]
    return float(np.searchsorted(np.cumsum(power), 0.8 * power.sum()) + 1)
