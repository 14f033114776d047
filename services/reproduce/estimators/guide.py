"""Section 6.3, Fig. 6-6 to 6-9: chatter of a standing turret, seen through a rolling (X1) and a sliding guide (Y1).

Each axis holds its place under a steady cutting force with a little run-out; then chatter grows. Two scenes: the motor
stands (its count does not change), or creeps over its counts as the force wanders.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from chatter import BiquadFilter, MovingVariance, butterworth
from chatter.observers.family import linear_observer
from services.drives import NamedDrive
from services.messages import Floats
from services.reproduce import published as thesis
from services.reproduce.estimators import independent
from services.reproduce.estimators import published as print_
from services.reproduce.estimators.kit import believed, checked, drive_of, line
from services.reproduce.rows import Row, said
from turning_sim import AxisBlock, ServoAxis

AXES = ("nty3-x1", "nty3-y1")
ESTIMATORS = ("dob", "medob", "vibration", "load_side")
CHATTER_HZ, CHATTER_N = thesis.LINES_HZ[1], 100.0
WINDOW_S = 0.05
SCENES = {("nty3-x1", "stands"): (150.0, 1.0), ("nty3-x1", "creeps"): (150.0, 4.0),
          ("nty3-y1", "stands"): (60.0, 0.5), ("nty3-y1", "creeps"): (150.0, 4.0)}  # fmt: skip
"""Steady force and run-out (N) of each scene: what the friction of the motor holds, and what moves it over a count."""
ONSET_S, GROWN_S, END_S = 2.0, 2.6, 3.4
_ENTER_S, _QUIET_S = 0.2, 1.2
_RISE_1_S, _FIRST_N = 12.0, 1.0
_BAND_HZ = (550.0, 750.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class GuideScene:
    """One axis in one scene.

    Attributes
    ----------
    axis, motor
        Name of the drive; `stands` or `creeps`.
    time_s, force_n
        The true load on the slide, shape (n,).
    estimate_n, variance_n2
        Estimator -> force and its moving variance, shape (n,).
    motor_over_stage
        Amplitude of the true motion of the motor over that of the stage at the chatter frequency.
    counts
        Different counts of the motor encoder before the chatter.
    """

    axis: str
    motor: str
    rate_hz: float
    time_s: Floats
    force_n: Floats
    estimate_n: dict[str, Floats]
    variance_n2: dict[str, Floats]
    motor_over_stage: float
    counts: int

    @property
    def quiet(self) -> slice:
        """Cutting before the chatter."""
        return slice(round(_QUIET_S * self.rate_hz), round(ONSET_S * self.rate_hz))

    @property
    def loud(self) -> slice:
        """Grown chatter."""
        return slice(round(GROWN_S * self.rate_hz), None)

    def rise(self, name: str) -> float:
        """Return the moving variance in grown chatter over that in quiet cutting, medians."""
        values = self.variance_n2[name]
        return float(np.median(values[self.loud]) / np.median(values[self.quiet]))

    def share(self, name: str) -> float:
        """Return which part of the chatter force the estimate shows at its frequency."""
        found = line(self.estimate_n[name][self.loud], CHATTER_HZ, self.rate_hz)
        return float(abs(found) / abs(line(self.force_n[self.loud], CHATTER_HZ, self.rate_hz)))


def study_guides() -> tuple[GuideScene, ...]:
    """Let chatter grow on both axes in both scenes."""
    return tuple(_scene(axis, motor) for axis, motor in SCENES)


def _force(time: Floats, steady: float, runout: float) -> Floats:
    enter = np.clip((time - _ENTER_S) / 0.1, 0.0, 1.0)
    slow = 2.0 * math.pi * thesis.SPEED_RPM / 60.0 * time
    grown = np.minimum(_FIRST_N * np.exp(_RISE_1_S * np.maximum(time - ONSET_S, 0.0)), CHATTER_N)
    chatter = np.where(time < ONSET_S, 0.0, grown) * np.sin(2.0 * math.pi * CHATTER_HZ * time)
    return enter * (steady + runout * (np.sin(slow) + 0.6 * np.sin(2.0 * slow + 1.0))) + chatter


def turret_block(name: str, motor: str) -> tuple[NamedDrive, AxisBlock]:
    """Return an axis and its signals in a scene."""
    named = drive_of(name)
    rate, (steady, runout) = named.settings.sample_rate_hz, SCENES[name, motor]
    axis = ServoAxis(named.drive, named.control, rate, seed=1)
    count = round(END_S * rate)
    return named, axis.advance(np.zeros(count), _force(axis.force_times(count), steady, runout))


def _scene(name: str, motor: str) -> GuideScene:
    named, block = turret_block(name, motor)
    rate, count = block.sample_rate_hz, block.thrust.size
    estimates: dict[str, Floats] = {}
    variances: dict[str, Floats] = {}
    for kind in ESTIMATORS:
        observer = linear_observer(kind, believed(named), rate, cutoff_hz=named.settings.force_cutoff_hz)
        estimates[kind] = observer.update(block.motor_position, block.stage_position, block.thrust)
        variances[kind] = MovingVariance(round(WINDOW_S * rate)).update(estimates[kind])[:, 0]
    loud, quiet = slice(round(GROWN_S * rate), None), slice(round(_QUIET_S * rate), round(ONSET_S * rate))
    moved = [
        abs(line(values[loud], CHATTER_HZ, rate)) for values in (block.true_motor_position, block.true_stage_position)
    ]
    return GuideScene(
        axis=name, motor=motor, rate_hz=rate, time_s=np.arange(count) / rate, force_n=block.true_force,
        estimate_n=estimates, variance_n2=variances, motor_over_stage=float(moved[0] / moved[1]),
        counts=np.unique(block.motor_position[quiet]).size,
    )  # fmt: skip


def scene_of(scenes: tuple[GuideScene, ...], axis: str, motor: str) -> GuideScene:
    """Return one of the scenes."""
    return next(one for one in scenes if (one.axis, one.motor) == (axis, motor))


def guide_rows(scenes: tuple[GuideScene, ...]) -> list[Row]:
    """Return what Fig. 6-6 to 6-9 state."""
    rows: list[Row] = []
    for axis in AXES:
        stands, creeps = scene_of(scenes, axis, "stands"), scene_of(scenes, axis, "creeps")
        rows += [*_traces(stands), *_variances(stands, creeps)]
    x1, y1 = (scene_of(scenes, axis, "stands") for axis in AXES)
    expected = independent.PRESLIDING
    rows.append(checked("section 6.3", "Y1 over X1: chatter amplitude of the load side", expected,
                        y1.share("load_side") / x1.share("load_side"), within=0.02,
                        why="the presliding spring of the sliding guide, 3e8 N/m, reads as force"))  # fmt: skip
    return [*rows, _comes_and_goes(scene_of(scenes, "nty3-y1", "creeps"))]


def _traces(one: GuideScene) -> list[Row]:
    title = print_.TITLE[one.axis]
    figure = {"nty3-x1": "6-6", "nty3-y1": "6-7"}[one.axis]
    source, where = f"section 6.3, Fig. {figure}", "the motor stands on one count"
    apart = float(np.std((one.estimate_n["medob"] - one.estimate_n["dob"])[one.quiet]))
    part = apart / float(np.mean(one.force_n[one.quiet]))
    medob, dob = one.share("medob"), one.share("dob")
    return [
        said(source, f"{title}, MEDOB: chatter amplitude over that of the force", "clearly observed", medob,
             0.8 < medob < 1.3, why=f"0.8 to 1.3; {where}; a sliding guide adds the spring of its presliding"),
        said(source, f"{title}, DOB: chatter amplitude over that of the force", "not reflected", dob, dob < 0.1,
             why=f"a tenth; {where}"),
        said(source, f"{title}: motion of the motor over that of the stage", "lower sensitivity, < 1",
             one.motor_over_stage, one.motor_over_stage < 0.05, why="5 %, at the chatter frequency"),
        said("section 6.3, Fig. 6-8", f"{title}, quiet cut: MEDOB less DOB, over the mean force",
             "no significant difference", part, part < 0.05, why="5 %, standard deviation"),
    ]  # fmt: skip


def _variances(stands: GuideScene, creeps: GuideScene) -> list[Row]:
    title, source = print_.TITLE[stands.axis], "section 6.3, Fig. 6-9"
    apart = float(
        np.median(stands.variance_n2["medob"][stands.loud]) / np.median(stands.variance_n2["dob"][stands.loud])
    )
    rows = [
        said(source, f"{title}, MEDOB: moving variance in chatter over quiet", "significantly different, >> 1",
             stands.rise("medob"), stands.rise("medob") > 10.0, why="ten times; the motor stands on one count"),
        said(source, f"{title}: moving variance in chatter, MEDOB over DOB", "in contrast to DOB, >> 1", apart,
             apart > 10.0, why="ten times; the motor stands on one count"),
        said(source, f"{title}, DOB while the motor creeps: moving variance in chatter over quiet",
             "in contrast to MEDOB, near 1", creeps.rise("dob"), creeps.rise("dob") < 2.0,
             why=f"below 2; {creeps.counts} counts of the motor in quiet cutting. While it stands the little that DOB "
             f"shows rises {stands.rise('dob'):.0f} times, since no noise of a real thrust is simulated"),
        said(source, f"{title}, MEDOB while the motor creeps: the same", "significantly different, >> 1",
             creeps.rise("medob"), creeps.rise("medob") > 10.0,
             why="one count of the rotary encoder in the inertia of the motor is more force than the chatter: MEDOB "
             "keeps the chatter only while the motor stands, the load side always; inertia and loops of this axis are "
             "assumed"),
    ]  # fmt: skip
    for name, least in (("vibration", 2.0), ("load_side", 10.0)):
        worst = min(stands.rise(name), creeps.rise(name))
        rows.append(said("section 6.3", f"{title}, {name}: least moving variance in chatter over quiet",
                         "a scale near the cutting point sees it", worst, worst > least,
                         why=f"above {least:g}, whether the motor stands or creeps"))  # fmt: skip
    return rows


def _comes_and_goes(one: GuideScene) -> Row:
    """Return how often the DOB of Y1 shows next to nothing of the chatter."""
    band = butterworth(2, np.array(_BAND_HZ), one.rate_hz, "bandpass")
    length = round(0.005 * one.rate_hz)
    shown = BiquadFilter(band).update(one.estimate_n["dob"])[one.loud, 0]
    true = BiquadFilter(band).update(one.force_n)[one.loud, 0]
    pieces = [values[: values.size // length * length].reshape(-1, length).std(axis=1) for values in (shown, true)]
    silent = float(np.mean(pieces[0] < 0.3 * pieces[1]))
    return said("section 6.3, Fig. 6-7", "Y1, DOB: share of 5 ms pieces with less than 30 % of the chatter",
                "appears and disappears, 0 < share < 1", silent, 0.05 < silent < 0.95,
                why="0.05 to 0.95, while the motor creeps over its counts")  # fmt: skip
