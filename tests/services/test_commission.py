"""From a machine that nobody knows to one that is armed, through the real nodes in lockstep."""

import json
import math
import pathlib
from contextlib import AbstractContextManager
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.cli import app
from services.closed_loop import Loop
from services.commission import course as courses
from services.commission.course import Course
from services.commission.drives import swept
from services.commission.lockstep import Place
from services.commission.signs import check_positions, check_thrusts
from services.commission.state import Done
from services.commission.steps import NAMES, STEPS, Bench, Step, check_signs
from services.config import load_case
from services.errors import InputError, RefusalError
from services.messages import ChatterReport, MachineState, OperatorRequest, SampleBlock, Tick
from services.nodes.machine import MachineNode
from services.nodes.monitor import MonitorNode
from tests.closed_loop.test_loop import CountingClock

WRONG = """extends = "thesis-652"
[belief.x1]
stage_mass_kg = 200.0
screw_stiffness_n_per_m = 1.3e8
motor_delay_ms = 0.3
[belief.y1]
rotor_inertia_kg_m2 = 4e-3
"""


def said(_):
    """Nobody listens."""


def yes(_):
    return True


def beginning(tmp_path, text=WRONG, **changes):
    path = tmp_path / "mine.toml"
    path.write_text(text)
    out = tmp_path / "machine"
    out.mkdir(exist_ok=True)
    return Course(name=str(path), folder=out, seed=None, sweeps={}, **changes)


@pytest.fixture(scope="module")
def armed(tmp_path_factory):
    course = beginning(tmp_path_factory.mktemp("armed"))
    return course, course.answer(course.go((), yes, said))


def test_every_step_is_done_and_the_machine_is_known(armed):
    course, answer = armed
    assert [row["state"] for row in answer["steps"]] == ["done"] * len(NAMES)
    assert answer["next"] is None
    case = load_case(answer["machine"])
    for axis in ("x1", "y1"):
        belief, truth = getattr(case.belief, axis), getattr(case.drives, axis)
        pairs = {
            "rotor_inertia": "motor_inertia", "rotor_damping": "motor_damping", "stage_mass": "stage_mass",
            "stage_damping": "stage_damping", "screw_stiffness": "drive_stiffness", "screw_damping": "drive_damping",
            "motor_delay": "motor_delay", "stage_delay": "stage_delay",
        }  # fmt: skip
        for one, other in pairs.items():
            assert getattr(belief, one) == pytest.approx(getattr(truth, other), rel=0.01), (axis, one)
    text = pathlib.Path(answer["machine"]).read_text()
    assert "identified: sweep of" in text
    assert "measured: " in text
    assert course.case().digest == case.digest


def test_the_loop_works_with_the_file_and_knows_its_limits_at_once(armed):
    case = load_case(armed[1]["machine"])
    loop = Loop(case, 3, CountingClock())
    for number in range(400):
        loop.step(number)
    reports = loop.tape.of(ChatterReport)
    assert next(r for r in reports if r.in_cut).limit_source == "cutting"
    assert any(r.state == "chatter" for r in reports)
    assert all(r.state != "chatter" for r in reports[-50:])
    assert loop.tape.of(MachineState)[-1].shift_applied_deg > 2.0


def test_what_was_learned_fits_only_its_band(armed):
    case = load_case(armed[1]["machine"], {"monitor.band_hz": [450.0, 800.0]})
    with pytest.raises(InputError, match="learned must be learned with this band"):
        MonitorNode(case, "run")


def with_fault(fault):
    """A machine whose channels are changed on the way out."""

    class Faulty(AbstractContextManager):
        subscribes = MachineNode.subscribes

        def __init__(self, case, seed, run):
            self._node = MachineNode(case, seed, run)

        def __exit__(self, *_):
            """Nothing was started."""

        def prepare(self):
            self._node.prepare()

        def handle(self, message):
            for answer in self._node.handle(message):
                if isinstance(answer, SampleBlock):
                    values = {name: getattr(answer, name) for name in answer.__struct_fields__}
                    yield SampleBlock(**(values | fault(answer)))
                else:
                    yield answer

    return Faulty


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        (lambda b: {"y1_stage_position_m": -b.y1_stage_position_m}, ["y1_stage_position: is reversed"]),
        (lambda b: {"x1_motor_position_m": b.y1_motor_position_m, "y1_motor_position_m": b.x1_motor_position_m},
         ["x1_motor_position: moves like y1: swapped with it", "y1_motor_position: moves like x1: swapped with it"]),
        (lambda b: {"x1_stage_position_m": 0.0 * b.x1_stage_position_m}, ["x1_stage_position: is silent"]),
        (lambda b: {"x1_motor_position_m": 25.4 * b.x1_motor_position_m}, ["x1_motor_position: moves 25.4 times"]),
        (lambda b: {"y1_thrust_n": -b.y1_thrust_n}, ["y1_thrust: is reversed"]),
        (lambda b: {"y1_thrust_n": b.x1_thrust_n, "x1_thrust_n": b.y1_thrust_n},
         ["x1_thrust: is reversed, or both thrusts are swapped"]),
        (lambda b: {"x1_stage_position_m": -b.y1_stage_position_m},
         ["x1_stage_position: moves like y1 reversed: swapped with it and reversed"]),
    ],
)  # fmt: skip
def test_wrong_channels_are_named(fault, words):
    done = check_signs(Bench(case=load_case("thesis-652"), seed=1, sweeps={}, place=Place(make=with_fault(fault))))
    assert not done.good
    wrong = [word for word in done.words if "as it should be" not in word]
    assert all(any(found.startswith(word) for found in wrong) for word in words)
    assert len(wrong) == max(len(words), 2 if "thrusts" in words[0] else 1)


def test_an_axis_that_hardly_moves_is_not_judged():
    travel = dict.fromkeys(("x1_motor_position", "x1_stage_position"), 0.0) | {
        "y1_motor_position": 1e-4, "y1_stage_position": math.nan,
    }  # fmt: skip
    found = check_positions(travel, {"x1": 4e-7, "y1": 1e-4})
    assert [one.wrong for one in found] == [None, None, "", "is not a number"]
    thrust = {"x1_thrust": np.ones(90), "y1_thrust": np.ones(90)}
    found = check_thrusts(thrust, thrust, {"x1": 4e-7, "y1": 1e-4})
    assert [one.wrong for one in found] == [None, "is silent, or not the thrust of this axis"]


@given(st.integers(0, 2**31))
def test_noise_has_no_sign_and_a_bias_hides_none(seed):
    """Ten thousand samples of noise, and friction of a tenth of that noise on an axis that hangs."""
    rng = np.random.default_rng(seed)
    out, back = ({f"{a}_thrust": rng.standard_normal(4500) for a in ("x1", "y1")} for _ in range(2))
    out["x1_thrust"] += 50.0 - 0.1
    back["x1_thrust"] += 50.0 + 0.1
    found = check_thrusts(out, back, {"x1": -1e-4, "y1": 1e-4})
    assert found[0].wrong == ""
    assert abs(found[1].ratio) < 0.9


def test_a_machine_that_may_not_move_in_air_says_so(tmp_path):
    course = beginning(tmp_path, 'extends = "thesis-652"\n[limits]\nfreeze_out_of_cut = true\n')
    with pytest.raises(RefusalError, match="did not make the test shift: .*out of cut"):
        course.go((), yes, said)
    assert course.answer(course.begin())["steps"][0]["state"] == "failed"


class Killed(BaseException):
    """As if the power had failed."""


def killed_at(monkeypatch, name, log):
    def do(step):
        def doing(bench):
            log.append(step.name)
            if step.name == name:
                raise Killed
            return Done(good=True, words=[step.name], values={})

        return doing

    steps = tuple(Step(name=s.name, title=s.title, moves=s.moves, do=do(s)) for s in STEPS)
    monkeypatch.setattr(courses, "STEPS", steps)


@pytest.mark.parametrize("name", NAMES)
def test_it_goes_on_where_it_was_killed(tmp_path, monkeypatch, name):
    log, words = [], []
    course = beginning(tmp_path)
    killed_at(monkeypatch, name, log)
    with pytest.raises(Killed):
        course.go((), yes, said)
    (course.folder / "commission.json.draft").write_text('{"half')
    killed_at(monkeypatch, "", log)
    answer = course.answer(course.go((), yes, words.append))
    assert log == [*NAMES[: NAMES.index(name) + 1], *NAMES[NAMES.index(name) :]]
    assert words[0] == f"{name} was interrupted; nothing of it was kept"
    assert answer["next"] is None


def test_a_step_may_be_repeated_and_what_stands_on_it_is_open_again(tmp_path, monkeypatch):
    log, value = [], [1.0]

    def do(step):
        def doing(_):
            log.append(step.name)
            values = {"belief.x1.stage_mass_kg": (250.0 * value[0], "measured")} if step.name == "identify" else {}
            return Done(good=True, words=[], values=values)

        return doing

    steps = tuple(Step(name=s.name, title=s.title, moves=s.moves, do=do(s)) for s in STEPS)
    monkeypatch.setattr(courses, "STEPS", steps)
    course = beginning(tmp_path)
    course.go((), yes, said)
    state = course.go(("identify",), yes, said)
    assert set(state.steps) == set(NAMES), "the same values: nothing is open"
    value[0] = 1.1
    state = course.go(("identify",), yes, said)
    assert list(state.steps) == ["signs", "idle", "identify"]
    assert course.case().belief.x1.stage_mass == pytest.approx(275.0)
    with pytest.raises(RefusalError, match="arm comes after quiet, dry-run, advise-only"):
        course.go(("arm",), yes, said)
    with pytest.raises(RefusalError, match="quiet was not allowed; everything before it is kept"):
        course.go((), lambda step: step.name != "quiet", said)


def test_a_guard_that_takes_its_time_to_arm_is_waited_for():
    """A request is heard after 1.2 s only; the test shift begins when the guard is armed."""

    class Slow(AbstractContextManager):
        subscribes = MachineNode.subscribes

        def __init__(self, case, seed, run):
            self._node, self._late = MachineNode(case, seed, run), None

        def __exit__(self, *_):
            """Nothing was started."""

        def prepare(self):
            self._node.prepare()

        def handle(self, message):
            if isinstance(message, OperatorRequest):
                self._late = message
                return []
            if isinstance(message, Tick) and message.block == 120:
                self._node.handle(self._late)
            return self._node.handle(message)

    done = check_signs(Bench(case=load_case("thesis-652"), seed=1, sweeps={}, place=Place(make=Slow)))
    assert done.good, done.words


def test_on_a_terminal_it_asks_before_anything_moves(tmp_path, capsys, monkeypatch):
    asked = []
    monkeypatch.setattr("sys.stdin", SimpleNamespace(isatty=lambda: True))
    monkeypatch.setattr("typer.confirm", lambda text, err: asked.append(text) or len(asked) == 1)
    code, answer = answer_of(capsys, "thesis-652", "--out", tmp_path)
    assert code == 3
    assert answer["reason"] == "idle was not allowed; everything before it is kept"
    assert [row["state"] for row in answer["steps"]][:2] == ["done", "open"]


def test_a_loud_cut_teaches_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr("services.commission.steps.QUIET_SHARE", 1.0)
    course = beginning(tmp_path, 'extends = "thesis-652"\n')
    step = STEPS[NAMES.index("quiet")]
    done = step.do(Bench(case=course.case(), seed=1, sweeps={}))
    assert not done.good
    assert "no quiet cut: it chattered at 65" in done.words[-1]


def test_a_sweep_may_come_from_a_file(tmp_path):
    case = load_case("thesis-652")
    recording, _ = swept(case, "x1", 1)
    path = tmp_path / "x1.csv"
    t = np.arange(len(recording.samples)) / recording.rate_hz
    head = "time_s,thrust_n,motor_position_m,stage_position_m"
    np.savetxt(path, np.column_stack([t, recording.samples]), delimiter=",", header=head, comments="", fmt="%.12g")
    done = STEPS[NAMES.index("identify")].do(Bench(case=case, seed=1, sweeps={"x1": path, "y1": path}))
    assert done.values["belief.x1.stage_mass_kg"][0] == pytest.approx(250.0, rel=0.01)
    assert "x1.csv" in done.values["belief.x1.stage_mass_kg"][1]
    slower = load_case("thesis-652", {"case.sample_rate_hz": 4500.0})
    with pytest.raises(InputError, match="sampled as the case says"):
        STEPS[NAMES.index("identify")].do(Bench(case=slower, seed=1, sweeps={"x1": path}))


def test_noise_for_a_sweep_is_refused(tmp_path):
    path = tmp_path / "noise.csv"
    table = np.random.default_rng(1).standard_normal((20000, 3))
    head = "thrust_n,motor_position_m,stage_position_m"
    np.savetxt(path, table, delimiter=",", header=f"# fs = 9000\n{head}", comments="", fmt="%.6g")
    with pytest.raises((InputError, RefusalError)):
        STEPS[NAMES.index("identify")].do(Bench(case=load_case("thesis-652"), seed=1, sweeps={"x1": path}))


def answer_of(capsys, *arguments):
    with pytest.raises(SystemExit) as ended:
        app.main(["commission", *map(str, arguments), "--json"])
    return ended.value.code, json.loads(capsys.readouterr().out)


@pytest.mark.parametrize(
    ("arguments", "field"),
    [
        (["quiet", "--yes"], "out"),
        (["quiet", "--out", "{out}"], "yes"),
        (["quiet", "--out", "{out}", "--yes", "--step", "dance"], "step"),
        (["quiet", "--out", "{out}", "--yes", "--sweep-x1", "nowhere.csv"], "sweep-x1"),
        (["nowhere.toml", "--out", "{out}", "--yes"], "case"),
    ],
)
def test_wrong_use_is_named(tmp_path, capsys, arguments, field):
    code, answer = answer_of(capsys, *(word.format(out=tmp_path / "out") for word in arguments))
    assert (code, answer["error"]["field"]) == (2, field)


def test_a_folder_that_is_not_its_own_is_refused(tmp_path, capsys):
    (tmp_path / "commission.json").write_text("{}")
    code, answer = answer_of(capsys, "quiet", "--out", tmp_path, "--yes")
    assert (code, answer["error"]["field"]) == (2, "out")
    kept = {"format": 1, "case": "drift", "digest": "other", "running": "", "steps": {}}
    (tmp_path / "commission.json").write_text(json.dumps(kept))
    code, answer = answer_of(capsys, "quiet", "--out", tmp_path, "--yes")
    assert (code, answer["error"]["field"]) == (2, "case")
    assert "drift" in answer["error"]["rule"]


def test_the_verb_tells_what_comes_next(tmp_path, capsys):
    code, answer = answer_of(capsys, "thesis-652", "--out", tmp_path, "--yes", "--step", "signs")
    assert code == 0
    assert answer["next"] == "idle"
    assert [row["name"] for row in answer["steps"]] == list(NAMES)
    code, answer = answer_of(capsys, "thesis-652", "--out", tmp_path, "--yes", "--step", "arm")
    assert code == 3
    assert "arm comes after idle" in answer["reason"]
