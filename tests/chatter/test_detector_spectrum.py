"""Lines between the bins against lines that are known."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from chatter.spectrum import hann_power, pencil

RATE = 9000.0


def line(frequency_hz, seconds, growth=0.0, amplitude=1.0, phase=0.0):
    time = np.arange(round(seconds * RATE)) / RATE
    return amplitude * np.exp(growth * (time - seconds)) * np.cos(2.0 * np.pi * frequency_hz * time + phase)


@given(st.floats(450.0, 800.0), st.floats(-20.0, 40.0), st.floats(0.0, 6.28), st.floats(1e-6, 1e6))
def test_pencil_is_exact_for_one_growing_line(frequency, growth, phase, amplitude):
    found = pencil(line(frequency, 0.08, growth, amplitude, phase)[:, None], 625.0, 200.0, RATE)[0]
    assert abs(found.frequency_hz - frequency) < 0.02
    assert abs(found.growth - growth) < 0.5
    # the amplitude is that at the last baseband sample, half a kernel before the end
    assert abs(found.amplitude / amplitude - 1.0) < 0.25
    assert found.explained > 0.999


def test_pencil_tells_three_lines_40_hz_apart_within_80_ms():
    rng = np.random.default_rng(0)
    signal = line(612.0, 0.08, 25.0, 6.0) + line(651.0, 0.08, 30.0, 8.0, 1.0) + line(689.0, 0.08, 26.0, 5.0, 2.0)
    pair = np.column_stack([signal, 1.3 * signal]) + rng.normal(scale=0.5, size=(len(signal), 2))
    found = pencil(pair, 625.0, 150.0, RATE)[:3]
    assert sorted(round(x.frequency_hz) for x in found) == pytest.approx([612, 651, 689], abs=1.5)
    assert found[0].frequency_hz == pytest.approx(651.0, abs=1.0)
    assert all(10.0 < x.growth < 45.0 for x in found)


def test_pencil_reaches_the_bound_in_noise_within_a_factor():
    rng = np.random.default_rng(1)
    errors = []
    for _ in range(40):
        noisy = line(637.3, 0.08, phase=rng.uniform(0.0, 6.28))[:, None] + rng.normal(scale=0.3, size=(720, 1))
        errors.append(pencil(noisy, 625.0, 150.0, RATE)[0].frequency_hz - 637.3)
    bound = np.sqrt(6.0) / (np.pi * 0.08) * 0.3 / np.sqrt(720.0)  # Cramer-Rao for one real line, amplitude 1
    assert (
        np.std(errors) < 4.0 * bound
    )  # the kernel of the baseband costs a tenth of the stretch, three spare lines the rest
    assert abs(np.mean(errors)) < bound


def test_pencil_of_nothing_is_empty():
    assert pencil(np.zeros((720, 2)), 625.0, 150.0, RATE) == []
    assert pencil(np.ones((20, 1)), 625.0, 150.0, RATE) == []


@given(st.integers(10, 40), st.floats(0.0, 6.28), st.floats(1e-3, 1e3))
def test_hann_power_is_the_squared_amplitude_of_a_line_on_a_bin(index, phase, amplitude):
    window = 450
    signal = amplitude * np.cos(2.0 * np.pi * index * np.arange(window) / window + phase)
    bins = np.arange(5, 46)
    spectrum = np.exp(-2j * np.pi * np.outer(bins, np.arange(window)) / window) @ signal
    power = hann_power(spectrum[None, :], window)
    assert int(np.argmax(power)) + 6 == index
    assert power.max() == pytest.approx(amplitude**2, rel=1e-9)
    assert power.sum() == pytest.approx(1.5 * amplitude**2, rel=1e-9)
