"""What there is to check of LinuxCNC without one: INI, HAL, mapping, and the bridge against pins of our own."""

import functools
import json
import math
import os
import runpy
from importlib.resources import files

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pitch import offset_from_slides, slide_set_points, turret_offset
from services.config import load_case
from services.errors import InputError
from services.machines.adapters import Choice, check_choice
from services.machines.linuxcnc import control
from services.machines.linuxcnc.folder import compose, init_folder, missing_lines
from services.machines.linuxcnc.link import Row
from services.machines.linuxcnc.settings import load_settings
from services.machines.linuxcnc.trace import Trace, judge_trace, read_trace
from tests.services.hal_kit import Hal, Linuxcnc

BRIDGE = runpy.run_path(str(files("services.machines.linuxcnc") / "bridge.py"))


@functools.cache
def case():
    return load_case("thesis-652")


@pytest.fixture
def folder(tmp_path):
    init_folder(tmp_path / "lathe", case())
    return tmp_path / "lathe"


def change(folder, old, new, name="lathe.ini"):
    text = (folder / name).read_text()
    assert old in text
    (folder / name).write_text(text.replace(old, new))


def test_what_is_written_can_be_read(folder):
    settings = load_settings(folder)
    assert (settings.first.letter, settings.second.letter, settings.feed) == ("X", "Y", "Z")
    assert settings.angle == pytest.approx(case().drives.axis_angle)
    assert settings.first.high_mm == pytest.approx(1.2)
    assert settings.second.speed_mm_per_s == pytest.approx(40.0)
    assert missing_lines(settings) == []
    settings.fit(case())
    with pytest.raises(InputError, match="not overwritten"):
        init_folder(folder, case())


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("OFFSET_AV_RATIO = 0.2\n", "", "OFFSET_AV_RATIO must be given"),
        ("OFFSET_AV_RATIO = 0.2", "OFFSET_AV_RATIO = 0", "OFFSET_AV_RATIO must be above 0"),
        ("OFFSET_AV_RATIO = 0.2", "OFFSET_AV_RATIO = 1.5", "at most 0.9"),
        ("OFFSET_AV_RATIO = 0.2", "OFFSET_AV_RATIO = much", "OFFSET_AV_RATIO must be a number"),
        ("OFFSET_AV_RATIO = 0.2", "OFFSET_AV_RATIO = nan", "must be a finite number"),
        ("AXIS_1 = X", "AXIS_1 = W", "one of the axes of"),
        ("AXIS_1 = X", "AXIS_1 = Y", "three different axes"),
        ("SIGN_1 = 1", "SIGN_1 = 2", "1 or -1"),
        ("ANGLE_DEG = 45", "ANGLE_DEG = 2", "nearly parallel"),
        ("LINEAR_UNITS = mm", "LINEAR_UNITS = inch", "must be mm"),
        ("trivkins coordinates=XYZ", "scarakins", "trivkins"),
        ("LOW_1_MM = -1.2000", "LOW_1_MM = 0.1", "both sides of 0"),
        ("MIN_LIMIT = -200\n", "MIN_LIMIT = 198\n", "wider than"),
        ("WATCHDOG_S = 0.2", "WATCHDOG_S = 20", "at most 1 s"),
        ("[ANTIPHASE]", "[OTHER]", "a section of"),
    ],
)
def test_a_wrong_or_missing_key_has_its_sentence(folder, old, new, sentence):
    change(folder, old, new)
    with pytest.raises(InputError, match=sentence):
        load_settings(folder)


def test_no_ini_file_is_said(tmp_path):
    with pytest.raises(InputError, match="antiphase linuxcnc init"):
        load_settings(tmp_path)


def test_axes_too_slow_for_the_path_are_refused(folder):
    change(folder, "MAX_VELOCITY = 200", "MAX_VELOCITY = 10")
    with pytest.raises(InputError, match="what the path of the shift needs"):
        load_settings(folder).fit(case())


def test_what_is_missing_in_the_hal_is_named(folder):
    change(folder, "net fault latch.out", "net other latch.out", "antiphase.hal")
    assert "net fault latch.out => not-fault.in motion.feed-inhibit sampler.0.pin.7" in missing_lines(
        load_settings(folder)
    )
    with pytest.raises(InputError, match="1 lines are missing, first: net fault latch.out"):
        check_choice(Choice(adapter="linuxcnc", folder=folder), case())
    (folder / "drives.hal").unlink()
    assert "drives.hal" in missing_lines(load_settings(folder))[0]


def test_a_control_whose_parent_was_killed_is_known_to_end_by_itself():
    assert control.orphaned(b"PATH=/bin\0ANTIPHASE_PARENT=999999999\0LANG=C\0")
    assert not control.orphaned(b"ANTIPHASE_PARENT=%d\0" % os.getpid())
    assert not control.orphaned(b"PATH=/bin\0")


def test_there_must_be_a_control_to_attach_to(folder, monkeypatch):
    monkeypatch.setattr(control, "installed", str)
    monkeypatch.setattr(control, "_tasks", list)
    assert "no LinuxCNC is running: start it with `linuxcnc" in control.absent(load_settings(folder))
    monkeypatch.setattr(control, "_tasks", lambda: ["milltask"])
    assert control.absent(load_settings(folder)) == ""


@pytest.mark.parametrize("angle_deg", [30.0, 45.0, 90.0])
def test_every_target_of_the_planner_fits_into_the_bounds(tmp_path, angle_deg):
    init_folder(tmp_path, case(), angle_deg)
    settings = load_settings(tmp_path)
    shift = np.linspace(-case().limits.target, case().limits.target, 41)
    slides = slide_set_points(shift, case().workpiece.cutting_diameter, case().drives.axis_angle)
    for axis, values in zip((settings.first, settings.second), settings.to_axes(*slides, math.pi / 4), strict=True):
        assert values.min() >= axis.low_mm
        assert values.max() <= axis.high_mm


@given(
    angle_deg=st.floats(20.0, 160.0), signs=st.tuples(*[st.sampled_from([1, -1])] * 2),
    x1=st.floats(-1e-3, 1e-3), y1=st.floats(-1e-3, 1e-3),
)  # fmt: skip
def test_slides_and_axes_are_two_names_of_one_place(tmp_path_factory, angle_deg, signs, x1, y1):
    settings = mapped(tmp_path_factory, angle_deg, signs)
    there = settings.to_axes(x1, y1, math.pi / 4)
    assert settings.to_slides(*there, math.pi / 4) == pytest.approx((x1, y1), abs=1e-12)
    offset = offset_from_slides(x1, y1, math.pi / 4)
    first, second = (1e-3 * sign * value for sign, value in zip(signs, there, strict=True))
    angle = math.radians(angle_deg)
    assert first + second * math.cos(angle) == pytest.approx(offset.dx1, abs=1e-12)  # what the tool sees is the same
    assert second * math.sin(angle) == pytest.approx(offset.dy1p, abs=1e-12)


def mapped(tmp_path_factory, angle_deg, signs):
    folder = tmp_path_factory.mktemp("mapped")
    for name, text in compose(case(), math.radians(angle_deg)).items():
        (folder / name).write_text(text)
    for k, sign in enumerate(signs, start=1):
        change(folder, f"SIGN_{k} = 1", f"SIGN_{k} = {sign}")
    change(folder, f"ANGLE_DEG = {angle_deg:.9g}", f"ANGLE_DEG = {angle_deg!r}")
    return load_settings(folder)


def test_a_skewed_pair_moves_round_the_bar(folder):
    settings, diameter = load_settings(folder), case().workpiece.cutting_diameter
    slides = slide_set_points(math.radians(2.0), diameter, math.pi / 4)
    first, second = settings.to_axes(*slides, math.pi / 4)
    assert (first, second) == pytest.approx((1e3 * slides[0], 1e3 * slides[1]))
    assert second == pytest.approx(1e3 * turret_offset(math.radians(2.0), diameter).dy1p * math.sqrt(2.0))


@pytest.mark.parametrize("text", ["2.8.4", "", "none", "1.0"])
def test_an_old_version_is_refused(text):
    assert "relied on from 2.9" in control.old_version(text)


@pytest.mark.parametrize("text", ["2.9.0~pre1+git20230208.f1270d6ed7", "2.10.1", "3.0"])
def test_a_new_version_will_do(text):
    assert control.old_version(text) == ""


def test_an_offset_near_a_soft_limit_has_no_room(folder):
    axis = load_settings(folder).first
    assert axis.room(0.0, 1.0) == ""
    assert "[AXIS_X]MAX_LIMIT = 200" in axis.room(198.0, 1.0)
    assert "[AXIS_X]MIN_LIMIT = -200" in axis.room(-198.0, 1.0)


class Bridge:
    """The bridge on pins of our own, and a clock that is set by hand."""

    def __init__(self, **signals):
        self.now, self.hal = 0.0, Hal(**signals)
        self.linuxcnc, self.orders = Linuxcnc(), []
        self.bridge = BRIDGE["Bridge"](self.hal, self.linuxcnc, self, 0.1, lambda: self.now)
        self.run(0.05)

    def run(self, seconds, **move):
        for k in range(round(seconds / 0.001)):
            self.now += 0.001
            if move and k % 10 == 0:
                self.tell(do="move", over_s=0.01, **move)
            self.hal.cycle()
            self.bridge.turn()

    def tell(self, **told):
        self.bridge.hear(json.dumps(told))

    def give(self, name, value):
        self.orders.append((name, value))

    def done(self):
        return 0

    def armed(self):
        self.tell(do="arm")
        self.run(0.2)
        assert self.bridge.state == "armed"
        return self


def test_the_bridge_arms_only_what_is_on_and_idle():
    rig = Bridge()
    rig.linuxcnc.interp_state = rig.linuxcnc.INTERP_WAITING
    rig.run(0.02)
    rig.tell(do="arm")
    assert (rig.bridge.state, "program runs" in rig.bridge.why) == ("refused", True)
    rig.linuxcnc.interp_state, rig.linuxcnc.enabled = rig.linuxcnc.INTERP_IDLE, False
    rig.run(0.02)
    rig.tell(do="arm")
    assert "not on" in rig.bridge.why
    assert not rig.hal.signals["arm"]


def test_a_servo_thread_that_does_not_answer_is_said():
    rig = Bridge()
    rig.hal.dead = True
    rig.tell(do="arm")
    rig.run(3.5)
    assert rig.bridge.state == "refused"
    assert "in the servo thread within 3 s" in rig.bridge.why


def test_the_path_is_played_in_a_straight_line_between_points():
    rig = Bridge().armed()
    rig.tell(do="move", x=[0.1, 0.2], y=[0.0, -0.2], over_s=0.01)
    played = []
    for _ in range(12):
        rig.run(0.001)
        played.append(rig.hal.signals["ask-1"])
    assert np.diff(played[:10]) == pytest.approx(0.02, abs=1e-9)
    assert (rig.hal.signals["ask-1"], rig.hal.signals["ask-2"]) == (0.2, -0.2)


def test_without_instructions_the_beat_stops():
    rig = Bridge().armed()
    rig.run(0.3, x=[0.1], y=[0.0])
    assert rig.hal.silence <= 2
    rig.run(0.3)
    assert 150 <= rig.hal.silence <= 250  # 0.1 s later
    rig.run(0.1, x=[0.1], y=[0.0])
    assert rig.hal.silence <= 2


def test_the_first_instruction_after_arming_may_take_as_long_as_any_other():
    rig = Bridge()
    rig.tell(do="arm")
    while rig.bridge.state != "armed":
        rig.run(0.001)
    rig.run(0.09)
    assert rig.hal.silence <= 2
    rig.run(0.2)
    assert rig.hal.silence >= 150


def test_orders_are_passed_on_and_a_wrong_one_is_rejected():
    rig = Bridge()
    rig.tell(do="control", name="load", value="turn.ngc")
    rig.tell(do="control", name="jump")
    assert rig.orders == [("load", "turn.ngc")]
    assert rig.bridge.rejected == 1


def test_a_trip_stops_the_beat_whatever_is_said():
    rig = Bridge().armed()
    rig.tell(do="trip")
    rig.run(0.2, x=[0.1], y=[0.0])
    assert rig.hal.silence >= 190


@given(st.lists(st.text() | st.floats().map(repr) | st.none().map(repr), max_size=4))
def test_nonsense_moves_nothing_and_is_no_sign_of_life(words):
    rig = nonsensical()
    before = rig.hal.signals["ask-1"]
    for word in words:
        for line in (word, f'{{"do": "move", "x": [{word}], "y": [NaN], "over_s": 0.01}}', f'{{"do": "{word}"}}'):
            rig.bridge.hear(line)
    rig.run(0.15)
    assert rig.hal.signals["ask-1"] == before
    assert rig.bridge._heard == -math.inf


def nonsensical():
    rig = Bridge()
    rig.tell(do="arm")
    rig.run(0.1)
    return rig


def test_a_new_bridge_leaves_the_watchdog_armed_and_the_request_where_it_is():
    rig = Bridge(**{"arm": True, "ask-1": 0.4})
    assert rig.hal.signals["arm"]
    assert rig.hal.signals["ask-1"] == 0.4
    assert rig.hal.silence > 40  # it does not beat before it is armed


def test_a_hal_without_our_signals_is_refused():
    hal = Hal()
    del hal.signals["arm"]
    with pytest.raises(BRIDGE["Refused"], match=r"without antiphase.hal: it has no signal arm"):
        BRIDGE["Bridge"](hal, Linuxcnc(), None, 0.1)


def test_only_a_living_bridge_keeps_another_out():
    alive = BRIDGE["foreign"](["antiphase-1", "antiphase-999999999", "antiphase-x"])
    assert alive[0] == 1
    assert BRIDGE["foreign"](["antiphase-999999999"]) == (None, ["antiphase-999999999"])


def test_a_trace_is_judged_and_read_back(tmp_path):
    trace, applied = Trace(), 0.0
    for block in range(60):
        rows, asked = [], np.full((2, 90), 1e-4 if block >= 10 else 0.0)
        for k in range(10):
            applied += 0.2 * (asked[0, 0] - applied)
            rows.append(
                Row(10 * block + k, 0, 0, -0.03 * block, 1e3 * applied, 1e3 * applied, 0, 0, False, True, False, True)
            )
        series = np.array([[1e-3 * row.applied_1_mm for row in rows]] * 2)
        trace.add(block, rows, asked, series, asked)
    trace.write(tmp_path / "trace.csv")
    told = judge_trace(read_trace(tmp_path / "trace.csv"), {"linuxcnc": "2.9", "first_motion_ms": [3.0, 9.0, 12.0]})
    assert told["moves_linuxcnc"] == 1
    assert 0.005 < told["settled_s"][0] < 0.03
    assert told["rest_um"][0] < 1.0
    assert (told["first_motion_ms"], told["faults"], told["servo_cycles"]) == (9.0, 0, 600)
    assert judge_trace({}, {}) == {}
