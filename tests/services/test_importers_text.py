"""Tables as people's programs write them: where the numbers begin, what they are called, how fast they came."""

import contextlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.errors import InputError
from services.importers.load import load_recording
from services.importers.vocabulary import is_time, rate_from, split_unit

RATE = 25600.0
COUNT = 800
TIME = np.arange(COUNT) / RATE
ONE, TWO = np.sin(2 * np.pi * 1000 * TIME), 0.1 * np.cos(50 * TIME)


def rows(form, *columns):
    return "\n".join(form.format(*values) for values in zip(*columns, strict=True))


def comma(text):
    return text.replace(".", ",")


PAIR = rows("{:.8f},{:.5f}", TIME, ONE)
TWO_SIGNALS = rows("{:.5f},{:.5f}", ONE, TWO)
MIDNIGHT = [f"23:59:59.{int(s * 1e6) + 990000:06d}" if s < 0.01 else f"00:00:00.{int(s * 1e6) - 10000:06d}"
            for s in TIME]  # fmt: skip
TOLD = {
    "percent": "% fs = 25600\n% first cut\nacc,force\n" + TWO_SIGNALS,
    "hash and blanks": "# Sampling rate: 25600 Hz\n# ch1 ch2\n" + rows("{:.5f} {:.5f}", ONE, TWO),
    "a table of settings": "Sample Rate (kHz),25.6\nChannels,2\nCH0,CH1\n" + TWO_SIGNALS,
    "a period": "dt;3,90625E-5\nX;Y\n" + comma(rows("{:.5f};{:.5f}", ONE, TWO)),
    "below its name": "X,CH1,Start,Increment\nSequence,V,0,3.90625e-5\n" + rows("{:d},{:.5f},,", range(COUNT), ONE),
    "saved by numpy": "# time_s acc_g\n" + rows("{:.18e} {:.18e}", TIME, ONE),
    "a row of units": "Time,Acc X\ns,m/s^2\n" + PAIR,
    "units in brackets": "Time,Channel A\n(ms),(mV)\n\n" + rows("{:.8f},{:.5f}", 1e3 * TIME, ONE),
    "slash before the unit": "t/s,F/N\n" + PAIR,
    "no header but time": PAIR,
    "decimal comma": "Zeit [s];Beschl. X [g]\n" + comma(rows("{:.8f};{:.5f}", TIME, ONE)),
    "decimal comma and tab": "t\tA\n" + comma(rows("{:.8f}\t{:.5f}", TIME, ONE)),
    "decimal comma and blanks": "t A\n" + comma(rows("{:.8f} {:.5f}", TIME, ONE)),
    "separator stated": "sep=;\nTime;A\n" + rows("{:.8f};{:.5f}", TIME, ONE),
    "in quotes": '"Time","A"\n' + rows('"{:.8f}","{:.5f}"', TIME, ONE),
    "trailing separator": "time_s,a,\n" + rows("{:.8f},{:.5f},", TIME, ONE),
    "an index": ",time,a\n" + rows("{:d},{:.8f},{:.5f}", range(COUNT), TIME, ONE),
    "time named X": "X,CH1\n" + PAIR,
    "two clocks": "Time - A,A,Time - B,B\n" + rows("{:.8f},{:.5f},{:.8f},{:.5f}", TIME, ONE, TIME, TWO),
    "dates": "timestamp,a\n" + rows("{},{:.5f}", [f"2024-03-01T12:00:{s:09.6f}" for s in TIME], ONE),
    "German dates": "Datum;a\n" + rows("{};{:.5f}", [f"01.03.2024 12:00:{s:09.6f}" for s in TIME], ONE),
    "past midnight": "Time,a\n" + rows("{},{:.5f}", MIDNIGHT, ONE),
    "nanoseconds since 1970": "timestamp,a\n" + rows("{:d},{:.5f}", [int(1.7e18 + s * 1e9) for s in TIME], ONE),
    "seconds since 1970": "time,a\n" + rows("{:.6f},{:.5f}", 1.7e9 + TIME, ONE),
    "a coarse clock": "timestamp,a\n" + rows("{:.4f},{:.5f}", TIME, ONE),
    "five digits, as MATLAB writes": "t,a\n" + rows("{:.5g},{:.5f}", 9.98 + TIME, ONE),
    "words below": "time_s,a\n" + PAIR + "\nEnd of file\n",
    "cut in a row": ("time_s,a\n" + PAIR)[:-9],
    "a column of words": "t,a,label\n" + rows("{:.8f},{:.5f},{}", TIME, ONE, ["chatter"] * COUNT),
    "rows twice": "time_s,a\n" + rows("{:.8f},{:.5f}", np.repeat(TIME, 2), np.repeat(ONE, 2)),
}  # fmt: skip


def written(tmp_path, text, encoding="utf-8"):
    path = tmp_path / "table.csv"
    path.write_bytes(text.encode(encoding))
    return path


@pytest.mark.parametrize("name", TOLD)
def test_the_file_tells_its_rate(tmp_path, name):
    recording = load_recording(written(tmp_path, TOLD[name]))
    assert recording.rate_hz == pytest.approx(RATE, rel=2e-4)
    assert len(recording.samples) in (COUNT, COUNT - 1)
    assert recording.samples[:50, 0] == pytest.approx(ONE[:50], abs=1e-5)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "latin-1"])
def test_letters_of_other_countries(tmp_path, encoding):
    text = "Zeit [s];Beschl. [m/s²];Temp [°C]\n" + comma(rows("{:.8f};{:.5f};{:.5f}", TIME, ONE, TWO))
    recording = load_recording(written(tmp_path, text, encoding))
    assert recording.names == ("Beschl.", "Temp")
    assert recording.units == ("m/s²", "°C")


HEADLESS = {
    "two columns": (TWO_SIGNALS, ("ch0", "ch1")),
    "one column": (rows("{:.5f}", ONE), ("ch0",)),
    "an index": (rows("{:d},{:.5f}", range(COUNT), ONE), ("ch1",)),
    "time": (PAIR, ("ch1",)),
    "numbers for names": ("0,1\n" + rows("{:.5f},{:.5f}", ONE, TWO), ("0", "1")),
}


@pytest.mark.parametrize("name", HEADLESS)
def test_columns_without_names_need_a_rate(tmp_path, name):
    text, names = HEADLESS[name]
    path = written(tmp_path, text)
    recording = load_recording(path, RATE)
    assert recording.names == names
    assert recording.rate_hz == pytest.approx(RATE, rel=1e-6)
    assert len(recording.samples) == COUNT
    if name != "time":
        with pytest.raises(InputError, match="rate-hz must be given.*neither"):
            load_recording(path)


def test_what_was_repaired_is_said(tmp_path):
    said = {name: load_recording(written(tmp_path, TOLD[name])).notes for name in TOLD}
    assert "steps from 0.0001 s" in said["a coarse clock"][0]
    assert "800 rows repeat the row before" in said["rows twice"][0]
    assert "the last line is not whole" in said["cut in a row"][0]
    assert said["a row of units"] == ()


def test_a_stated_rate_that_the_stamps_deny(tmp_path):
    recording = load_recording(written(tmp_path, "# fs = 51200\ntime_s,a\n" + PAIR))
    assert recording.rate_hz == pytest.approx(RATE)
    assert "51200 Hz" in recording.notes[0]
    recording = load_recording(written(tmp_path, "# fs = 25600\ntime,a\n" + rows("{:.6f},{:.5f}", 1e3 * TIME, ONE)))
    assert recording.rate_hz == pytest.approx(RATE), "then the stamps are milliseconds"
    with pytest.raises(InputError, match="stated in"):
        load_recording(written(tmp_path, "# fs = 25600\na,b\n" + TWO_SIGNALS), rate_hz=44100.0)


@pytest.mark.parametrize(
    ("name", "value", "unit", "rate_hz"),
    [
        ("fs", 25600.0, "", 25600.0), ("Fs", 8e3, "", 8e3), ("SamplingRate", 51.2, "kHz", 51200.0),
        ("sample_rate_hz", 1e4, "", 1e4), ("Sample Rate (kS/s)", 10.0, "", 1e4), ("acc_fs", 1600.0, "", 1600.0),
        ("dt", 1e-3, "", 1e3), ("Ts", 0.1, "ms", 1e4), ("wf_increment", 2e-5, "", 5e4), ("rate", 1e3, "", 1e3),
        ("feed_rate", 300.0, "", None), ("heart rate", 60.0, "", None), ("fs", -1.0, "", None), ("gain", 3.0, "", None),
        ("temperature", 20.0, "", None), ("fs", float("nan"), "", None),
    ],
)  # fmt: skip
def test_names_of_rates(name, value, unit, rate_hz):
    found = rate_from(name, value, unit)
    assert found == (None if rate_hz is None else pytest.approx(rate_hz))


def test_names_of_time_and_units():
    assert all(map(is_time, ("t", "Time (s)", "time_ms", "timestamp", "Zeit [s]", "Data1_time_AI_1", "Time - V0")))
    assert not any(map(is_time, ("torque", "temp", "acc_t1", "x", "")))
    assert split_unit("acc_x") == ("acc_x", "")
    assert split_unit("acc_m_s2") == ("acc", "m_s2")
    assert split_unit("force x [N]") == ("force x", "N")
    assert split_unit("data[3]") == ("data[3]", "")


@given(st.binary(max_size=200), st.sampled_from([".csv", ".mat", ".h5", ".wav", ".txt"]))
def test_no_bytes_make_a_traceback(tmp_path_factory, content, ending):
    path = tmp_path_factory.mktemp("any") / f"bad{ending}"
    path.write_bytes(content)
    with contextlib.suppress(InputError):
        assert load_recording(path, 100.0).samples.size > 0


@given(st.text("0123456789.,;-eE \n\tabx\"'#:/", max_size=120))
def test_no_text_makes_a_traceback(tmp_path_factory, content):
    path = tmp_path_factory.mktemp("any") / "bad.csv"
    path.write_text(content)
    with contextlib.suppress(InputError):
        assert load_recording(path, 100.0).samples.size > 0
