"""Section 4.2.3 and 5.2.2 of the thesis: milling force of conditions 1 to 4, with one thing wrong at a time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from chatter.observers.family import linear_observer
from chatter.observers.prediction import response_of
from services.compare import AxisCut, Comparison, compare
from services.messages import Floats
from services.reproduce.estimators import independent
from services.reproduce.estimators.kit import believed, bounded, checked, drive_of, exceeds, loop_of
from services.reproduce.rows import Row, said

CONDITIONS = (1, 2, 3, 4)
SINGLE, FAMILY = ("thrust", "dob"), ("medob", "vibration", "load_side")
_SOURCE = "section 4.2.3"
Found = dict[str, Comparison]


@dataclass(frozen=True, slots=True, kw_only=True)
class MillingStudy:
    """Every condition on machine A, each with one thing changed from the reference condition.

    Attributes
    ----------
    cuts
        Condition -> the cut in the reference condition.
    reference, half_mass, soft
        Condition -> estimator -> what it made of it: exact, with half the mass, with half the stiffness.
    compensated, late, thrust_late
        The same in a loop with its dead times: all compensated, none, and error ratio with T1 only.
    counted
        With both encoders in counts.
    """

    cuts: dict[int, AxisCut]
    reference: dict[int, Found]
    half_mass: dict[int, Found]
    soft: dict[int, dict[str, float]]
    compensated: dict[int, Found]
    late: dict[int, Found]
    thrust_late: dict[int, dict[str, float]]
    counted: dict[int, Found]


def study_milling() -> MillingStudy:
    """Cut every condition."""
    named = drive_of("machine-a")
    pair = FAMILY[:2]
    study = MillingStudy(
        cuts={}, reference={}, half_mass={}, soft={}, compensated={}, late={}, thrust_late={}, counted={}
    )
    for number in CONDITIONS:
        cut, found = compare(named, number, names=(*SINGLE, *FAMILY))
        study.cuts[number], study.reference[number] = cut, _by_name(found)
        study.half_mass[number] = _by_name(compare(named, number, mass_error=0.5, names=pair)[1])
        cut_late, found = compare(named, number, lags=True, names=pair)
        study.compensated[number] = _by_name(found)
        study.late[number] = _by_name(compare(named, number, lags=True, compensation=False, names=pair)[1])
        study.counted[number] = _by_name(compare(named, number, sensors="real", lags=False, names=pair)[1])
        partly = {name: believed(named, counts=False) for name in pair}
        study.thrust_late[number] = {
            name: _ratio(cut_late, study.compensated[number][name], name, drive, "thrust")
            for name, drive in partly.items()
        }
        weak = believed(named, lags=False, counts=False, factors={"screw_stiffness": 0.5})
        study.soft[number] = {name: _ratio(cut, study.reference[number][name], name, weak, "full") for name in pair}
    return study


def _by_name(found: list[Comparison]) -> Found:
    return {one.name: one for one in found}


def _rest(cut: AxisCut) -> slice:
    return slice(round(cut.rate_hz / cut.spindle_hz), None)


def _ratio(cut: AxisCut, right: Comparison, name: str, drive: object, compensation: str) -> float:
    """Return the error ratio of an estimator that believes something else, against the reference of the right one."""
    observer = linear_observer(name, drive, cut.rate_hz, compensation=compensation)  # pyright: ignore[reportArgumentType]
    found = observer.update(cut.motor_m, cut.stage_m, cut.thrust_n)
    rest = _rest(cut)
    return float(np.std(found[rest] - right.reference_n[rest]) / np.std(right.reference_n[rest]))


def harmonics(cut: AxisCut, values: Floats, orders: range) -> Floats:
    """Return the amplitudes of harmonics of tooth passing after the first revolution (N), shape (orders,)."""
    rest = values[_rest(cut)]
    turn = np.exp(-2j * np.pi * cut.tooth_pass_hz / cut.rate_hz * np.outer(orders, np.arange(rest.size)))
    return 2.0 * np.abs(turn @ rest) / rest.size


def milling_rows(study: MillingStudy) -> list[Row]:
    """Return the table of error ratios and what the section states of each figure."""
    return [*_ratios(study), *_spectra(study), *_errors(study), *_lag(study), *_count(study), *_machine_b()]


def _ratios(study: MillingStudy) -> list[Row]:
    rows: list[Row] = []
    for number in CONDITIONS:
        found, what = study.reference[number], f"condition {number}: error over force"
        for name, values in (("thrust", independent.MILLING_THRUST), ("dob", independent.MILLING_DOB)):
            expected = values[number]
            rows.append(checked(f"{_SOURCE}, Table 4-2", f"{what}, {name}", expected, found[name].error_ratio,
                                within=0.2 * expected))  # fmt: skip
        most = independent.MILLING_TWO_ENCODER
        rows += [bounded(f"{_SOURCE}, Table 4-2", f"{what}, {name}", most, found[name].error_ratio) for name in FAMILY]
        expected = independent.MILLING_HALF_MASS[number]
        rows += [
            checked(f"{_SOURCE}, Fig. 4-13", f"{what}, {name}, mass times 0.5", expected, one.error_ratio,
                    within=0.2 * expected)
            for name, one in study.half_mass[number].items()
        ]  # fmt: skip
        times = study.late[number]["medob"].error_ratio / study.compensated[number]["medob"].error_ratio
        rows.append(exceeds(f"{_SOURCE}, Fig. 4-14", f"condition {number}: MEDOB without over with compensation",
                            independent.MILLING_DELAYS, times))  # fmt: skip
    return rows


def _spectra(study: MillingStudy) -> list[Row]:
    rows: list[Row] = []
    orders = range(1, 13)
    cut, found = study.cuts[1], study.reference[1]
    true = harmonics(cut, found["medob"].reference_n, orders)
    shown = true > 0.02 * true.max()
    high = shown & (cut.tooth_pass_hz * np.array(orders) > 200.0) & (cut.tooth_pass_hz * np.array(orders) < 400.0)
    gain = {name: harmonics(cut, found[name].estimate_n, orders) / true for name in ("medob", "thrust", "dob")}
    source = f"{_SOURCE}, Fig. 4-10"
    dob, thrust = float(gain["dob"][high].min()), float(gain["thrust"][high].max())
    medob = float(np.abs(gain["medob"] - 1.0)[shown].max())
    rows += [
        said(source, "condition 1, DOB: least gain of the harmonics from 200 to 400 Hz", "overestimated, > 1", dob,
             dob > 1.2, why="above 1.2"),
        said(source, "condition 1, MEDOB: largest error of a harmonic's amplitude", "captures all components", medob,
             medob < 0.05, why="5 % of it, of all above 2 % of the strongest"),
        said(source, "condition 1, thrust: largest gain of the same harmonics", "underestimated, < 1", thrust,
             thrust < 1.0, why="below 1"),
    ]  # fmt: skip
    rest = _rest(cut)
    swing = float(np.ptp(found["thrust"].estimate_n[rest]) / np.ptp(found["thrust"].reference_n[rest]))
    rows.append(said(f"{_SOURCE}, Fig. 4-8", "condition 1: amplitude of the thrust over that of the force",
                     "approximately equal", swing, abs(swing - 1.0) < 0.25, why="25 %, peak to peak"))  # fmt: skip
    for number in (3, 4):
        amplitude = harmonics(study.cuts[number], study.cuts[number].force_n, range(1, 7))
        most = float(amplitude[1:].max() / amplitude[0])
        rows.append(said(f"{_SOURCE}, Fig. 4-12", f"condition {number}: largest other harmonic over tooth passing",
                         "only DC and tooth passing", most, most < 0.01, why="1 %"))  # fmt: skip
    return rows


def _errors(study: MillingStudy) -> list[Row]:
    found = study.reference
    apart = found[3]["dob"].error_ratio
    rest = _rest(study.cuts[1])
    rigid = found[1]["dob"]
    high = float(np.abs(rigid.estimate_n[rest]).max() / np.abs(rigid.reference_n[rest]).max())
    rows = [
        said(f"{_SOURCE}, Fig. 4-9", "condition 1, DOB: largest value over that of the force", "overestimated, > 1",
             high, high > 1.1, why="above 1.1"),
        said(f"{_SOURCE}, Fig. 4-12", "condition 3, DOB: error over force", "little difference to MEDOB", apart,
             apart < 0.1, why="below 10 %"),
    ]  # fmt: skip
    for name in SINGLE:
        times = found[2][name].error_ratio / found[1][name].error_ratio
        rows.append(said(f"{_SOURCE}, Fig. 4-11", f"{name}: error in condition 2 over 1", "larger, > 1", times,
                         times > 1.0, why="three times the speed"))  # fmt: skip
    for fast, slow in ((2, 1), (4, 3)):
        times = study.half_mass[fast]["medob"].error_ratio / study.half_mass[slow]["medob"].error_ratio
        rows.append(said(f"{_SOURCE}, Fig. 4-13", f"mass times 0.5: error in condition {fast} over condition {slow}",
                         "particularly at higher speed, > 1", times, times > 2.0, why="at least twice"))  # fmt: skip
    wrong = {
        "stiffness times 0.5": study.soft[1]["vibration"],
        "mass times 0.5": study.half_mass[1]["vibration"].error_ratio,
        "dead times": study.late[1]["vibration"].error_ratio,
        "counts": study.counted[1]["vibration"].error_ratio,
    }
    worst = max(wrong, key=lambda name: wrong[name])
    listed = ", ".join(f"{name} {value:.2f}" for name, value in wrong.items())
    rows.append(said("section 5.2.2, Fig. 5-11", "vibration mode, condition 1: what weighs most", "stiffness", worst,
                     worst == "stiffness times 0.5", why=f"error over force: {listed}"))  # fmt: skip
    return rows


def _lag(study: MillingStudy) -> list[Row]:
    rows: list[Row] = []
    for number in CONDITIONS:
        partly, slot = study.thrust_late[number]["medob"], number > 2
        why = "a quarter of the force parts what can be estimated from what cannot"
        rows.append(said(f"{_SOURCE}, Fig. 4-14", f"condition {number}: MEDOB with T1 only, error over force",
                         "can be estimated" if slot else "not sufficient", partly, (partly < 0.25) == slot,
                         why=why))  # fmt: skip
    for number in (1, 2):
        ratio = study.late[number]["vibration"].error_ratio / study.late[number]["medob"].error_ratio
        rows.append(said("section 5.2.2", f"condition {number}, no compensation: vibration mode over MEDOB",
                         "less influential, < 1", ratio, ratio < 0.5, why="error below half"))  # fmt: skip
    return rows


def _count(study: MillingStudy) -> list[Row]:
    rows: list[Row] = []
    for number in (1, 2):
        cut, one = study.cuts[number], study.counted[number]["medob"]
        exact = study.reference[number]["medob"]
        noise = one.estimate_n - exact.estimate_n
        rest = _rest(cut)
        air = np.abs(exact.reference_n[rest]) < 0.02 * np.abs(exact.reference_n).max()
        part = float(np.std(noise[rest][air]) / np.std(exact.reference_n[rest]))
        rows.append(said(f"{_SOURCE}, Fig. 4-15", f"condition {number}, 17 bit encoder: noise in air over the force",
                         "remarkable", part, part > 0.05, why="more than 5 %"))  # fmt: skip
        other = study.counted[number]["vibration"].estimate_n - study.reference[number]["vibration"].estimate_n
        ratio = float(np.std(other[rest]) / np.std(noise[rest]))
        rows.append(said("section 5.2.2", f"condition {number}, 17 bit encoder: noise of the vibration mode over MEDOB",
                         "less influential, < 1", ratio, ratio < 0.5, why="below half"))  # fmt: skip
    return rows


def _machine_b() -> list[Row]:
    """Return what the tests on machine B state of single lines: linear, so the gain at the line is enough."""
    named = drive_of("machine-b")
    rate = named.settings.sample_rate_hz
    drive = believed(named, counts=False)

    def gain(name: str, hz: float, mass: float = 1.0) -> complex:
        observer = linear_observer(
            name, believed(named, counts=False, factors={"stage_mass": mass}), rate, cutoff_hz=500.0
        )
        return complex(response_of(observer, drive, [hz], control=loop_of(named), sample_rate_hz=rate)[0])

    tooth, second, fast = 2.0 * 1000.0 / 60.0, 2.0 * 2.0 * 4000.0 / 60.0, 2.0 * 10000.0 / 60.0
    slow_apart = abs(gain("dob", tooth) - gain("medob", tooth))
    near, far = abs(gain("medob", 2.0 * tooth, 1.5) - 1.0), abs(gain("medob", fast, 1.5) - 1.0)
    over = abs(gain("dob", second))
    much = abs(gain("dob", fast))
    right = abs(gain("medob", fast))
    why = "measured there; here the gain of the estimate at the line, in the loop"
    return [
        said("section 4.3.2, Fig. 4-19", "machine B, 33 Hz (1000 1/min): DOB beside MEDOB", "no significant difference",
             slow_apart, slow_apart < 0.05, why=f"5 %; {why}"),
        said("section 4.3.2, Fig. 4-20", "machine B, 267 Hz (4000 1/min, second harmonic): DOB", "overestimated, > 1",
             over, over > 1.1, why=f"above 1.1; {why}"),
        said("section 4.3.2, Fig. 4-21", "machine B, 333 Hz (10000 1/min): DOB", "much higher, > 1", much, much > 2.0,
             why=f"above 2; {why}"),
        said("section 4.3.2, Fig. 4-21", "machine B, 333 Hz (10000 1/min): MEDOB", "can be monitored", right,
             abs(right - 1.0) < 0.05, why=f"5 %; {why}"),
        said("section 4.3.3, Fig. 4-25", "machine B, mass times 1.5 at 67 Hz (2000 1/min): error", "little influence",
             near, near < 0.1, why=f"10 %; {why}"),
        said("section 4.3.3, Fig. 4-25", "the same at 333 Hz (10000 1/min)", "non-negligible", far, far > 0.3,
             why=f"30 %; {why}"),
    ]  # fmt: skip
