"""Foresight: its roots are roots, its judgement is that of the processes that explain what was seen."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pitch import OneModeProcess, PlannerConfig, ProcessBelief, roots
from pitch.foresight import Foresight, growth_at, strongest_roots
from tests.reference.pitch_foresight import strongest as twin
from tests.reference.pitch_stability import characteristic

CONFIG = PlannerConfig(
    sample_rate_hz=9000.0, max_shift=math.radians(18), max_order=1, x1_travel=(-6e-3, 6e-3), y1_travel=(-6e-3, 6e-3)
)
BAR = ProcessBelief(
    modal_mass=0.205, natural_frequency_hz=421.0, damping_ratio=0.12, cutting_stiffness=1.06e6, overlap=0.859,
    process_damping=33.0,
)  # fmt: skip
WORTH = 0.05 * math.pi * 20.0 / 1300.0


def as_process(belief):
    return OneModeProcess(
        belief.modal_mass, belief.natural_frequency_hz, belief.damping_ratio, belief.overlap, belief.process_damping
    )


@given(
    natural=st.floats(250.0, 700.0), damping=st.floats(0.02, 0.12), ratio=st.floats(0.1, 0.8),
    overlap=st.floats(0.5, 1.0), speed=st.floats(10.0, 50.0), shift=st.floats(0.0, 0.25),
)  # fmt: skip
def test_the_strongest_root_is_that_of_collocation(natural, damping, ratio, overlap, speed, shift):
    belief = dataclasses.replace(
        BAR, natural_frequency_hz=natural, damping_ratio=damping, overlap=overlap,
        cutting_stiffness=ratio * 0.205 * (2 * math.pi * natural) ** 2,
    )  # fmt: skip
    growth, hertz = growth_at(belief, np.array([shift]), speed)
    found = roots(as_process(belief), belief.cutting_stiffness, speed, 2 * shift, count=40)
    of_bar = found[found.imag > 0.97 * 2 * math.pi * natural]
    if of_bar.size and of_bar[0].real > -15.0:
        assert growth[0] == pytest.approx(of_bar[0].real, abs=1e-5)
    s = complex(growth[0], 2 * math.pi * hertz[0])
    left = characteristic(s, 0.205, natural, damping, overlap, 33.0, belief.cutting_stiffness, speed, 2 * shift)
    assert abs(left) < 1e-6 * belief.cutting_stiffness


@given(
    natural=st.floats(250.0, 700.0), damping=st.floats(0.02, 0.12), ratio=st.floats(0.1, 0.8),
    overlap=st.floats(0.5, 1.0), speed=st.floats(10.0, 50.0), shift=st.floats(0.0, 0.25),
)  # fmt: skip
def test_the_kernel_is_its_plain_twin(natural, damping, ratio, overlap, speed, shift):
    m, w = 0.205, 2 * math.pi * natural
    k = m * w**2
    row = np.array([[m, 2 * damping * m * w + 60.0, k, overlap, ratio * k]])
    found = strongest_roots(row, np.array([shift]), speed)[0]
    growth, omega = twin(*row[0], speed, shift)
    if growth > -15.0:
        assert found[0] == pytest.approx(growth, abs=1e-5)
        assert found[1] == pytest.approx(omega, rel=1e-6) or abs(found[0] - growth) < 1e-6


def test_the_nearest_line_is_a_root_too():
    rows = np.repeat(BAR.nominal()[None, :], 2, axis=0)
    found = strongest_roots(rows, np.zeros(2), 20.0, 612.0)
    assert found[0, 3] / (2 * math.pi) == pytest.approx(612.0, abs=8.0)
    assert found[0, 2] <= found[0, 0] + 1e-9
    assert np.array_equal(found[0], found[1])


def test_what_was_heard_tells_the_processes_apart():
    sight = Foresight(BAR, CONFIG)
    growth, hertz = growth_at(BAR, np.zeros(1), 20.0)
    one = sight.weights([(0.0, float(hertz[0]))], 20.0)
    assert one is not None
    assert growth[0] > 0.0
    assert one.sum() == pytest.approx(1.0)
    assert 1.0 / (one**2).sum() < 0.7 * one.size
    moved = sight.weights([(0.0, float(hertz[0])), (0.03, float(growth_at(BAR, np.array([0.03]), 20.0)[1][0]))], 20.0)
    assert moved is not None
    assert 1.0 / (moved**2).sum() < 1.0 / (one**2).sum()


def test_a_belief_that_explains_nothing_is_not_used():
    assert Foresight(BAR, CONFIG).weights([(0.0, 1400.0)], 20.0) is None
    assert Foresight(BAR, CONFIG).weights([], 20.0) is None


def test_the_best_shift_silences_the_true_process():
    sight = Foresight(dataclasses.replace(BAR, natural_frequency_hz=428.0, cutting_stiffness=0.9e6), CONFIG)
    _, hertz = growth_at(BAR, np.zeros(1), 20.0)
    weight = sight.weights([(0.0, float(hertz[0]))], 20.0)
    assert weight is not None
    best = sight.best(weight, float(hertz[0]), 20.0, 0.025, [0.0], WORTH)
    assert best is not None
    assert best.candidate.order == 0
    assert growth_at(BAR, np.array([best.candidate.shift]), 20.0)[0][0] < -5.0
    again = sight.best(weight, float(hertz[0]), 20.0, 0.025, [0.0, best.candidate.shift], WORTH)
    assert again is not None
    assert abs(again.candidate.shift - best.candidate.shift) >= WORTH


def test_no_room_leaves_a_speed_to_advise():
    tight = dataclasses.replace(CONFIG, max_shift=math.radians(3.4), max_order=0)
    weight = Foresight(BAR, tight).weights([(0.0, float(growth_at(BAR, np.zeros(1), 30.0)[1][0]))], 30.0)
    assert weight is not None
    assert Foresight(BAR, tight).speed(weight, 650.0, 30.0, 0.025) is not None


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("modal_mass", 0.0, "modal_mass must be > 0, got 0.0"),
        ("natural_frequency_hz", -5.0, "natural_frequency_hz must be > 0"),
        ("damping_ratio", 1.0, "damping_ratio must be in \\(0, 1\\), got 1.0"),
        ("overlap", 1.5, "overlap must be in \\[0, 1\\], got 1.5"),
        ("process_damping", -1.0, "process_damping must be >= 0, got -1.0"),
        ("stiffness_error", 1.0, "stiffness_error must be in"),
        ("mass_ratio", 0.5, "mass_ratio must be in"),
        ("cutting_stiffness", math.nan, "cutting_stiffness must be finite"),
    ],
)
def test_a_bad_belief_names_value_and_rule(field, value, message):
    with pytest.raises(ValueError, match=message):
        dataclasses.replace(BAR, **{field: value})
