import dataclasses
import math
import os
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.reference.delay import SlowDelay
from tests.turning_sim.delays import NOMINAL_CUT, eigenfunction, equation, misfit, order_of, root_of
from turning_sim import ContactVibration, DelayEquation, LinearVibration, SimulationDiverged

RATE = 9000.0


def times(samples, rate=RATE):
    return np.arange(1, samples + 1) / rate


@settings(max_examples=25)
@given(
    shift_deg=st.floats(-8.0, 8.0),
    stiffness=st.floats(1e5, 2e6),
    overlap=st.floats(0.2, 1.0),
    spindle=st.floats(0.6, 2.0),
    rate=st.sampled_from([9000.0, 10_000.0, 13_579.0]),
)
def test_a_run_stays_on_the_eigenfunction_of_the_linear_theory(shift_deg, stiffness, overlap, spindle, rate):
    """Growth and frequency from `pitch`, which knows nothing of this solver: 0.3 s, some 200 waves."""
    usual = equation(shift_deg)
    e = dataclasses.replace(
        usual, cutting_stiffness=stiffness, overlap=overlap, delay_1=usual.delay_1 / spindle,
        delay_2=usual.delay_2 / spindle,
    )  # fmt: skip
    past = eigenfunction(root_of(e))
    samples = round(0.3 * rate)
    moved = LinearVibration(e, sample_rate_hz=rate, past=past).advance(samples)
    assert misfit(moved, past(times(samples, rate))) < 1e-7


def test_ten_seconds_are_true_to_eight_digits_and_more():
    e = equation()
    past = eigenfunction(root_of(e))
    moved = LinearVibration(e, past=past).advance(90_000)
    assert misfit(moved, past(times(90_000))) < 1e-10


@pytest.mark.parametrize("shift_deg", [0.0, 2.0])
def test_every_start_agrees_with_the_method_of_steps(shift_deg):
    """A blow out of rest, and a past that the equation did not make: their breaks are passed on by the delays."""
    e, at = equation(shift_deg), times(420)
    blow = LinearVibration(e, impulse=0.02 * e.modal_mass).advance(420)
    assert misfit(blow, SlowDelay(e, velocity=0.02).run(at)) < 1e-9
    swing = LinearVibration(e, past=lambda t: 1e-6 * np.sin(3000.0 * t + 0.3)).advance(420)
    slow = SlowDelay(e, past=lambda t: 1e-6 * math.sin(3000.0 * t + 0.3), velocity=3e-3 * math.cos(0.3)).run(at)
    assert misfit(swing, slow) < 1e-8


def test_a_force_between_samples_is_the_line_through_them():
    e, at = equation(1.0), times(360)
    force = np.random.default_rng(3).standard_normal(360)
    moved = LinearVibration(e, sample_rate_hz=4.0 * RATE).advance(
        1440, np.interp(times(1440, 4.0 * RATE), np.append(0.0, at), np.append(0.0, force))
    )[3::4]
    assert misfit(LinearVibration(e).advance(360, force), moved) < 1e-4
    smooth = SlowDelay(e, force=lambda t: 5.0 * math.sin(500.0 * t)).run(at)
    rates, errors = np.array([9000.0, 18_000.0, 36_000.0]), []
    for rate in rates:
        each = int(rate // RATE)
        moved = LinearVibration(e, sample_rate_hz=rate).advance(
            360 * each, 5.0 * np.sin(500.0 * times(360 * each, rate))
        )
        errors.append(misfit(moved[each - 1 :: each], smooth))
    assert order_of(errors, rates) == pytest.approx(2.0, abs=0.1)


def test_the_order_of_the_past_is_that_of_its_polynomial():
    e = equation()
    past, rates = eigenfunction(root_of(e)), np.array([4400.0, 5000.0, 5600.0])
    errors = [
        misfit(LinearVibration(e, sample_rate_hz=r, past=past).advance(round(2.0 * r)), past(times(round(2.0 * r), r)))
        for r in rates
    ]
    assert order_of(errors, rates) > 18.0


def test_a_wrong_sign_or_a_rounded_delay_is_seen():
    e = equation(2.0)
    past, at = eigenfunction(root_of(e)), times(1800)
    rounded = dataclasses.replace(e, delay_1=round(e.delay_1 * RATE) / RATE, delay_2=round(e.delay_2 * RATE) / RATE)
    assert misfit(LinearVibration(e, past=past).advance(1800), past(at)) < 1e-10
    for wrong in (rounded, dataclasses.replace(e, overlap=-e.overlap)):
        assert misfit(LinearVibration(wrong, past=past).advance(1800), past(at)) > 0.05


@given(st.floats(0.01, 100.0))
def test_mass_and_stiffnesses_together_change_nothing(factor):
    e = equation(1.5)
    heavy = dataclasses.replace(
        e, modal_mass=factor * e.modal_mass, cutting_stiffness=factor * e.cutting_stiffness,
        process_damping=factor * e.process_damping,
    )  # fmt: skip
    light = LinearVibration(e, impulse=1e-3).advance(900)
    assert misfit(LinearVibration(heavy, impulse=1e-3 * factor).advance(900), light) < 1e-10


def test_the_delays_may_change_places():
    e = equation(2.76)
    mirrored = dataclasses.replace(e, delay_1=e.delay_2, delay_2=e.delay_1)
    one, other = (LinearVibration(each, impulse=1e-3).advance(2000) for each in (e, mirrored))
    assert misfit(one, other) < 1e-12


def test_without_regeneration_the_bar_rings_off():
    e = equation(overlap=0.0)
    sigma = 0.5 * (e.damping + 2.0 * e.process_damping) / e.modal_mass
    omega = math.sqrt((e.stiffness + 2.0 * e.cutting_stiffness) / e.modal_mass - sigma**2)
    at = times(900)
    exact = 1e-3 / (e.modal_mass * omega) * np.exp(-sigma * at) * np.sin(omega * at)
    assert misfit(LinearVibration(e, impulse=1e-3).advance(900), exact) < 1e-12


@settings(max_examples=20)
@given(st.lists(st.integers(0, 400), min_size=1, max_size=12), st.booleans())
def test_any_cutting_gives_the_same_numbers(cuts, forced):
    total = sum(cuts)
    force = np.random.default_rng(1).standard_normal(total) if forced else None
    start = {"past": lambda t: 1e-6 * np.cos(2000.0 * t), "impulse": 1e-4}
    whole = LinearVibration(equation(2.76), **start).advance(total, force)
    run, parts, first = LinearVibration(equation(2.76), **start), [], 0
    for count in cuts:
        before = run.snapshot()
        run.advance(count, np.ones(count))
        run.restore(before)
        parts.append(run.advance(count, None if force is None else force[first : first + count]))
        first += count
    assert np.array_equal(np.concatenate(parts), whole)
    assert run.sample == total


def test_a_run_goes_on_from_its_samples():
    e = equation(2.76)
    whole = LinearVibration(e, impulse=1e-3).advance(4000)
    rest = LinearVibration(e, past=whole[:3000]).advance(1000)
    assert misfit(rest, whole[3000:]) < 1e-10


def test_growth_beyond_all_numbers_is_an_error_of_its_own():
    with pytest.raises(SimulationDiverged, match="range of numbers"):
        LinearVibration(equation(), past=eigenfunction(root_of(equation()))).advance(250_000)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"modal_mass": 0.0}, "modal_mass must be positive, got 0.0"),
        ({"natural_frequency_hz": math.nan}, "natural_frequency_hz must be positive"),
        ({"damping_ratio": -0.1}, "damping_ratio must be at least 0"),
        ({"cutting_stiffness": math.inf}, "cutting_stiffness must be at least 0"),
        ({"overlap": 1.1}, r"overlap must be in \[-1, 1\]"),
        ({"delay_2": 0.0}, "delay_2 must be positive"),
    ],
)
def test_an_impossible_equation_is_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        equation(**changes)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"sample_rate_hz": 3000.0}, "sample_rate_hz must be at least 3977"),
        ({"sample_rate_hz": math.inf}, "sample_rate_hz must be at least"),
        ({"past": np.zeros(100)}, "past must be at least 237 samples"),
        ({"past": np.full(400, np.nan)}, "past must be finite"),
        ({"past": lambda _: 0.0}, "past must be a function of an array of times"),
        ({"impulse": math.nan}, "impulse must be finite"),
    ],
)
def test_an_impossible_start_is_refused(given, message):
    with pytest.raises(ValueError, match=message):
        LinearVibration(equation(), **given)


def test_impossible_steps_are_refused():
    run = LinearVibration(equation())
    with pytest.raises(ValueError, match="samples must be at least 0"):
        run.advance(-1)
    with pytest.raises(ValueError, match=r"force must be of shape \(3,\)"):
        run.advance(3, np.zeros(2))
    with pytest.raises(ValueError, match="force must be finite"):
        run.advance(1, np.array([math.inf]))
    with pytest.raises(ValueError, match="shift must be within half a turn"):
        DelayEquation.of_cut(None, 20.0, 4.0)


def test_the_kernels_give_the_same_without_the_compiler():
    code = (
        "from tests.turning_sim.delays import *; from turning_sim import ContactVibration, LinearVibration\n"
        "print(LinearVibration(equation(2.0), impulse=1e-3).advance(60)[-1].hex())\n"
        "print(ContactVibration(equation(2.0), impulse=0.06, nominal_cut=NOMINAL_CUT).advance(60)[-1].hex())"
    )
    plain = subprocess.run(
        [sys.executable, "-c", code], env=os.environ | {"NUMBA_DISABLE_JIT": "1"}, capture_output=True, text=True,
        check=True,
    ).stdout.split()  # fmt: skip
    linear = LinearVibration(equation(2.0), impulse=1e-3).advance(60)[-1]
    contact = ContactVibration(equation(2.0), impulse=0.06, nominal_cut=NOMINAL_CUT).advance(60)[-1]
    assert [float.fromhex(line) for line in plain] == pytest.approx([linear, contact], rel=1e-9)
