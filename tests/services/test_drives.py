"""Named drives: every value has a unit and an origin, and every mistake a message."""

import dataclasses
import math
import re

import numpy as np
import pytest

from services.config import shipped
from services.drives import ORIGINS, drive_sections, load_drive, shipped_drives
from services.errors import InputError
from turning_sim import ServoAxis

NAMES = {"machine-a", "machine-b", "cmx-1100v", "damping-stage", "nty3-x1", "nty3-y1", "emps"}


def test_shipped_drives_are_those_of_the_contract():
    assert set(shipped_drives()) == NAMES
    assert not NAMES & set(shipped())


@pytest.mark.parametrize("name", sorted(NAMES))
def test_a_shipped_drive_runs_and_can_be_believed_in(name):
    """It follows a slow move under its own loop, and the nominal drive has the numbers of the true one."""
    named = load_drive(name)
    rate = named.settings.sample_rate_hz
    axis = ServoAxis(named.drive, named.control, rate)
    path = 1e-3 * np.minimum(np.arange(round(1.5 * rate)) / rate, 1.0)
    out = axis.advance(path, np.zeros(axis.substeps * path.size))
    # without a disturbance observer (emps) friction and load stand against M K_v K_p
    assert out.true_motor_position[-1] == pytest.approx(1e-3, abs=20e-6 if name == "emps" else 5e-6)
    nominal = named.nominal()
    assert (nominal.mass_ratio, nominal.screw_stiffness) == pytest.approx(
        (named.drive.mass_ratio, named.drive.drive_stiffness)
    )
    assert nominal.stage_delay == named.drive.stage_delay
    assert {value.split(":")[0] for value in named.origin.values()} <= set(ORIGINS)


@pytest.mark.parametrize(
    ("name", "alpha", "natural_hz"),
    [
        ("machine-a", 0.10332, 340.36),
        ("machine-b", 0.08037, 409.79),
        ("cmx-1100v", 0.2336, 111.26),
        ("damping-stage", 6.7 / 36.8, 400.54),
        ("nty3-x1", 0.1013, 129.4),
        ("nty3-y1", 0.0456, 162.7),
    ],
)
def test_numbers_of_the_drives(name, alpha, natural_hz):
    drive = load_drive(name).drive
    assert drive.mass_ratio == pytest.approx(alpha, rel=1e-3)
    omega = math.sqrt((1.0 + drive.mass_ratio) * drive.drive_stiffness / drive.stage_mass)
    assert omega / (2.0 * math.pi) == pytest.approx(natural_hz, rel=1e-3)


def test_units_are_converted_once():
    b = load_drive("machine-b")
    assert b.drive.motor_resolution == pytest.approx(5e-3 / 2**23)
    assert b.drive.thrust_delay == pytest.approx(0.2e-3)
    assert b.drive.motor_error[0].wavelength == pytest.approx(5e-3 / 512)
    assert b.drive.motor_friction.stribeck_velocity == pytest.approx(1e-3)
    assert b.control.derivative_bandwidth == 3000.0
    assert load_drive("cmx-1100v").drive.current_bandwidth == math.inf
    assert load_drive("damping-stage").drive.motor_mass == pytest.approx(36.8)
    emps = load_drive("emps").drive
    assert emps.motor_mass + emps.stage_mass == pytest.approx(95.1089, rel=1e-6)
    assert emps.motor_viscosity + emps.stage_damping == pytest.approx(203.5034, rel=1e-6)
    assert not emps.stage_encoder


def test_every_number_in_a_drive_file_says_its_unit():
    plain = {"stribeck_exponent"}
    for section in drive_sections().values():
        kinds = {f.name: str(f.type) for f in dataclasses.fields(section.kind)}
        for key, name in section.keys().items():
            if "float" in kinds[name] and name not in section.units:
                assert key.endswith("_hz") or key in plain, key


def test_belief_may_be_wrong_by_a_factor():
    named = load_drive("machine-a")
    wrong = named.nominal(stage_mass=0.5, motor_delay=0.0, screw_stiffness=1.5)
    assert (wrong.stage_mass, wrong.motor_delay, wrong.screw_stiffness) == (3.1, 0.0, 1.5 * 25.7e6)
    assert wrong.rotor_inertia == 3.8e-5
    with pytest.raises(InputError, match="factor of mass must be of one of lead, rotor_inertia"):
        named.nominal(mass=0.5)
    with pytest.raises(InputError, match="factor of stage_mass must be finite and at least 0; got nan"):
        named.nominal(stage_mass=math.nan)
    with pytest.raises(InputError, match="stage_mass must be positive"):
        named.nominal(stage_mass=0.0)


def edited(tmp_path, name, pattern, text):
    """A shipped file with the first match of a pattern replaced."""
    before = shipped_drives()[name].read_text()
    after, count = re.subn(pattern, text, before, count=1, flags=re.MULTILINE)
    assert count == 1
    path = tmp_path / "mine.toml"
    path.write_text(after)
    return str(path)


@pytest.mark.parametrize(
    ("pattern", "text", "field", "said"),
    [
        (r"^lead_mm = .*", "lead_m = 0.005", "drive.lead_m", "the unit is part of the key: lead_mm"),
        (r"^lead_mm = .*", "lead_mm = -5.0", "drive.lead_mm", "positive"),
        (r"^stage_mass_kg = 6.6", "stage_mass_kg = nan", "drive.stage_mass_kg", "finite number"),
        (r"^stage_mass_kg = 6.6", "", "drive.stage_mass_kg", "it is missing"),
        (r"^current_bandwidth.* = 5.*", "current_bandwidth_rad_per_s = -inf", "drive.current_bandwidth_rad_per_s",
         "finite number"),
        (r"^stage_encoder = true", "stage_encoder = 1", "drive.stage_encoder", "true or false"),
        (r"^thrust_delay_ms = 0.2", "thrust_delay_ms = 70.0", "drive.thrust_delay_ms", "50 ms"),
        (r"^static_n = .*", "static_n = 1.0", "drive.motor_friction.static_n", "at least coulomb"),
        (r"^static_n = .*", "statik_n = 200.0", "drive.motor_friction.statik_n", "did you mean static_n"),
        (r"^wavelength_um = 610.0", "wavelength_um = 0.0", "drive.ripple.wavelength_um", "positive"),
        (r"^\[drive.motor_friction\]", "[[drive.motor_friction]]", "drive.motor_friction", "table"),
        (r"^velocity_gain_1_per_s = 320.0", "", "control.velocity_gain_1_per_s", "it is missing"),
        (r"^sample_rate_hz = 10000.0", "sample_rate_hz = 1.0", "axis.sample_rate_hz", "in 100..1000000"),
        (r"^force_cutoff_hz = 500.0", "force_cutoff_hz = 5000.0", "axis.force_cutoff_hz", "rate / 2"),
        (r"^lead_mm = \"published.*", "", "origin.lead_mm", "given in [origin]"),
        (r"^lead_mm = \"published.*", 'lead_mm = "somebody said so"', "origin.lead_mm", "begins with one of measured"),
        (r"^lead_mm = \"published.*", 'lead_mm = "published: x"\nlaed_mm = ""', "origin.laed_mm", "origin of"),
        (r"^\[control\]", "[kontrol]", "kontrol", "one of the tables"),
        (r"^\[axis\]", "[drives]", "drives", "one of the tables"),
    ],
)  # fmt: skip
def test_a_mistake_names_key_value_and_rule(tmp_path, pattern, text, field, said):
    with pytest.raises(InputError) as caught:
        load_drive(edited(tmp_path, "machine-b", pattern, text))
    assert caught.value.field == field
    assert said in str(caught.value)


def test_a_drive_without_loops_and_with_a_coupling(tmp_path):
    text = shipped_drives()["damping-stage"].read_text().split("[control]")
    origin = "\n".join(line for line in text[1].split("\n[origin]\n")[1].splitlines() if "laboratory" not in line)
    origin = "\n".join(line for line in origin.splitlines() if "machine A" not in line or "cutoff" in line)
    extra = {"screw_inertia_kg_m2": 1e-5, "screw_damping_n_m_s_per_rad": 1e-4, "coupling_stiffness_n_per_m": 3e8,
             "coupling_damping_n_s_per_m": 100.0, "screw_resolution_nm": 38.0, "screw_delay_ms": 0.1}  # fmt: skip
    path = tmp_path / "three.toml"
    path.write_text(
        text[0] + "".join(f"{key} = {value}\n" for key, value in extra.items())
        + "[origin]\n" + origin + "\n" + "".join(f'{key} = "assumed: a test"\n' for key in extra)
    )  # fmt: skip
    named = load_drive(str(path))
    assert named.control is None
    assert (named.drive.screw_inertia, named.drive.screw_delay) == pytest.approx((1e-5, 1e-4))
    assert named.nominal().rotor_inertia == pytest.approx(1e-5 + named.drive.motor_inertia)


def test_an_unknown_drive_lists_the_known_ones_and_the_nearest():
    with pytest.raises(InputError, match="did you mean 'machine-a'"):
        load_drive("machine-aa")


def test_a_broken_file_is_refused(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text("[axis\n")
    with pytest.raises(InputError, match="readable TOML"):
        load_drive(str(path))
