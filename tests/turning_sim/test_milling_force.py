import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.reference.axis_estimates import error_ratio, estimates
from tests.turning_sim.axes import CONTROL_A, held, machine_a
from turning_sim import Milling, thesis_condition

RATE = 20e3


def turn(cut, count=4000, turns=1):
    return np.arange(count * turns) / (count * cut.spindle_hz)


def slices(cut, time, count):
    """The force by summing thin slices of the tool, each with its own lag of the helix."""
    enter, leave = cut.engagement
    total = np.zeros_like(time)
    for k in range(count):
        height = (k + 0.5) * cut.axial_depth / count
        lag = 2.0 * height * math.tan(cut.helix_angle) / cut.tool_diameter
        for tooth in range(cut.teeth):
            pitch = 2.0 * math.pi * tooth / cut.teeth
            angle = np.mod(2.0 * math.pi * cut.spindle_hz * time - pitch - lag, 2.0 * math.pi)
            chip = cut.feed_per_tooth * np.sin(angle) + cut.runout * math.cos(pitch)
            chip = np.where((angle >= enter) & (angle <= leave) & (chip > 0.0), chip, 0.0)
            push = cut.tangential_coefficient * np.cos(angle) + cut.radial_coefficient * np.sin(angle)
            total += chip * push * cut.axial_depth / count
    return total


@given(
    st.integers(1, 5), st.floats(0.05, 1.0), st.sampled_from(["down", "up"]), st.floats(1e-3, 1.0),
    st.floats(0.2, 20.0), st.floats(-0.9, 0.9),
)  # fmt: skip
@settings(max_examples=40)
def test_closed_form_of_the_helix_is_the_sum_of_slices(teeth, immersion, direction, helix, axial, runout):
    cut = dataclasses.replace(
        thesis_condition(1), teeth=teeth, radial_depth=6e-3 * immersion, direction=direction, helix_angle=helix,
        axial_depth=1e-3 * axial, runout=30e-6 * runout,
    )  # fmt: skip
    time = turn(cut, 40)
    # the slice in which a tooth enters or leaves counts as a whole
    most = 2.0 * teeth * cut.axial_depth / 200 * 60e-6 * 2620e6
    assert np.abs(cut.force(time) - slices(cut, time, 200)).max() <= most


def test_without_helix_it_is_the_force_of_one_angle():
    cut = dataclasses.replace(thesis_condition(1), runout=4e-6)
    time = turn(cut, 997)
    assert cut.force(time) == pytest.approx(slices(cut, time, 1), abs=1e-9)
    slight = dataclasses.replace(cut, helix_angle=1e-7)
    assert np.median(np.abs(slight.force(time) - cut.force(time))) < 1e-4


def test_a_slot_with_two_teeth_is_a_sinusoid_on_a_mean():
    """Thesis, section 4.2.3: DC and tooth pass only; a (c/2) [K_r + K_t sin 2 phi - K_r cos 2 phi]."""
    cut = thesis_condition(3)
    spectrum = np.abs(np.fft.rfft(cut.force(turn(cut)))) / 4000
    assert spectrum[0] == pytest.approx(0.5 * 1e-3 * 30e-6 * 820e6)
    assert 2.0 * spectrum[2] == pytest.approx(0.5 * 1e-3 * 30e-6 * math.hypot(1800e6, 820e6))
    assert np.delete(spectrum, [0, 2]).max() < 1e-3 * spectrum[0]


def test_teeth_cut_in_turn():
    cut = thesis_condition(2)
    force = cut.force(turn(cut))
    assert np.roll(force, 2000) == pytest.approx(force, abs=1e-9)
    assert (force == 0.0).mean() == pytest.approx(1.0 - 2.0 * math.acos(1.0 - 1.0 / 3.0) / (2.0 * math.pi), abs=2e-3)
    assert force.min() < -10.0  # a tooth of a down-milling cutter pulls the work along
    up = dataclasses.replace(cut, direction="up").force(turn(cut))
    assert up.max() > 10.0


def test_runout_adds_lines_of_the_spindle():
    cut = thesis_condition(3)
    line = [np.abs(np.fft.rfft(dataclasses.replace(cut, runout=r).force(turn(cut))))[1] for r in (0.0, 3e-6)]
    assert line[0] < 1e-9
    assert line[1] > 1.0


@pytest.mark.parametrize(
    ("number", "rpm", "feed"), [(1, 2000.0, 2e-3), (2, 6000.0, 6e-3), (3, 2000.0, 2e-3), (4, 6000.0, 6e-3)]
)
def test_conditions_of_table_4_2(number, rpm, feed):
    cut = thesis_condition(number)
    assert cut.spindle_hz * 60.0 == pytest.approx(rpm)
    assert cut.feed_rate == pytest.approx(feed)
    assert cut.tooth_pass_hz == pytest.approx(rpm / 30.0)


@pytest.mark.parametrize(
    ("number", "thrust", "dob", "half_mass"),
    [(1, 0.70, 0.55, 0.25), (2, 1.11, 1.73, 0.81), (3, 0.40, 0.044, 0.030), (4, 1.06, 0.54, 0.23)],
)
def test_error_ratios_of_the_simple_estimates(number, thrust, dob, half_mass):
    """Machine A in the reference condition (no dead time, no current lag, fine encoders, 20 kHz): within 20 %.

    The wanted ratios were computed apart from this code; the thesis shows the same cases in Figs. 4-8 to 4-13.
    """
    cut, drive = thesis_condition(number), machine_a().without_lags()
    block = held(drive, CONTROL_A, cut.force, rate=RATE, seconds=1.0)
    first = math.ceil(RATE / cut.spindle_hz)
    model = (drive.motor_mass, drive.motor_viscosity, drive.stage_mass, drive.stage_damping, RATE)
    found = estimates(block, *model)
    ratios = {name: error_ratio(*found[name], block.true_force, RATE, first) for name in found}
    halved = error_ratio(*estimates(block, *model, mass_error=0.5)["medob"], block.true_force, RATE, first)
    assert ratios["thrust"] == pytest.approx(thrust, rel=0.2)
    assert ratios["dob"] == pytest.approx(dob, rel=0.2)
    assert ratios["medob"] < 0.04
    assert halved == pytest.approx(half_mass, rel=0.2)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"teeth": 0}, "teeth must be at least 1, got 0"),
        ({"spindle_hz": 0.0}, "spindle_hz must be finite and positive"),
        ({"radial_depth": 7e-3}, "radial_depth must be at most tool_diameter, got 0.007"),
        ({"direction": "both"}, "direction must be 'down' or 'up', got both"),
        ({"radial_coefficient": -1.0}, "radial_coefficient must be finite and at least 0"),
        ({"helix_angle": 1.5}, r"helix_angle must be in \[0, 1.3\] rad, got 1.5"),
        ({"runout": 30e-6}, "runout must be below feed_per_tooth, got 3e-05"),
        ({"axial_depth": math.inf}, "axial_depth must be finite and positive"),
    ],
)
def test_refusals(changes, said):
    with pytest.raises(ValueError, match=said):
        dataclasses.replace(thesis_condition(1), **changes)


def test_an_unknown_condition_is_refused():
    with pytest.raises(ValueError, match="condition must be 1, 2, 3 or 4, got 5"):
        thesis_condition(5)
    assert isinstance(thesis_condition(4), Milling)
