import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.reference.delay import SlowDelay
from tests.turning_sim.delays import FLANK_SPEED, NOMINAL_CUT, eigenfunction, equation, misfit, order_of, root_of
from turning_sim import ContactVibration, LinearVibration, SimulationDiverged

FLANK = {"flank_factor": 20.0, "flank_speed": FLANK_SPEED}


def vibration(e, **given):
    return ContactVibration(e, **({"nominal_cut": NOMINAL_CUT} | given))


@pytest.mark.parametrize(("shift_deg", "flank"), [(0.0, {}), (2.0, {}), (0.0, FLANK)])
def test_a_vibration_that_loses_contact_agrees_with_the_method_of_steps(shift_deg, flank):
    """Contact is lost and found, a flank touches, and the surface of both is met again, twice over."""
    e, at = equation(shift_deg), np.arange(1, 461) / 9000.0
    slow = SlowDelay(e, velocity=0.4, nominal_cut=NOMINAL_CUT, **flank).run(at)
    run = vibration(e, impulse=0.4 * e.modal_mass, **flank)
    assert misfit(run.advance(460), slow) < 1e-8
    assert run.losses >= 3


def test_small_vibrations_are_the_linear_ones():
    e = equation(1.0)
    force = 0.01 * np.random.default_rng(5).standard_normal(1800)
    run = vibration(e, impulse=1e-3, **FLANK)
    assert misfit(run.advance(1800, force), LinearVibration(e, impulse=1e-3).advance(1800, force)) < 1e-6
    assert run.losses == 0


def test_the_limit_cycle_converges_at_high_order():
    """A second of growth from 1 um into the limit cycle, with a thousand losses of contact on the way."""
    e = equation()
    past, rates = eigenfunction(root_of(e), 1e-6), np.array([4500.0, 6000.0, 9000.0])
    fine = vibration(e, past=past, sample_rate_hz=18_000.0, **FLANK)
    exact, coarse = fine.advance(18_000)[11::12], [vibration(e, past=past, sample_rate_hz=r, **FLANK) for r in rates]
    errors = [misfit(run.advance(int(r))[int(r) // 1500 - 1 :: int(r) // 1500], exact)
              for run, r in zip(coarse, rates, strict=True)]  # fmt: skip
    assert errors[-1] < 1e-8
    assert order_of(errors, rates) > 7.0
    assert fine.losses > 500
    assert 40e-6 < np.abs(exact[-200:]).max() < 70e-6


def test_lost_contact_ends_the_growth():
    e = equation()
    past = eigenfunction(root_of(e), 10e-6)
    bounded, free = vibration(e, past=past).advance(9000), LinearVibration(e, past=past).advance(9000)
    assert np.abs(bounded).max() < 6.0 * NOMINAL_CUT
    assert np.abs(free).max() > 1e3 * NOMINAL_CUT


@settings(max_examples=8)
@given(st.floats(0.1, 10.0), st.floats(0.1, 10.0))
def test_scaling_mass_and_stiffnesses_or_all_lengths_scales_the_motion(heavier, larger):
    e = equation(1.0)
    heavy = dataclasses.replace(
        e, modal_mass=heavier * e.modal_mass, cutting_stiffness=heavier * e.cutting_stiffness,
        process_damping=heavier * e.process_damping,
    )  # fmt: skip
    one = vibration(e, impulse=0.08, **FLANK).advance(450)
    run = ContactVibration(
        heavy, nominal_cut=larger * NOMINAL_CUT, impulse=0.08 * heavier * larger, flank_factor=20.0,
        flank_speed=larger * FLANK_SPEED,
    )  # fmt: skip
    assert misfit(run.advance(450) / larger, one) < 1e-7
    assert run.losses > 0


def test_the_tools_may_change_places():
    e = equation(2.0)
    mirrored = dataclasses.replace(e, delay_1=e.delay_2, delay_2=e.delay_1)
    one, other = vibration(e, impulse=0.08), vibration(mirrored, impulse=-0.08)
    assert misfit(-other.advance(900), one.advance(900)) < 1e-8


@settings(max_examples=10)
@given(st.lists(st.integers(0, 200), min_size=1, max_size=8))
def test_any_cutting_gives_the_same_numbers(cuts):
    total = sum(cuts)
    force = np.random.default_rng(1).standard_normal(total)
    start = {"past": lambda t: 1e-6 * np.cos(2000.0 * t), "impulse": 0.08, **FLANK}
    whole = vibration(equation(2.76), **start).advance(total, force)
    run, parts, first = vibration(equation(2.76), **start), [], 0
    for count in cuts:
        before = run.snapshot()
        run.advance(count)
        run.restore(before)
        parts.append(run.advance(count, force[first : first + count]))
        first += count
    assert np.array_equal(np.concatenate(parts), whole)
    assert run.sample == total


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"nominal_cut": 0.0}, "nominal_cut must be positive"),
        ({"flank_factor": -1.0}, "flank_factor must be at least 0"),
        ({"flank_speed": 0.0}, "flank_speed must be positive"),
        ({"impulse": math.inf}, "impulse must be finite"),
        ({"sample_rate_hz": 3000.0}, "sample_rate_hz must be at least 3977"),
        ({"past": lambda t: 1e-4 + 0.0 * t}, "past must be below 2.152e-05 m"),
    ],
)
def test_an_impossible_start_is_refused(given, message):
    with pytest.raises(ValueError, match=message):
        vibration(equation(), **given)


def test_impossible_steps_are_refused():
    run = vibration(equation())
    with pytest.raises(ValueError, match="samples must be at least 0"):
        run.advance(-1)
    with pytest.raises(ValueError, match=r"force must be of shape \(3,\)"):
        run.advance(3, np.zeros(2))
    with pytest.raises(ValueError, match="force must be finite"):
        run.advance(1, np.array([math.nan]))


def test_a_bar_that_flies_off_is_an_error_of_its_own():
    with pytest.raises(SimulationDiverged, match="more than a metre"):
        vibration(equation(), impulse=1e4).advance(900)
