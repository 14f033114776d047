"""Mass and friction of axes whose truth is known."""

import math

import numpy as np
import pytest

from chatter.identification import identify_servo

TRUTH = {"mass": 95.0, "viscous": 200.0, "coulomb": 20.0, "offset": -3.0}


def moved(rate_hz=1000.0, seconds=12.0, *, speed=0.08, count=5e-8, noise=0.5, seed=1, one_way=False, asymmetric=0.0):
    """Position (m) and thrust (N) of a rigid axis that goes to and fro at several speeds."""
    t = np.arange(int(seconds * rate_hz)) / rate_hz
    parts = [(1.0, 0.31), (0.4, 0.83), (0.15, 2.1), (0.05, 5.3)]
    x = sum(a * speed / (2 * np.pi * f) * np.sin(2 * np.pi * f * t + 7 * f) for a, f in parts)
    v = sum(a * speed * np.cos(2 * np.pi * f * t + 7 * f) for a, f in parts)
    a = sum(-b * speed * 2 * np.pi * f * np.sin(2 * np.pi * f * t + 7 * f) for b, f in parts)
    if one_way:
        x, v = x + 2.0 * speed * t, v + 2.0 * speed
    rub = (TRUTH["viscous"] + asymmetric * np.sign(v)) * v + TRUTH["coulomb"] * np.sign(v)
    thrust = TRUTH["mass"] * a + rub + TRUTH["offset"]
    thrust += noise * np.random.default_rng(seed).standard_normal(t.size)
    return (np.round(x / count) * count if count else x), thrust


@pytest.mark.parametrize(("rate", "count"), [(500.0, 1e-7), (1000.0, 5e-8), (9000.0, 1e-6), (20000.0, 4e-8)])
def test_the_truth_is_found_at_any_rate_and_with_coarse_encoders(rate, count):
    fit = identify_servo(*moved(rate, count=count), rate)
    assert fit.mass == pytest.approx(TRUTH["mass"], rel=0.01)
    assert fit.viscous == pytest.approx(TRUTH["viscous"], rel=0.03)
    assert fit.coulomb == pytest.approx(TRUTH["coulomb"], rel=0.03)
    assert fit.offset == pytest.approx(TRUTH["offset"], abs=0.3)
    assert fit.flags == ()


def test_scaling_position_or_thrust_scales_the_mass():
    x, u = moved()
    one, longer, harder = (identify_servo(*pair, 1000.0, cutoff_hz=60.0) for pair in ((x, u), (10 * x, u), (x, 2 * u)))
    assert longer.mass == pytest.approx(one.mass / 10, rel=1e-6)
    assert harder.coulomb == pytest.approx(2 * one.coulomb, rel=1e-6)
    turned = identify_servo(-x, -u, 1000.0, cutoff_hz=60.0)
    assert turned.mass == pytest.approx(one.mass, rel=1e-6)
    assert turned.offset == pytest.approx(-one.offset, rel=1e-6)


def test_friction_of_each_direction():
    fit = identify_servo(*moved(asymmetric=40.0), 1000.0)
    assert fit.forward.viscous == pytest.approx(240.0, rel=0.03)
    assert fit.backward.viscous == pytest.approx(160.0, rel=0.03)
    assert fit.asymmetric_error < 0.7 * fit.relative_error


def test_the_interval_holds_the_truth():
    held = 0
    for seed in range(20):
        fit = identify_servo(*moved(noise=8.0, seed=seed), 1000.0, cutoff_hz=50.0)
        held += abs(fit.mass - TRUTH["mass"]) <= fit.half_width[0]
    assert held >= 16


def test_one_way_does_not_tell_friction_from_offset():
    fit = identify_servo(*moved(one_way=True), 1000.0)
    assert math.isnan(fit.coulomb)
    assert math.isnan(fit.offset)
    assert fit.mass == pytest.approx(TRUTH["mass"], rel=0.02)
    assert any("one way" in flag for flag in fit.flags)


def test_constant_speed_does_not_tell_the_mass():
    t = np.arange(20000) / 1000.0
    x = 0.05 * np.abs((t / 4.0) % 2.0 - 1.0)
    v = np.where((t / 4.0) % 2.0 < 1.0, -1.0, 1.0) * 0.0125
    u = 200.0 * v + 20.0 * np.sign(v) + np.random.default_rng(1).standard_normal(t.size)
    fit = identify_servo(x, u, 1000.0)
    assert math.isnan(fit.viscous)
    assert any("one speed" in flag for flag in fit.flags)


def test_gaps_are_stepped_over():
    x, u = moved()
    x[3000:3010] = np.nan
    u[7000] = np.nan
    assert identify_servo(x, u, 1000.0).mass == pytest.approx(TRUTH["mass"], rel=0.01)


@pytest.mark.parametrize(
    ("x", "u", "rate", "rule"),
    [(np.zeros(1000), np.zeros(1000), 1000.0, "position must move"),
     (np.arange(10.0), np.zeros(10), 1000.0, "at least 200 samples"),
     (np.arange(10.0), np.zeros(9), 1000.0, "shape of position"),
     (np.arange(1000.0), np.zeros(1000), 0.0, "sample_rate_hz must be positive")],
)  # fmt: skip
def test_what_cannot_be_is_refused(x, u, rate, rule):
    with pytest.raises(ValueError, match=rule):
        identify_servo(x, u, rate)


def test_a_reversed_sign_and_swapped_channels_are_said():
    x, u = moved()
    assert any("opposite ways" in flag for flag in identify_servo(x, -u, 1000.0).flags)
    assert any("swapped" in flag for flag in identify_servo(u, x, 1000.0).flags)


def test_a_late_position_does_not_add_to_the_mass():
    x, u = moved(2000.0, noise=0.2)
    ahead = identify_servo(x[4:], u[:-4], 2000.0)
    assert ahead.dead_time == 0.0  # the thrust is late: no dead time does that
    found = identify_servo(x[:-4], u[4:], 2000.0)
    assert found.dead_time == pytest.approx(2e-3, abs=2e-4)
    given = identify_servo(x[:-4], u[4:], 2000.0, dead_time=2e-3)
    for fit in (found, given):
        assert fit.mass == pytest.approx(TRUTH["mass"], rel=0.005)
