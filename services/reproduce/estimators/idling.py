"""Sections 3.4, 5.3, 5.4.2: what an idling axis feels over its position, and one that stands while another feeds.

Machine B as its file describes it: friction, ripple, interpolation errors of both encoders.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from chatter import BiquadFilter
from chatter.observers.family import linear_observer
from chatter.observers.idling import IdlingTable, learn_idling, left_of_ripple
from chatter.observers.notch import encoder_lines_hz, notches
from services.messages import Floats
from services.reproduce.estimators import independent
from services.reproduce.estimators import published as print_
from services.reproduce.estimators.kit import believed, bounded, checked, drive_of
from services.reproduce.rows import Row, said
from turning_sim import AxisBlock, Friction, Milling, ServoAxis

FEED = 5e-3
"""Of Fig. 3-10 to 3-16 (m/s)."""
BESIDE = 2e-6
"""How far the table is off its place (m): a screw of 0.2 m that is 1 K warmer grows by as much."""
LONG, COGGING = 5000e-6, 500e-6 / 3.0
SIGNAL = LONG / print_.SIGNAL_PERIODS
ESTIMATORS = ("thrust", "medob", "vibration", "load_side")
SPEEDS_RPM = (1000.0, 4000.0, 10000.0)
_RUN_S, _RAMP_S, _SKIPPED_S = 1.5, 0.05, 0.25
_NOTCH_WIDTH = 0.05
_IDLE_S, _CUT_S = 0.2, 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Feeding:
    """An estimator of the idling axis: what it reads, and what a table leaves of it.

    Attributes
    ----------
    position_m, force_n
        Of the last run, the force at the time of its position, shape (n,).
    table
        Of the other runs.
    left_n
        The same force less the table at its place, and with the table `BESIDE` it, shape (n,).
    """

    position_m: Floats
    force_n: Floats
    table: IdlingTable
    left_n: dict[str, Floats]

    def wave(self, values: Floats, wavelength: float) -> float:
        """Return the amplitude of a ripple (N)."""
        window = np.hanning(values.size)
        turn = np.exp(-2j * np.pi * self.position_m / wavelength)
        return float(2.0 * abs(((values - values.mean()) * window * turn).sum()) / window.sum())


@dataclass(frozen=True, slots=True, kw_only=True)
class Standing:
    """Errors of the standing axis (N): estimator -> mean and standard deviation; of the force itself under `force`."""

    speed_rpm: float
    error_n: dict[str, tuple[float, float]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Idling:
    """What both studies found; `notched` is the error of MEDOB after notches over before."""

    feeding: dict[str, Feeding]
    standing: tuple[Standing, ...]
    notched: float


def study_idling() -> Idling:
    """Let the axis idle four times, then stand under three cross-feed cuts."""
    runs = [_run(number) for number in range(4)]
    feeding = {name: _feeding(name, runs) for name in ESTIMATORS}
    return Idling(
        feeding=feeding, standing=tuple(_standing(speed) for speed in SPEEDS_RPM), notched=_notched(feeding["medob"])
    )


def _run(number: int) -> AxisBlock:
    named = drive_of("machine-b")
    rate, start = named.settings.sample_rate_hz, 1.37e-6 * number
    axis = ServoAxis(named.drive, named.control, rate, seed=1 + number, start_position=start)
    time = np.arange(round(_RUN_S * rate)) / rate
    way = np.where(time < _RAMP_S, 0.5 * time**2 / _RAMP_S, time - 0.5 * _RAMP_S)
    return axis.advance(start + FEED * way, np.zeros(time.size * axis.substeps))


def _feeding(name: str, runs: list[AxisBlock]) -> Feeding:
    named = drive_of("machine-b")
    rate = named.settings.sample_rate_hz
    positions: list[Floats] = []
    forces: list[Floats] = []
    for block in runs:
        observer = linear_observer(name, believed(named), rate, cutoff_hz=named.settings.force_cutoff_hz)
        found = observer.update(block.motor_position, block.stage_position, block.thrust)
        late, first = round(observer.latency * rate), round(_SKIPPED_S * rate)
        positions.append(block.stage_position[first : block.stage_position.size - late])
        forces.append(found[first + late :])
    table = learn_idling(positions[:3], forces[:3], rate, bin_width=1.2 * FEED / rate)
    place, force = positions[3], forces[3]
    last = table.start + table.bin * (table.force.size - 1)
    inside = (place - BESIDE > table.start) & (place < last)
    place, force = place[inside], force[inside]
    left = {
        "in place": force - table.at(place, FEED),
        "beside": force - table.at(place - BESIDE, FEED),
    }
    return Feeding(position_m=place, force_n=force, table=table, left_n=left)


def _notched(medob: Feeding) -> float:
    """Return the standard deviation that notches leave of what a table beside its place leaves."""
    rate, top = drive_of("machine-b").settings.sample_rate_hz, 2000.0
    sections = notches(encoder_lines_hz(FEED, [SIGNAL], 3, top), _NOTCH_WIDTH, rate)
    values = medob.left_n["beside"]
    after = BiquadFilter(sections).update(values)[:, 0]
    rest = slice(values.size // 4, None)
    return float(np.std(after[rest]) / np.std(values[rest]))


def _standing(speed_rpm: float) -> Standing:
    """Cut across the axis; its motor sticks at 130 N, more than the force."""
    named = drive_of("machine-b")
    rate, cutoff = named.settings.sample_rate_hz, named.settings.force_cutoff_hz
    stuck = dataclasses.replace(named.drive, motor_friction=Friction(coulomb=print_.STICTION_N))
    axis = ServoAxis(stuck, named.control, rate, seed=1)
    milling = Milling(
        spindle_hz=speed_rpm / 60.0, teeth=2, feed_per_tooth=30e-6, tool_diameter=6e-3, axial_depth=2e-3,
        radial_depth=1.5e-3, tangential_coefficient=1800e6, radial_coefficient=820e6,
    )  # fmt: skip
    idle, count = round(_IDLE_S * rate), round(_CUT_S * rate)
    axis.advance(np.zeros(idle), np.zeros(idle * axis.substeps))
    block = axis.advance(np.zeros(count), milling.force(axis.force_times(count) - _IDLE_S))
    errors: dict[str, tuple[float, float]] = {}
    index, rest = np.arange(count, dtype=np.float64), slice(count // 4, None)
    for name in ESTIMATORS:
        observer = linear_observer(name, believed(named), rate, cutoff_hz=cutoff)
        found = observer.update(block.motor_position, block.stage_position, block.thrust)
        reference = BiquadFilter(observer.sections).update(block.true_force)[:, 0]
        reference = np.interp(index - observer.age * rate, index, reference)
        error = found[rest] - reference[rest]
        errors[name] = float(error.mean()), float(error.std())
        errors["force"] = float(reference[rest].mean()), float(reference[rest].std())
    return Standing(speed_rpm=speed_rpm, error_n=errors)


def idling_rows(study: Idling) -> list[Row]:
    """Return what tables over position take off, and what a standing axis shows."""
    return [*_tables(study), *_law(study), *_cross_feed(study)]


def _tables(study: Idling) -> list[Row]:
    def left(name: str, wave: float, table: str = "in place") -> float:
        one = study.feeding[name]
        return one.wave(one.left_n[table], wave) / one.wave(one.force_n, wave)

    medob, vibration = (study.feeding[name] for name in ("medob", "vibration"))
    source, beside = "section 3.4, Fig. 3-15 and 3-16", "; the table is 2 um off its place"
    size = {wave: vibration.wave(vibration.force_n, wave) for wave in (LONG, COGGING, 0.5 * COGGING)}
    constant = float(np.std(medob.force_n) / np.std(medob.left_n["in place"]))
    lines = vibration.wave(vibration.force_n, SIGNAL) / medob.wave(medob.force_n, SIGNAL)
    return [
        said(source, "thrust of machine B, wave of the lead (5 mm): left over before", "eliminated",
             left("thrust", LONG, "beside"), left("thrust", LONG, "beside") < 0.1, why=f"a tenth{beside}"),
        said(source, "thrust of machine B, torque ripple (0.167 mm): left over before", "reduced",
             left("thrust", COGGING, "beside"), left("thrust", COGGING, "beside") < 0.3, why=f"30 %{beside}"),
        said(source, "thrust of machine B, rotary signal period (9.77 um): left over before", "little eliminated",
             left("thrust", SIGNAL, "beside"), left("thrust", SIGNAL, "beside") > 0.5, why=f"more than half{beside}"),
        said("section 5.3, Fig. 5-16", "vibration mode, wave of the lead: left over before", "eliminated",
             left("vibration", LONG), left("vibration", LONG) < 0.1, why="a tenth"),
        said("section 5.3, Fig. 5-14", "vibration mode, wave of the lead over torque ripple", "dominant, > 1",
             size[LONG] / max(size[COGGING], size[0.5 * COGGING]),
             size[LONG] > max(size[COGGING], size[0.5 * COGGING]), why="amplitudes in force"),
        said("section 4.3.2, Fig. 4-18", "MEDOB idling: left by a constant over left by a table", "difficult, > 1",
             constant, constant > 2.0, why="more than twice"),
        said("section 4.3.3, Fig. 4-27", "MEDOB idling: left by notches at the rotary signal period over without",
             "can be reduced, < 1", study.notched, study.notched < 0.5, why="below half"),
        said("section 5.4.1", "line of the rotary signal period, vibration mode over MEDOB", "not included",
             lines, lines < 0.1, why="below a tenth"),
    ]  # fmt: skip


def _law(study: Idling) -> list[Row]:
    one = study.feeding["medob"]
    rows: list[Row] = []
    for words, wave in (("9.77 um", SIGNAL), ("0.083 mm", 0.5 * COGGING), ("0.167 mm", COGGING)):
        expected = left_of_ripple(BESIDE, wave)
        found = one.wave(one.left_n["beside"], wave) / one.wave(one.force_n, wave)
        rows.append(checked("section 3.4", f"MEDOB, table 2 um beside its place, wave of {words}: left over before",
                            expected, found, within=0.1 * expected,
                            why="the law 2 sin(pi delta/Lambda); 10 %"))  # fmt: skip
    return rows


def _cross_feed(study: Idling) -> list[Row]:
    rows: list[Row] = []
    slow = study.standing[0].error_n
    for name, most in independent.CROSS_FEED.items():
        rows.append(bounded("section 5.4.2, Fig. 5-22", f"motor sticks at 130 N: error of {name} over of medob", most,
                            slow[name][1] / slow["medob"][1]))  # fmt: skip
    for one in study.standing:
        error, what = one.error_n, f"cross-feed at {one.speed_rpm:g} 1/min"
        source = "section 5.4.2, Fig. 5-31"
        mean = abs(error["medob"][0] / error["force"][0])
        spread = error["medob"][1] / error["force"][1]
        worst = max(abs(value) for value in error["vibration"])
        rows += [
            said(source, f"{what}: mean error of MEDOB over mean force", "larger, > 1", mean, mean > 1.0,
                 why="the friction of the motor is read as force"),
            said(source, f"{what}: error of MEDOB over the force, standard deviations", "larger or comparable", spread,
                 spread > 0.8, why="above 0.8"),
            said(source, f"{what}: larger of mean and standard deviation of the error, vibration mode",
                 f"<= {print_.CROSS_FEED_N:g}", worst, worst <= print_.CROSS_FEED_N, unit="N",
                 why="force at most 35 N, simulated; printed of the tests"),
        ]  # fmt: skip
    mean = abs(slow["thrust"][0] / slow["force"][0])
    rows.append(said("section 5.4.2, Fig. 5-25", "mean error of the thrust over the mean force", "cannot be had",
                     mean, mean > 0.5, why="more than half of it"))  # fmt: skip
    return rows
