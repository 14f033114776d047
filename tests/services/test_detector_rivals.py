"""The rivals on signals that leave no doubt: they are no straw men."""

import numpy as np
import pytest

from services.bench.detector.rivals import LEVELS, SCHEMES, SLIDING, SPECTRAL, TURNS
from tests.services.detector_kit import ENTRY_S, growing, listening_to, stream

TONE_HZ = 650.7
SEEN_BY = {SLIDING: 0.45, TURNS: 0.16, SPECTRAL: 0.06}
"""Within so many seconds of a tone that comes at once."""


def tone(amplitude=8.0, hertz=TONE_HZ, from_s=1.5):
    wave = amplitude * growing(0.0, hertz=hertz)
    wave[: round(from_s * 9000)] = 0.0
    return np.column_stack([wave, wave])


@pytest.mark.parametrize("name", SCHEMES)
def test_an_obvious_tone_is_found_soon_and_nothing_before(name):
    scores = SCHEMES[name](stream(force=tone()))
    before = scores.score[scores.time <= 1.5].max(initial=0.0)
    after = scores.score[(scores.time > 1.5) & (scores.time <= 1.5 + SEEN_BY[name])]
    assert after.max() > 8.0 * before
    assert LEVELS[0] < after.max() < LEVELS[-1]


@pytest.mark.parametrize(("name", "within_hz"), [(SLIDING, 1.0), (SPECTRAL, 20.0)])
def test_the_frequency_is_that_of_a_bin_beside_the_tone(name, within_hz):
    scores = SCHEMES[name](stream(force=tone()))
    assert scores.frequency_hz[scores.time > 2.6] == pytest.approx(TONE_HZ, abs=within_hz)


def test_the_sliding_dft_gives_the_amplitude_of_a_line_in_a_bin():
    made = stream(force=tone(8.0, hertz=650.0), noise=0.0, duration_s=3.0)
    scores = SCHEMES[SLIDING](made)
    assert scores.score[-1] == pytest.approx(8.0 / made.process.expected([1]), rel=1e-6)
    assert np.diff(scores.time) == pytest.approx(4.0 / 9.0)


def test_the_variance_between_revolutions_does_not_hear_what_the_spindle_repeats():
    loud = SCHEMES[TURNS](stream(force=tone(from_s=0.0)))
    forced = SCHEMES[TURNS](stream(force=tone(hertz=660.0, from_s=0.0)))  # 33 times 20 Hz
    late = forced.time > 2.0
    assert forced.score[late].max() < 0.1 * loud.score[late].min()


@pytest.mark.parametrize("name", SCHEMES)
def test_out_of_the_cut_nothing_is_said(name):
    scores = SCHEMES[name](stream(force=tone(from_s=0.0)))
    assert not scores.score[scores.time <= ENTRY_S].any()


def test_one_axis_alone_is_listened_to_when_asked():
    wave = tone()
    wave[:, 0] = 0.0
    heard = {axes: SCHEMES[SPECTRAL](stream(force=wave, of=listening_to(axes))).score.max() for axes in ("x1", "y1")}
    assert heard["y1"] > 10.0 * heard["x1"]
