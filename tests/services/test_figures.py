"""Figures: drawn for every way a run can end, true to the numbers, and without leaving a trace in matplotlib."""

import subprocess
import sys
from types import SimpleNamespace

import matplotlib as mpl
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.figures import FIGURES, View, detection_figure, write_detection_figure, write_figures
from services.figures.force import spectrogram_figure
from services.figures.spectrum import spectrogram
from services.figures.style import outline, spread
from services.metrics import summarize
from tests.services.synthetic import CHATTER_HZ, RATE_HZ, make_record

RUNS = {
    "not suppressed": {"calm": False, "duration_s": 3.5},
    "in air": {"duration_s": 1.0, "detected_s": None, "interrupted": True},
    "one block in the cut": {"duration_s": 2.01, "detected_s": None, "interrupted": True},
    "shorter than a spectrum": {"duration_s": 0.02, "detected_s": None, "interrupted": True},
    "empty": {"duration_s": 0.0, "detected_s": None, "interrupted": True},
}


@pytest.mark.parametrize("options", RUNS.values(), ids=RUNS.keys())
def test_every_figure_of_every_kind_of_run_can_be_drawn(options):
    record = make_record(**options)
    view = View.of(record, summarize(record))
    for draw in FIGURES.values():
        draw(view).draw_without_rendering()


def test_files_are_written_and_settings_left_alone(tmp_path):
    before = dict(mpl.rcParams)
    record = make_record(duration_s=3.0)
    written = write_figures(record, summarize(record), tmp_path / "new" / "folder")
    assert [path.stem for path in written] == list(FIGURES)
    assert all(path.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n" for path in written)
    assert dict(mpl.rcParams) == before


def test_both_spectrograms_share_one_colour_scale():
    record = make_record()
    figure = spectrogram_figure(View.of(record, summarize(record)))
    left, right = (axes.images[0].get_clim() for axes in figure.axes[:2])
    assert left == right


def test_the_spectrogram_puts_a_tone_where_it_is():
    time_s = np.arange(18000) / RATE_HZ
    tone = np.where(time_s > 1.0, 8.0 * np.sin(2 * np.pi * CHATTER_HZ * time_s), 0.0)
    picture = spectrogram(tone, RATE_HZ, (0.0, 2.0), 1200.0)
    row, column = np.unravel_index(np.argmax(picture.level_db), picture.level_db.shape)
    assert picture.frequency_hz[row] == pytest.approx(CHATTER_HZ, abs=3.0)
    assert picture.level_db[row, column] == pytest.approx(20 * np.log10(8.0), abs=0.3)
    loud = picture.time_s[picture.level_db[row] > 20 * np.log10(4.0)]
    assert loud[0] == pytest.approx(1.0, abs=0.01)


@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=6))
def test_labels_never_overlap_nor_leave_the_axes(positions):
    positions = sorted(positions)
    widths = [0.12] * len(positions)
    left = spread(positions, widths, 0.0, 1.0)
    assert left[0] >= 0.0
    assert left[-1] + 0.12 <= 1.0 + 1e-9
    assert all(b - a >= 0.12 - 1e-9 for a, b in zip(left, left[1:], strict=False))


@given(st.integers(0, 5000), st.integers(1, 300))
def test_thinning_keeps_the_extremes(size, columns):
    values = np.random.default_rng(size).standard_normal(size)
    _, low, high = outline(np.arange(size) * 1.0, values, columns)
    kept = values[: size // max(size // columns, 1) * max(size // columns, 1)]
    if kept.size:
        assert (low.min(), high.max()) == (kept.min(), kept.max())


def test_a_recording_with_episodes(tmp_path):
    rng = np.random.default_rng(4)
    sound = rng.standard_normal(40000) * 0.1
    events = [
        SimpleNamespace(start_s=0.5, end_s=1.5, frequency_hz=1067.0, kind="regenerative"),
        SimpleNamespace(start_s=3.0, end_s=9.0, frequency_hz=None, kind="forced"),
    ]
    figure = detection_figure(sound, 10000.0, verdict="chatter", events=events, band_hz=(300.0, 2000.0), title="a.wav")
    assert write_detection_figure(figure, tmp_path / "x" / "detect.png").is_file()


@pytest.mark.parametrize("size", [0, 1, 7, 300])
def test_a_recording_too_short_or_silent(size):
    figure = detection_figure(np.zeros(size), 10000.0, verdict="stable", events=[])
    figure.draw_without_rendering()


def test_numbers_and_words_need_no_matplotlib():
    code = "import sys, services.metrics, services.report; sys.exit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
