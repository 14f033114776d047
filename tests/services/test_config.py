"""Case files: every mistake has a message that names the key, the value and the rule."""

import dataclasses
import math
import tomllib

import msgspec
import pytest

from services import messages, sections
from services.config import load_case, shipped
from services.errors import InputError
from services.units import has_unit

PLAIN = ("ratio", "exponent", "factor", "overlap", "per_minute", "hysteresis", "damping_ratios",
         "sensitivity")
UNITLESS_MESSAGE_FIELDS = {"confidence", "indicator", "limit", "in_cut"}


@pytest.mark.parametrize("name", list(shipped()))
def test_every_shipped_case_loads(name):
    case = load_case(name)
    assert case.name == name
    assert case.limits.target >= case.planner.max_shift
    assert 0.5 * case.limits.shift_speed >= case.path.max_speed * 0.999


def test_shipped_cases_are_those_of_the_contract():
    assert set(shipped()) == {"thesis-652", "thesis-738", "thesis-depth-02", "thesis-depth-03", "quiet", "drift"}


def test_units_are_converted_once():
    case = load_case("thesis-652")
    assert case.workpiece.length == pytest.approx(0.160)
    assert case.cutting.spindle_hz == pytest.approx(20.0)
    assert case.drives.x1.stage_resolution == pytest.approx(1e-9)
    assert case.drives.axis_angle == pytest.approx(math.pi / 4)
    assert case.cutting.rake_gain == pytest.approx(0.015 * 180 / math.pi)
    assert case.planner.fallback_phases == pytest.approx((0.85 * math.pi, 1.1 * math.pi))


def test_every_number_in_a_case_file_says_its_unit():
    for section in sections.known_sections().values():
        for key, name in section.keys().items():
            kinds = {f.name: str(f.type) for f in dataclasses.fields(section.kind)}
            if "float" in kinds[name] and name not in section.units:
                assert key.endswith("_hz") or any(word in key for word in PLAIN), key


def test_every_float_in_a_message_says_its_unit():
    for kind in (*messages.TOPICS.values(),):
        for field in msgspec.structs.fields(kind):
            if field.type in (float, messages.Floats) and field.name not in UNITLESS_MESSAGE_FIELDS:
                assert has_unit(field.name), f"{kind.__name__}.{field.name}"


def write(tmp_path, text):
    path = tmp_path / "mine.toml"
    path.write_text('extends = "thesis-652"\n' + text)
    return str(path)


def test_a_file_may_change_single_values(tmp_path):
    case = load_case(write(tmp_path, "[workpiece]\nlength_mm = 150.0\n"))
    assert case.workpiece.length == pytest.approx(0.150)
    assert case.digest != load_case("thesis-652").digest


@pytest.mark.parametrize(
    ("text", "field", "said"),
    [
        ("[workpiece]\nlenght_mm = 150.0\n", "workpiece.lenght_mm", "did you mean length_mm"),
        ("[workpiece]\nlength_m = 0.15\n", "workpiece.length_m", "the unit is part of the key: length_mm"),
        ("[workpiece]\nlength = 0.15\n", "workpiece.length", "the unit is part of the key: length_mm"),
        ("[workpiece]\nlength_mm = -1.0\n", "workpiece.length_mm", "-1.0"),
        ('[workpiece]\nlength_mm = "long"\n', "workpiece.length_mm", "finite number"),
        ("[workpiece]\nlength_mm = nan\n", "workpiece.length_mm", "finite number"),
        ("[workpiece]\nlength_mm = inf\n", "workpiece.length_mm", "finite number"),
        ("[workpiece]\nlength_mm = true\n", "workpiece.length_mm", "finite number"),
        ("[case]\nseed = 1.5\n", "case.seed", "whole number"),
        ("[case]\nseed = -1\n", "case.seed", "0 or more"),
        ('[case]\nmachine = "lathe/1"\n', "case.machine", "letters"),
        ("[case]\nsample_rate_hz = 9050.0\n", "case.sample_rate_hz", "multiple of 100"),
        ("[cutting]\noverlap = 2.0\n", "cutting.overlap", "[-1, 1]"),
        ("[monitor]\nband_hz = [750.0, 500.0]\n", "monitor.band_hz", "low < high"),
        ("[monitor]\nband_hz = [500.0]\n", "monitor.band_hz", "list of 2 numbers"),
        ('[limits]\non_loss = "jump"\n', "limits.on_loss", "'hold', 'return'"),
        ("[limits]\nfreeze_out_of_cut = 1\n", "limits.freeze_out_of_cut", "true or false"),
        ("[monitor]\nband_hz = [500.0, 5000.0]\n", "monitor.band_hz", "below case.sample_rate_hz / 2 (4500)"),
        ("[monitor]\nband_hz = [500.0, 4500.0]\n", "monitor.band_hz", "below case.sample_rate_hz / 2 (4500)"),
        ("[limits]\ntarget_deg = 0.9\n", "planner.max_shift_deg", "at most limits.target_deg (0.9)"),
        ("[planner]\ny1_travel_mm = [-1.0, 2.5]\n", "planner.y1_travel_mm", "at most limits.y1_mm (1.7)"),
        ("[planner]\nx1_travel_mm = [-2.5, 1.0]\n", "planner.x1_travel_mm", "at most limits.x1_mm (1.2)"),
        ("[limits]\ndwell_s = 5.0\n", "limits.dwell_s", "at most planner.dwell_s (1)"),
        ("[belief.process]\ndamping_ratio = 1.5\n", "belief.process.damping_ratio", "in (0, 1)"),
        ("[belief.process]\nmodal_mass_kg = -1.0\n", "belief.process.modal_mass_kg", "> 0"),
        ("[path]\nmax_speed_deg_per_s = 90.0\n", "path.max_speed_deg_per_s", "at most limits.shift_speed_deg_per_s"),
        ("[nonsense]\nx = 1\n", "nonsense", "one of the tables"),
        ("workpiece = 3\n", "workpiece", "table"),
    ],
)
def test_a_mistake_names_key_value_and_rule(tmp_path, text, field, said):
    with pytest.raises(InputError) as caught:
        load_case(write(tmp_path, text))
    assert caught.value.field == field
    assert said in str(caught.value)


def test_a_missing_key_and_a_missing_table_are_named(tmp_path):
    full = shipped()["thesis-652"].read_text()
    path = tmp_path / "mine.toml"
    path.write_text(full.replace("length_mm = 160.0", "", 1))
    with pytest.raises(InputError, match=r"workpiece\.length_mm must be given"):
        load_case(str(path))
    path.write_text(full.split("[planner]")[0])
    with pytest.raises(InputError, match=r"planner must be given as a table"):
        load_case(str(path))


@pytest.mark.parametrize("text", ["[workpiece\n", "a = = 1\n", "\x00"])
def test_a_broken_file_is_refused(tmp_path, text):
    path = tmp_path / "mine.toml"
    path.write_text(text)
    with pytest.raises(InputError, match="readable TOML"):
        load_case(str(path))


def test_a_case_that_extends_itself_or_nothing_is_refused(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(f'extends = "{path}"\n')
    with pytest.raises(InputError, match="extend itself"):
        load_case(str(path))
    path.write_text("extends = 3\n")
    with pytest.raises(InputError, match="name of a case"):
        load_case(str(path))


def test_an_unknown_case_lists_the_known_ones_and_the_nearest():
    with pytest.raises(InputError, match=r"did you mean 'thesis-652'"):
        load_case("thesis-625")


def test_resolved_text_is_complete():
    case = load_case("thesis-738")
    assert '"turned_diameter_mm": 22.1' in case.text
    assert "extends" not in case.text
    assert set(tomllib.loads(shipped()["thesis-652"].read_text())) <= set(__import__("json").loads(case.text))


def test_every_estimator_that_a_case_may_name_exists():
    from chatter.observers.named import NAMES
    from services.case_settings import ESTIMATORS

    assert set(ESTIMATORS) == set(NAMES)
