"""Drawn cuts are what they claim to be, and programmes hold what they promise."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pitch import OneModeProcess, rightmost_root
from services.bench.detector.draw import (
    CHATTER_HZ,
    GROWTH,
    MISMATCH,
    NOISE,
    PAIR_SPACING_HZ,
    SPEED_HZ,
    onset_process,
    pair_process,
    stable_process,
)
from services.bench.detector.programme import FEEDS, KINDS, SPEEDS, conditions, programme
from turning_sim import linear_parameters

BLOCK = 90


def root(process, speed=1.0):
    cut, start = process.case.cutting, process.case.settings.start_position
    linear = linear_parameters(process.case.workpiece, cut, start)
    bar = OneModeProcess(
        linear.mass_at_tools, linear.natural_frequency_hz, linear.damping_ratio, cut.overlap, cut.process_damping
    )
    return rightmost_root(bar, cut.cutting_stiffness, speed * cut.spindle_hz, 0.0)


@pytest.mark.parametrize("number", [0, 1, 2])
def test_a_drawn_cut_grows_as_asked(number):
    process = onset_process(7, number)
    found = root(process)
    assert found.real == pytest.approx(process.growth, abs=1e-4)
    assert found.imag / (2.0 * np.pi) == pytest.approx(process.chatter_hz, abs=1e-3)
    assert GROWTH[0] <= process.growth <= GROWTH[1]
    assert CHATTER_HZ[0] <= process.chatter_hz <= CHATTER_HZ[1]
    assert SPEED_HZ[0] <= process.case.cutting.spindle_hz <= SPEED_HZ[1]
    assert NOISE[0] <= process.case.cutting.force_noise <= NOISE[1]


def test_the_drives_differ_from_what_is_believed_of_them():
    process = onset_process(7, 0)
    true, believed = process.case.drives.x1, process.case.belief.drives[0]
    assert true.stage_mass != believed.stage_mass
    assert true.stage_mass == pytest.approx(believed.stage_mass, rel=MISMATCH)
    assert true.drive_stiffness == pytest.approx(believed.screw_stiffness, rel=MISMATCH)


def test_a_draw_depends_on_seed_and_number_alone():
    assert onset_process(7, 1) == onset_process(7, 1)
    assert onset_process(7, 1) != onset_process(8, 1)
    assert onset_process(7, 1, ("quiet",)).turret == "quiet"


def test_a_stable_cut_is_stable_at_every_speed_it_meets():
    process = stable_process(7, 1, conditions("speed"))
    assert -60.0 <= process.growth <= -5.0
    assert all(root(process, speed).real < process.growth + 1.0 for speed in (0.7, 0.83, 1.0, 1.2))


def test_a_pair_has_two_roots_that_grow_alike():
    process = pair_process(7, 0)
    assert PAIR_SPACING_HZ[0] <= abs(process.rival_hz - process.chatter_hz) <= PAIR_SPACING_HZ[1]
    assert process.axes == "both"


def test_the_expected_limit_follows_the_axes():
    process = dataclasses.replace(onset_process(7, 0), believed_force=5.0)
    ratio = process.case.cutting.tangential_ratio
    assert process.expected([0]) == pytest.approx(5.0)
    assert process.expected([1]) == pytest.approx(5.0 * ratio)
    assert process.expected([0, 1]) == pytest.approx(5.0 * np.hypot(1.0, ratio))


def made(kind, seed, cut_s=12.0):
    rng = np.random.default_rng(seed)
    return list(programme(kind, rng, cut_s, rate=9000.0, spindle_hz=23.0, longest_s=6.0, circumference=0.08))


@settings(max_examples=10)
@given(st.sampled_from(KINDS), st.integers(0, 1000))
def test_a_programme_is_in_the_cut_for_as_long_as_asked(kind, seed):
    pieces = made(kind, seed)
    engaged = np.concatenate([np.full(piece.samples, piece.engaged) for piece in pieces])
    assert np.count_nonzero(engaged) == 12 * 9000
    changes = np.flatnonzero(np.diff(engaged.astype(int))) + 1
    assert not (changes % BLOCK).any()
    assert all(piece.speed.shape == (piece.samples,) and piece.samples > 0 for piece in pieces)
    entered = [k for k, piece in enumerate(pieces) if piece.enter]
    assert all(pieces[k].engaged and not pieces[k - 1].engaged for k in entered)
    assert len(entered) == np.count_nonzero(np.diff(engaged.astype(int)) == 1)


@settings(max_examples=10)
@given(st.integers(0, 1000))
def test_each_kind_does_what_its_name_says_and_nothing_else(seed):
    of = {kind: made(kind, seed, 30.0) for kind in KINDS}
    speeds = {kind: np.concatenate([piece.speed for piece in pieces]) for kind, pieces in of.items()}
    assert SPEEDS[0] <= speeds["speed"].min() < speeds["speed"].max() <= SPEEDS[1]
    assert np.abs(np.diff(speeds["speed"])).max() < 1e-3  # no jumps
    assert all(np.ptp(speeds[kind]) == 0.0 for kind in KINDS if kind != "speed")
    feeds = {kind: {piece.feed for piece in pieces} for kind, pieces in of.items()}
    assert len(feeds["feed"]) > 100
    assert min(feeds["feed"]) >= FEEDS[0]
    assert max(feeds["feed"]) <= FEEDS[1]
    assert all(feeds[kind] == {1.0} for kind in KINDS if kind != "feed")
    assert {kind for kind, pieces in of.items() if any(piece.slot for piece in pieces)} == {"slots"}
    assert {kind for kind, pieces in of.items() if any(piece.knocks for piece in pieces)} <= {"knocks"}
    for piece in of["knocks"]:
        assert all(0 <= at < piece.samples and tool in (0, 1) for at, _, tool, _ in piece.knocks)


def test_slots_turn_with_the_bar_though_half_a_turn_is_no_whole_number_of_samples():
    pieces = programme(
        "slots", np.random.default_rng(1), 20.0, rate=9000.0, spindle_hz=38.571, longest_s=20.0, circumference=0.08
    )  # fmt: skip
    at, begins = 0, []
    for piece in pieces:
        begins = [at] if piece.enter else [*begins, at] if piece.engaged else begins
        at += piece.samples
    away = (np.array(begins) - begins[0]) / (0.5 * 9000.0 / 38.571)
    assert len(begins) > 300
    assert np.abs(away - np.round(away)).max() * 0.5 * 9000.0 / 38.571 <= 0.5 + 1e-9
