"""Modes of hammer tests whose truth is known."""

import numpy as np
import pytest

from chatter.identification import find_taps, frf_of_taps, modes_of
from tests.chatter.hammer_tests import pulse, ringing

RATE = 2560.0
MODES = [(80.0, 0.012, 4.0), (83.0, 0.010, 5.0), (240.0, 0.02, 2.0), (612.0, 0.008, 1.0), (618.0, 0.009, 1.5)]
SHAPES = np.array([[1.0, 0.4], [0.6, -1.0], [1.0, 0.8], [-0.7, 1.0], [1.0, 0.5]])


def recorded(taps=3, noise=0.02, seed=1, seconds=2.0, bounce=()):
    rng = np.random.default_rng(seed)
    n, forces, rings = int(seconds * RATE), [], []
    for k in range(taps):
        force = pulse(n, RATE, 100, height=500.0 + 100.0 * k)
        if k in bounce:
            force += pulse(n, RATE, 190, height=200.0)
        rings.append(ringing(force, RATE, MODES, SHAPES) + noise * rng.standard_normal((n, 2)))
        forces.append(force + 0.1 * rng.standard_normal(n) + 0.5)
    return np.concatenate(forces), np.concatenate(rings)


def nearest(fit, hz):
    return min(fit.modes, key=lambda mode: abs(mode.frequency_hz - hz))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_every_mode_is_found_and_no_other(seed):
    taps = find_taps(*recorded(seed=seed), RATE)
    fit = modes_of(frf_of_taps(taps))
    assert len(taps.start) == 3
    assert len(fit.modes) == len(MODES), [m.frequency_hz for m in fit.modes]
    for f, zeta, _ in MODES:
        mode = nearest(fit, f)
        assert mode.frequency_hz == pytest.approx(f, rel=1e-3)
        assert mode.damping_ratio == pytest.approx(zeta, rel=0.05)
        assert abs(mode.frequency_hz - f) < 6 * mode.frequency_std_hz + 2e-4 * f
        assert mode.coherence > 0.9


def test_a_single_tap_has_no_coherence_and_says_so():
    taps = find_taps(*recorded(taps=1), RATE)
    fit = modes_of(frf_of_taps(taps))
    assert all(mode.coherence is None for mode in fit.modes)
    assert any("no coherence" in note for note in fit.notes)
    for f, _, _ in MODES:
        assert nearest(fit, f).frequency_hz == pytest.approx(f, rel=2e-3)


def test_double_hits_are_left_out():
    taps = find_taps(*recorded(taps=4, bounce=(1,)), RATE)
    assert len(taps.start) == 3
    assert len(taps.doubled) == 1
    assert "double hits" in taps.notes[0]
    every = find_taps(*recorded(taps=2, bounce=(0, 1)), RATE)
    assert len(every.start) == 2
    assert "no other" in every.notes[0]


def test_noise_has_no_modes():
    rng = np.random.default_rng(5)
    n = int(2.0 * RATE)
    force = np.concatenate([pulse(n, RATE, 100) for _ in range(4)])
    fit = modes_of(frf_of_taps(find_taps(force, rng.standard_normal((4 * n, 2)), RATE)))
    assert not fit.modes


@pytest.mark.parametrize("seed", range(4))
def test_structures_drawn_at_random(seed):
    """Modes over one and a half decades, two of them just wider apart than their width: all found, none invented."""
    rng = np.random.default_rng(200 + seed)
    rate, n = 5120.0, 10240
    hz = np.sort(np.exp(rng.uniform(np.log(60.0), np.log(1600.0), 6)))
    hz[1] = 1.03 * hz[0]
    modes = list(zip(hz, rng.uniform(0.004, 0.012, 6), rng.uniform(0.5, 5.0, 6), strict=True))
    shapes = rng.uniform(0.3, 1.0, (6, 2)) * rng.choice([-1.0, 1.0], (6, 2))
    force = pulse(n, rate, 60, width_s=4e-4)
    ring = ringing(force, rate, modes, shapes)
    noisy = [ring + 0.01 * ring.std() * rng.standard_normal(ring.shape) for _ in range(3)]
    fit = modes_of(frf_of_taps(find_taps(np.tile(force, 3), np.concatenate(noisy), rate)))
    found = np.array([mode.frequency_hz for mode in fit.modes])
    assert all(np.abs(found - f).min() < 0.003 * f for f in hz)
    assert all(np.abs(hz - f).min() < 0.01 * f for f in found)


def test_frequency_and_damping_do_not_depend_on_units_or_sign():
    force, ring = recorded()
    one = modes_of(frf_of_taps(find_taps(force, ring, RATE)))
    other = modes_of(frf_of_taps(find_taps(-force / 4.448, ring / 9.80665, RATE)))
    for a, b in zip(one.modes, other.modes, strict=True):
        assert a.frequency_hz == pytest.approx(b.frequency_hz, rel=1e-6)
        assert a.damping_ratio == pytest.approx(b.damping_ratio, rel=1e-4)


def test_without_taps_there_is_nothing():
    with pytest.raises(ValueError, match="force must hold taps"):
        find_taps(np.random.default_rng(1).standard_normal(4000), np.zeros((4000, 1)), RATE)
    with pytest.raises(ValueError, match="force must have 64 samples"):
        find_taps(np.full(100, np.nan), np.zeros((100, 1)), RATE)
