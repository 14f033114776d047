"""Roots with several modes: the one-mode theory, root counting and the time domain as independent judges."""

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pitch import Mode, OneModeProcess, StabilityUnresolved, TurningProcess, process_roots, roots
from tests.reference.pitch_modes import characteristic
from tests.reference.pitch_stability import count_roots
from tests.turning_sim.cases import bar
from tests.turning_sim.eigen import grow, theory
from turning_sim import ProcessModel

RAKE = math.degrees(0.015)
ACROSS = math.pi / 2
MODES = st.builds(
    Mode,
    modal_mass=st.floats(0.1, 2.0),
    natural_frequency_hz=st.floats(250.0, 900.0),
    damping_ratio=st.floats(0.01, 0.15),
    direction=st.one_of(st.sampled_from([0.0, ACROSS]), st.floats(-1.5, 1.5)),
)
PROCESSES = st.builds(
    TurningProcess,
    modes=st.lists(MODES, min_size=1, max_size=3).map(tuple),
    cutting_stiffness=st.floats(1e5, 3e6),
    tangential_stiffness=st.sampled_from([0.0, 5e5, 1.5e6]),
    overlap=st.one_of(st.just(-1.0), st.floats(0.3, 1.0)),
    tangential_overlap=st.one_of(st.none(), st.floats(0.3, 1.0)),
    process_damping=st.sampled_from([0.0, 30.0]),
    rake_gain=st.sampled_from([0.0, RAKE]),
)
SPINDLES = st.floats(15.0, 60.0)
DIFFERENCES = st.one_of(st.just(0.0), st.floats(-0.5, 0.5))


def plane_bar(position, *, bar_changes=None, **changes):
    """The usual bar, equal in both directions, as this package sees it."""
    modes = tuple(
        Mode(
            modal_mass=mode.modal_mass / mode.shape**2,
            natural_frequency_hz=mode.natural_frequency_hz,
            damping_ratio=mode.damping_ratio,
            direction=direction,
        )
        for mode in bar(**(bar_changes or {})).modes(position)
        for direction in (0.0, ACROSS)
    )
    cut = {
        "cutting_stiffness": 1.06e6, "tangential_stiffness": 1.36 * 1.06e6, "overlap": 0.859, "process_damping": 33.0
    }  # fmt: skip
    return TurningProcess(modes=modes, **(cut | changes))


def judge(process, spindle_hz, difference, *, swapped=False):
    h = difference / 2
    again = process.overlap if process.tangential_overlap is None else process.tangential_overlap
    rise = 1 + process.rake_gain * h
    force = (process.cutting_stiffness, process.tangential_stiffness)
    tools = [(h, rise * force[0], rise * force[1], process.overlap, again), (math.pi, *force, process.overlap, again)]
    delays = [(math.pi + sign * h) / (2 * math.pi * spindle_hz) for sign in ((-1, 1) if swapped else (1, -1))]
    modes = [(m.modal_mass, m.natural_frequency_hz, m.damping_ratio, m.direction) for m in process.modes]
    return partial(characteristic, modes=modes, tools=tools, damping=process.process_damping, delays=delays)


@settings(max_examples=15)
@given(
    st.floats(0.1, 2.0), st.floats(250.0, 600.0), st.floats(0.01, 0.15), st.floats(-1.0, 1.0),
    st.sampled_from([0.0, 30.0]), st.floats(0.0, 2.0), SPINDLES, DIFFERENCES, st.booleans(),
)  # fmt: skip
def test_one_mode_is_the_one_mode_process(mass, hertz, zeta, overlap, flank, share, spindle, difference, tangential):
    """Along the radius; the tangential force moves what no tool feels."""
    one = OneModeProcess(mass, hertz, zeta, overlap, flank)
    stiffness = share * mass * (2 * math.pi * hertz) ** 2
    process = TurningProcess(
        modes=(Mode(modal_mass=mass, natural_frequency_hz=hertz, damping_ratio=zeta),),
        cutting_stiffness=stiffness, tangential_stiffness=1e6 if tangential else 0.0, overlap=overlap,
        process_damping=flank, tool_turns=False,
    )  # fmt: skip
    expected = roots(one, stiffness, spindle, difference)
    assert process_roots(process, spindle, difference) == pytest.approx(expected, rel=1e-9)
    turned = replace(process, tool_turns=True)
    assert process_roots(turned, spindle, 0.0) == pytest.approx(roots(one, stiffness, spindle, 0.0), rel=1e-9)


@settings(max_examples=12)
@given(PROCESSES, SPINDLES, DIFFERENCES)
def test_no_root_lies_right_of_the_rightmost(process, spindle, difference):
    root = process_roots(process, spindle, difference, count=1)[0]
    independent = judge(process, spindle, difference)
    top = 2 * math.pi * 4000.0
    margin = 1e-3 * (1 + abs(root.real))
    assert count_roots(independent, root.real + margin, root.real + 3000.0, top) == 0
    assert count_roots(independent, root.real - margin, root.real + 3000.0, top) >= 1


@pytest.mark.parametrize("degrees", [0.0, 1.38, -1.38, 8.2])
@pytest.mark.parametrize("modes", [{}, {"damping_ratios": (0.12, 0.02)}])
def test_all_leading_roots_of_the_bar_in_two_directions(degrees, modes):
    shift = math.radians(degrees)
    found = process_roots(plane_bar(6e-3, rake_gain=RAKE, bar_changes=modes), 20.0, 2 * shift, count=4)
    expected = theory(6e-3, shift=shift, rake_gain=RAKE, bar_changes=modes).roots()[:4]
    assert found == pytest.approx(np.array(expected), rel=1e-8)


def test_the_plant_grows_by_the_root():
    """The bar in both directions, turret 1 shifted, its rake changed: cut in time, and fitted."""
    shift = math.radians(1.38)
    linear = theory(0.0, shift=shift, rake_gain=RAKE)
    plant = ProcessModel(directions=2)
    _, growth, frequency_hz = grow(plant, linear, 0.0, 0, cut_changes={"rake_gain": RAKE})
    root = process_roots(plane_bar(0.0, rake_gain=RAKE), 20.0, 2 * shift, count=1)[0]
    assert growth == pytest.approx(root.real, rel=5e-4)
    assert frequency_hz == pytest.approx(root.imag / (2 * math.pi), rel=2e-5)


@settings(max_examples=6)
@given(st.floats(0.1, 20.0), st.floats(0.0, 45e-3))
def test_shift_either_way_gives_the_same_roots(degrees, position):
    """Isotropic bar without rake."""
    process, difference = plane_bar(position), 2 * math.radians(degrees)
    ahead, behind = (process_roots(process, 20.0, sign * difference, count=4) for sign in (1, -1))
    assert ahead == pytest.approx(behind, rel=1e-9)


def test_with_rake_the_delays_cannot_be_exchanged():
    process, difference = plane_bar(0.0, rake_gain=RAKE), 2 * math.radians(1.38)
    root = process_roots(process, 20.0, difference, count=1)
    right, wrong = (abs(judge(process, 20.0, difference, swapped=s)(root)[0]) for s in (False, True))
    assert right < 1e-6 * wrong
    behind = process_roots(process, 20.0, -difference, count=1)
    assert abs(root[0].real - behind[0].real) > 0.1


def test_without_a_cut_the_modes_are_left_alone():
    process = replace(plane_bar(0.0), cutting_stiffness=0.0, tangential_stiffness=0.0, process_damping=0.0)
    found = process_roots(process, 20.0, 0.1)
    w, zeta = 2 * math.pi * process.modes[0].natural_frequency_hz, process.modes[0].damping_ratio
    assert found == pytest.approx(np.array([w * (-zeta + 1j * math.sqrt(1 - zeta**2))]), rel=1e-7)


def test_a_mode_that_no_tool_feels_keeps_its_root():
    lone = Mode(modal_mass=0.3, natural_frequency_hz=333.0, damping_ratio=0.05, direction=ACROSS)
    process = TurningProcess(modes=(lone,), cutting_stiffness=1e6, tangential_stiffness=1e6)
    w = 2 * math.pi * 333.0
    assert process_roots(process, 20.0, 0.0) == pytest.approx(
        np.array([w * (-0.05 + 1j * math.sqrt(1 - 0.05**2))]), rel=1e-9
    )


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: Mode(modal_mass=-1.0, natural_frequency_hz=1.0, damping_ratio=0.1), "modal_mass must be > 0, got -1"),
        (lambda: Mode(modal_mass=1.0, natural_frequency_hz=1.0, damping_ratio=1.0), "damping_ratio must be in"),
        (lambda: TurningProcess(modes=(), cutting_stiffness=1.0), "modes must be at least one, got \\(\\)"),
        (lambda: plane_bar(0.0, cutting_stiffness=-1.0), "cutting_stiffness must be >= 0, got -1.0"),
        (lambda: plane_bar(0.0, tangential_overlap=2.0), "tangential_overlap must be in \\[-1, 1\\], got 2.0"),
        (lambda: process_roots(plane_bar(0.0), 0.0, 0.0), "spindle_hz must be > 0, got 0.0"),
        (lambda: process_roots(plane_bar(0.0), 20.0, 7.0), "pitch_difference must be in"),
        (lambda: process_roots(plane_bar(0.0), 20.0, 0.1, 0), "count must be a whole number >= 1, got 0"),
        (lambda: process_roots(plane_bar(0.0, rake_gain=-30.0), 20.0, 0.1), "rake_gain must leave tool 1 a force"),
    ],
)
def test_bad_arguments_name_value_and_rule(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_too_slow_a_spindle_is_refused():
    with pytest.raises(StabilityUnresolved, match="waves in one delay"):
        process_roots(plane_bar(0.0), 1.0, 0.0)
