"""`identify` on people's files: names, units, swapped channels, what is refused."""

import json

import numpy as np
import pytest
from scipy.io import savemat

from services.cli import app
from services.importers.lvm import read_lvm
from services.importers.roles import role_of
from tests.chatter.hammer_tests import pulse, ringing
from tests.chatter.sweep_runs import swept

RATE = 1000.0
TIME = np.arange(6000) / RATE
MASS, VISCOUS, COULOMB, OFFSET = 40.0, 300.0, 15.0, 2.0
MODES, SHAPES = [(60.0, 0.02, 3.0), (64.0, 0.015, 2.0), (180.0, 0.01, 1.0)], np.array([[1.0], [-0.8], [0.7]])


def axis():
    """Position (m) and thrust (N)."""
    parts = [(0.05, 0.31), (0.02, 0.83), (0.008, 2.1)]
    x = sum(a / (2 * np.pi * f) * np.sin(2 * np.pi * f * TIME) for a, f in parts)
    v = sum(a * np.cos(2 * np.pi * f * TIME) for a, f in parts)
    a = sum(-b * 2 * np.pi * f * np.sin(2 * np.pi * f * TIME) for b, f in parts)
    noise = 0.3 * np.random.default_rng(1).standard_normal(TIME.size)
    return np.round(x / 1e-7) * 1e-7, MASS * a + VISCOUS * v + COULOMB * np.sign(v) + OFFSET + noise


def taps(count=2):
    n = 2048
    force = np.concatenate([pulse(n, RATE, 50, height=300.0, width_s=4e-3) for _ in range(count)])
    rings = np.concatenate([ringing(force[:n], RATE, MODES, SHAPES)] * count)
    return force, rings + 0.01 * np.random.default_rng(2).standard_normal(rings.shape)


def answer(capsys, *arguments, code=0):
    with pytest.raises(SystemExit) as left:
        app.main(["identify", *map(str, arguments), "--json"])
    said = json.loads(capsys.readouterr().out)
    assert left.value.code == code, said
    return said


def csv(path, names, columns, separator=",", comma=False):
    rows = [separator.join(f"{value:.10g}" for value in row) for row in zip(*columns, strict=True)]
    rows = [row.replace(".", ",") for row in rows] if comma else rows
    path.write_text("\n".join([separator.join(names), *rows]), encoding="utf-8")
    return path


def check_axis(said):
    assert said["mass_kg"] == pytest.approx(MASS, rel=0.01)
    assert said["viscous_n_s_m"] == pytest.approx(VISCOUS, rel=0.03)
    assert said["coulomb_n"] == pytest.approx(COULOMB, rel=0.03)
    low, high = said["interval_95"]["mass_kg"]
    assert low < said["mass_kg"] < high


def check_modes(said):
    for f, zeta, _ in MODES:
        mode = min(said["modes"], key=lambda m: abs(m["frequency_hz"] - f))
        assert mode["frequency_hz"] == pytest.approx(f, rel=2e-3)
        assert mode["damping_ratio"] == pytest.approx(zeta, rel=0.1)
    assert len(said["modes"]) == len(MODES)


def test_an_axis_in_other_units(tmp_path, capsys):
    x, u = axis()
    lead, kt = 0.01, 0.5
    torque = u * lead / (2 * np.pi)
    one = csv(tmp_path / "a.csv", ["time_s", "pos [mm]", "torque [Nm]"], [TIME, 1e3 * x, torque])
    check_axis(answer(capsys, "servo", one, "--lead-mm", 10))
    two = csv(tmp_path / "b.csv", ["t (ms)", "theta (rad)", "iq (A)"],
              [1e3 * TIME, x * 2 * np.pi / lead, torque / kt], ";", comma=True)  # fmt: skip
    check_axis(answer(capsys, "servo", two, "--lead-mm", 10, "--torque-constant", kt))
    three = csv(tmp_path / "c.csv", ["alpha", "beta"], [x * 1e6, u / 4.4482216152605])
    check_axis(
        answer(capsys, "servo", three, "--rate-hz", RATE, "--map", "alpha=position:um", "--map", "beta=thrust:lbf")
    )


def test_a_mapping_in_a_file(tmp_path, capsys):
    x, u = axis()
    path = csv(tmp_path / "c.csv", ["alpha", "beta"], [x * 1e3, u])
    said = tmp_path / "channels.toml"
    said.write_text('[channels]\nalpha = "position:mm"\nbeta = "thrust:N"\n', encoding="utf-8")
    check_axis(answer(capsys, "servo", path, "--rate-hz", RATE, "--map", said))


def test_the_gain_of_a_drive_stands_in_the_file(tmp_path, capsys):
    x, u = axis()
    path = tmp_path / "axis.mat"
    savemat(path, {"t": TIME, "qg": x + 1e-6 * TIME, "qm": x, "vir": u / 35.0, "gtau": 35.0})
    said = answer(capsys, "servo", path)
    check_axis(said)
    assert said["channels"] == {"position": "qm", "voltage": "vir"}


@pytest.mark.parametrize(
    ("names", "options", "field"),
    [(["a", "b"], [], "map"), (["pos_mm", "iq_a"], [], "gain"), (["pos_mm", "torque [Nm]"], [], "lead-mm"),
     (["pos_mm", "torque [%]"], ["--lead-mm", "5"], "gain"),
     (["pos_mm", "f_n"], ["--map", "pos=place"], "map"), (["pos_mm", "f_n"], ["--map", "zzz=thrust"], "map"),
     (["pos_mm", "f_n"], ["--map", "pos=position:furlong"], "map"), (["pos_s", "f_n"], ["--map", "pos=position"],
      "channel pos")],
)  # fmt: skip
def test_what_is_missing_is_named(tmp_path, capsys, names, options, field):
    rng = np.random.default_rng(3)
    path = csv(tmp_path / "a.csv", names, rng.standard_normal((2, 400)))
    said = answer(capsys, "servo", path, "--rate-hz", 1000, *options, code=2)
    assert said["error"]["field"] == field, said


@pytest.mark.parametrize("names", [["hammer [lbf]", "acc [g]"], ["f_n", "a_g"], ["ch A", "ch B"], ["acc_g", "force_n"]])
def test_a_hammer_test_under_any_name(tmp_path, capsys, names):
    force, rings = taps()
    said = answer(capsys, "hammer", csv(tmp_path / "taps.csv", names, [force, rings[:, 0]]), "--rate-hz", RATE)
    check_modes(said)
    assert said["taps"] == 2
    assert any("swapped" in note for note in said["notes"]) == (names[0] == "acc_g")


def lvm(path, force, rings, *, comma=False, columns="No", multi=False):
    n = len(force) // 2
    number = (lambda v: f"{v:.8g}".replace(".", ",")) if comma else (lambda v: f"{v:.8g}")
    head = ["LabVIEW Measurement\t", "Writer_Version\t2", "Separator\tTab",
            f"Decimal_Separator\t{',' if comma else '.'}", f"Multi_Headings\t{'Yes' if multi else 'No'}",
            f"X_Columns\t{columns}", "Time_Pref\tAbsolute",
            "***End_of_Header***\t", "\t"]  # fmt: skip
    own = ["Channels\t2\t\t", f"Samples\t{n}\t{n}\t", "Y_Unit_Label\tN\tg\t", "X_Dimension\tTime\tTime\t",
           f"Delta_X\t{number(1 / RATE)}\t{number(1 / RATE)}\t", "***End_of_Header***\t\t\t"]  # fmt: skip
    name = "X_Value\tF\tacc\tComment" if columns != "Multi" else "X_Value\tF\tX_Value\tacc\tComment"
    lines = [*head, *own, name]
    for k, (f, a) in enumerate(zip(force, rings, strict=True)):
        if k == n and multi:
            lines += ["", *own, name]
        at = {"No": "", "One": number(k % n / RATE), "Multi": number(k % n / RATE)}[columns]
        cells = [at, number(f), number(a)] if columns != "Multi" else [at, number(f), at, number(a)]
        lines.append("\t".join(cells))
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("comma", "columns", "multi"),
    [(False, "No", False), (True, "No", True), (True, "One", True), (False, "Multi", True)],
)
def test_labview_files(tmp_path, capsys, comma, columns, multi):
    force, rings = taps()
    path = lvm(tmp_path / "taps.lvm", force, rings[:, 0], comma=comma, columns=columns, multi=multi)
    whole = read_lvm(path, None)
    assert whole.rate_hz == pytest.approx(RATE)
    assert whole.units == ("N", "g")
    assert np.isfinite(whole.samples).all(axis=1).sum() == len(force)
    check_modes(answer(capsys, "hammer", path))


def test_a_labview_file_that_ends_early(tmp_path, capsys):
    force, rings = taps()
    path = lvm(tmp_path / "taps.lvm", force, rings[:, 0])
    text = path.read_text(encoding="utf-8")
    path.write_text(text[: text.index("X_Value")], encoding="utf-8")
    assert "no rows of numbers" in answer(capsys, "hammer", path, code=2)["error"]["message"]
    path.write_text(text[:80], encoding="utf-8")
    assert "ends within its header" in answer(capsys, "hammer", path, code=2)["error"]["message"]
    path.write_text(text.rpartition("\t")[0], encoding="utf-8")
    assert any("not whole" in note for note in answer(capsys, "hammer", path)["notes"])


@pytest.mark.parametrize(
    ("name", "unit", "role"),
    [("qm", "", "position"), ("qg", "", "reference"), ("vir", "", "voltage"), ("Motor Position", "mm", "position"),
     ("Actual Torque", "Nm", "torque"), ("iq_ref", "A", "current"), ("Following Error", "mm", "other"),
     ("F", "g", "response"), ("F", "N", "thrust"), ("linear scale", "um", "stage"),
     ("Position Setpoint", "", "reference"),
     ("Strom", "A", "current"), ("x", "mm", "position"), ("v", "", "velocity"), ("foo", "", "other")],
)  # fmt: skip
def test_roles(name, unit, role):
    assert role_of(name, unit) == role


def test_a_swept_sine(tmp_path, capsys):
    thrust, motor, stage, rate, period, drive = swept("machine-a")
    path = tmp_path / "sweep.csv"
    columns = np.column_stack([np.arange(thrust.size) / rate, thrust, 1e3 * motor, 1e3 * stage])
    np.savetxt(path, columns, delimiter=",", fmt="%.12g", comments="",
               header="time_s,thrust_n,motor_position_mm,stage_position_mm")  # fmt: skip
    said = answer(capsys, "sweep", path, "--band", "5:1000", "--current-bandwidth", drive.current_bandwidth)
    assert said["period_s"] == pytest.approx(period / rate)
    assert said["stage_mass_kg"] == pytest.approx(drive.stage_mass, rel=0.01)
    assert said["screw_stiffness_n_m"] == pytest.approx(drive.drive_stiffness, rel=0.01)
    assert said["stage_dead_time_ms"] == pytest.approx(1e3 * (drive.thrust_delay + drive.stage_delay), rel=0.01)
    csv(path, ["time_s", "thrust_n", "pos_mm"], columns[:3000, :3].T)
    assert answer(capsys, "sweep", path, code=2)["error"]["field"] == "map"


def test_cutting_coefficients(tmp_path, capsys):
    feed = np.array([0.05, 0.1, 0.15, 0.2])
    path = csv(tmp_path / "forces.csv", ["feed_mm", "Fc_n", "Ff (lbf)"],
               [feed, 2.0 * (1800 * feed + 30), 2.0 * (700 * feed + 50) / 4.4482216152605])  # fmt: skip
    said = answer(capsys, "cutting", path, "--depth-mm", 2)
    assert [row["coefficient_n_mm2"] for row in said["rows"]] == pytest.approx([1800.0, 700.0])
    assert [row["edge_n_mm"] for row in said["rows"]] == pytest.approx([30.0, 50.0])
    assert said["flags"] == []
    rng = np.random.default_rng(1)
    csv(path, ["feed_mm", "Fc_n"], [np.tile(feed, 20), 300.0 + 100.0 * rng.standard_normal(80)])
    assert any("poor fit" in flag or "poorly" in flag for flag in
               answer(capsys, "cutting", path, "--depth-mm", 2)["flags"])  # fmt: skip
    csv(path, ["speed", "Fc_n"], [feed, feed])
    assert "one column of feed" in answer(capsys, "cutting", path, "--depth-mm", 2, code=2)["error"]["rule"]


def _damaged(kind, rows):
    """Lines of a table of an axis, damaged in one way."""
    if kind == "decimal commas":
        return ["time_s;pos_mm;f_n", *(row.replace(",", ";").replace(".", ",") for row in rows)]
    if kind == "unit row":
        return ["time,pos,thrust", "s,mm,N", *rows]
    if kind == "no header":
        return rows
    if kind == "duplicated samples":
        return ["time_s,pos_mm,f_n", *(row for k, row in enumerate(rows) for _ in range(1 + (k % 500 == 3)))]
    if kind == "gaps":
        return ["time_s,pos_mm,f_n", *rows[:2000], *rows[2040:4000], *rows[4003:]]
    return ["time_s,f_n,pos_mm", *(f"{t},{u},{x}" for t, x, u in (row.split(",") for row in rows))]


@pytest.mark.parametrize(
    "kind", ["decimal commas", "unit row", "no header", "duplicated samples", "gaps", "another order"]
)
def test_damaged_tables(tmp_path, capsys, kind):
    x, u = axis()
    rows = [f"{t:.6f},{1e3 * a:.8f},{b:.6f}" for t, a, b in zip(TIME, x, u, strict=True)]
    path = tmp_path / "axis.csv"
    path.write_text("\n".join(_damaged(kind, rows)), encoding="utf-8")
    mapped = ["--map", "0=position:mm", "--map", "1=thrust:N"] if kind == "no header" else []
    said = answer(capsys, "servo", path, *mapped)
    check_axis(said)
    words = {"duplicated samples": "repeat", "gaps": "missing"}.get(kind)
    assert words is None or any(words in note for note in said["notes"]), said["notes"]


def test_swapped_columns_and_a_file_that_ends_early(tmp_path, capsys):
    x, u = axis()
    path = csv(tmp_path / "axis.csv", ["time_s", "f_n", "pos_mm"], [TIME, 1e3 * x, u])
    said = answer(capsys, "servo", path)
    assert any("swapped" in flag for flag in said["flags"]), said["flags"]
    text = csv(path, ["time_s", "pos_mm", "f_n"], [TIME, 1e3 * x, u]).read_text(encoding="utf-8")
    path.write_text(text[: text.rindex(",")], encoding="utf-8")
    check_axis(answer(capsys, "servo", path))
    path.write_text(text[:60], encoding="utf-8")
    assert answer(capsys, "servo", path, code=2)["error"]["field"] in ("file", "rate-hz", "map")
    path.write_bytes(b"")
    assert "0 bytes" in answer(capsys, "servo", path, code=2)["error"]["message"]
