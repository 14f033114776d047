"""Chapter 6 of the thesis (Yamada, Keio University, 2017): what the model must reproduce, and what it is known to miss.

The tolerances stand in the rows themselves; here stands which rows must agree, and which cannot. A row that begins to
agree is as much a finding as one that ceases to: both change a list below. Seeds are few, so that it stays quick.
"""

import ast
import dataclasses
import json
import math
import pathlib
import subprocess
import sys

import numpy as np
import pytest

import services.reproduce
from services.clock import WallClock
from services.errors import InputError
from services.linear_theory import gain_of_pass, linear_process, strongest_of_pass, strongest_root
from services.open_cut import cut_open
from services.reproduce import published as thesis
from services.reproduce.depth import depth_rows, study_depth
from services.reproduce.directions import direction_rows, study_directions
from services.reproduce.equal_pitch import pass_rows, study_pass
from services.reproduce.formulas import (
    error_of_the_shift,
    half_angle_deg,
    natural_frequencies,
    phase_and_difference,
    pitch_differences,
    shift_error_deg,
)
from services.reproduce.in_process import in_process_rows, study_in_process
from services.reproduce.phases import phase_rows, study_phases
from services.reproduce.plant import prepared_case
from services.reproduce.rows import as_table, near, said
from services.reproduce.sweep import study_sweep, sweep_rows

PLANT = "lumped"
MISSED = {
    "first mode of the 25 x 130 mm bar, held rigidly",  # erratum: 592 Hz is not eq. (6-11) of that bar
    "half angle for 3 pi at 652 Hz",  # erratum: 8.28 deg, not 8.2
    "quiet near 7 pi of the momentary frequency",  # not reached within 20 deg
    "half angle where the simulated sweep is quiet near 3 pi",  # the frequency falls while the tools cut on
    "half angle where the simulated sweep is quiet near 5 pi",
    "half angle of least linear growth near 5 pi, tools 6 mm from the tip",  # the rake effect moves the dip
    "half angle of least linear growth near 7 pi, tools 6 mm from the tip",
    "growth there (5 pi)",  # one family of roots stays unstable near the tip
    "growth there (7 pi)",
    "bar along Y1' over X1 with equal pitch, 130 mm",  # the set that calms 0.3 mm has too high a thrust
    "1.2 pi at 24.9 mm: gain of a small wave",  # neutral in the model
    "1.2 pi at 24.9 mm: simulated pass",
}
NEEDS_MANY_SEEDS = {"the frequency only falls"}  # a share of the seeds, and here are few


def ignore(_):
    pass


@pytest.fixture(scope="module")
def equal_pitch():
    return study_pass(PLANT, 1, ignore, seeds=5, shifted_seeds=1)


@pytest.fixture(scope="module")
def phases():
    return study_phases(PLANT, 1, ignore, seeds=1)


@pytest.fixture(scope="module")
def sweep():
    return study_sweep(PLANT, 1)


@pytest.fixture(scope="module")
def depth():
    return study_depth(PLANT, 1)


@pytest.fixture(scope="module")
def in_process():
    return study_in_process(PLANT, 2, WallClock(), ignore, seeds=1)


@pytest.fixture(scope="module")
def directions():
    return study_directions(PLANT, 1)


@pytest.fixture(scope="module")
def rows(equal_pitch, phases, sweep, depth, in_process, directions):
    return [
        *natural_frequencies(PLANT),
        *depth_rows(depth),
        *direction_rows(directions),
        *error_of_the_shift(),
        *pitch_differences(),
        *pass_rows(equal_pitch),
        *sweep_rows(sweep),
        *phase_rows(phases),
        *phase_and_difference(),
        *in_process_rows(in_process),
    ]


def test_only_what_is_known_to_differ_differs(rows):
    assert {row.quantity for row in rows if not row.agrees} - NEEDS_MANY_SEEDS == MISSED


def test_every_row_says_where_it_is_printed_and_why(rows):
    assert len({(row.source, row.quantity) for row in rows}) == len(rows)
    for row in rows:
        assert row.source.startswith(("Fig. 6-", "Table 6-", "section 6."))
        assert len(row.why) > 10
        assert row.printed is not None


def test_a_table_is_json_and_counts_itself(rows):
    table = json.loads(json.dumps(as_table(rows), allow_nan=False))
    assert table["total"] == len(table["rows"]) == len(rows)
    assert table["agree"] == sum(row.agrees for row in rows)
    keys = {"source", "quantity", "printed", "computed", "unit", "agrees", "why", "doubts", "expected"}
    assert all(set(row) == keys for row in table["rows"])


@pytest.mark.parametrize("plant", ["lumped", "surface"])
@pytest.mark.parametrize(
    ("position", "line_hz", "growth"),
    [(0.0, 652.2, 30.2), (0.015, 612.1, 27.1), (0.03, 572.1, 22.6), (0.045, 532.3, 16.5)],
)
def test_the_strongest_root_along_the_pass(plant, position, line_hz, growth):
    # within 0.5 %: the values that the whole set of constants was fitted to
    root = strongest_root(prepared_case(plant, "thesis-652"), position, 0.0)
    assert root.imag / (2 * math.pi) == pytest.approx(line_hz, rel=5e-3)
    assert root.real == pytest.approx(growth, rel=5e-3)


@pytest.mark.parametrize(("name", "factor"), [("thesis-depth-02", 0.5), ("thesis-652", 1.0 / 3.0)])
def test_less_stiffness_silences(name, factor):
    # half is enough at 130 mm; the default set at 160 mm is silent only below 0.36 of its stiffness
    case = prepared_case(PLANT, name, {"case.start_position_mm": 0.0})
    less = dataclasses.replace(case.cutting, cutting_stiffness=factor * case.cutting.cutting_stiffness)
    soft = dataclasses.replace(case, cutting=less)
    assert cut_open(case, 1, 0.0, 0.006).chatter
    assert not cut_open(soft, 1, 0.0, 0.006).chatter
    assert strongest_root(soft, 0.0, 0.0).real < 0.0 < strongest_root(case, 0.0, 0.0).real


def test_scaling_mass_stiffness_and_cut_together_leaves_growth_and_line():
    case = prepared_case(PLANT, "thesis-652")
    twice = dataclasses.replace(
        case.cutting,
        cutting_stiffness=2 * case.cutting.cutting_stiffness,
        process_damping=2 * case.cutting.process_damping,
    )
    chuck = dataclasses.replace(
        case.workpiece.chuck,
        lateral_stiffness=2 * case.workpiece.chuck.lateral_stiffness,
        tilt_stiffness=2 * case.workpiece.chuck.tilt_stiffness,
    )
    bar = dataclasses.replace(
        case.workpiece,
        density=2 * case.workpiece.density,
        young_modulus=2 * case.workpiece.young_modulus,
        chuck=chuck,
    )
    heavy = dataclasses.replace(case, cutting=twice, workpiece=bar)
    assert strongest_root(heavy, 0.006, 0.0) == pytest.approx(strongest_root(case, 0.006, 0.0), rel=1e-6)


def test_the_wrong_sign_of_the_wave_breaks_the_lines():
    case = prepared_case(PLANT, "thesis-652")
    wrong = dataclasses.replace(case.cutting, overlap=-case.cutting.overlap)
    line = strongest_root(dataclasses.replace(case, cutting=wrong), 0.0, 0.0).imag / (2 * math.pi)
    assert abs(line - thesis.LINES_HZ[0]) > 15.0


def test_the_measured_phases(phases):
    # 0.7, 1.1 and 1.2 pi lie within 1 1/s of the border in the model: a wave does not even double
    growth = {cut.column.phase_pi: cut.root.real for cut in phases}
    assert all(growth[p] > 5.0 for p in (0.5, 0.6, 1.15))
    assert all(growth[p] < -5.0 for p in (0.8, 0.9))
    assert all(abs(growth[p]) < 1.0 for p in (0.7, 1.1, 1.2))
    assert all((cut.gain_db > 20.0) == (cut.column.phase_pi in (0.5, 0.6, 1.15)) for cut in phases)
    assert all(cut.gain_db < 6.0 for cut in phases if cut.column.phase_pi in (0.7, 1.1, 1.2))


@pytest.mark.parametrize(("phase", "unstable"), [(0.5, True), (0.6, True), (0.8, False), (0.9, False), (1.15, True)])
def test_the_measured_phases_on_the_map(phase, unstable):
    """Roots from the derivatives of the chip, both directions, rake."""
    column = next(one for one in thesis.TABLE_6_4 if one.phase_pi == phase)
    case = prepared_case("surface", "thesis-652", {"workpiece.turned_diameter_mm": column.diameter_mm})
    places = [0.0, 0.015, 0.030, 0.045]
    root = strongest_of_pass(case, math.radians(column.half_angle_deg), places)
    assert (root.real > 5.0) if unstable else (root.real < -5.0)


def test_the_bar_shakes_more_along_the_surface_than_towards_the_tools(directions):
    assert directions[0].ratio == pytest.approx(1.4, abs=0.06)


@pytest.mark.parametrize("plant", ["lumped", "surface"])
def test_deeper_is_calmer_at_130_mm(plant):
    shallow, deep = (prepared_case(plant, f"thesis-depth-0{tenths}") for tenths in (2, 3))
    assert strongest_root(shallow, 0.0, 0.0).real > 5.0
    assert max(strongest_root(deep, place, 0.0).real for place in (0.0, 0.01, 0.02, 0.03, 0.045)) < 0.0


def test_deeper_is_calmer_on_the_map():
    case = prepared_case("surface", "thesis-depth-03", {"case.start_position_mm": 0.0})
    assert not cut_open(case, 1, 0.0, 0.006).chatter


def test_the_shift_follows_the_speed_and_the_frequency():
    assert half_angle_deg(1.0, 652.0, 600.0) == pytest.approx(half_angle_deg(1.0, 652.0) / 2)
    error = shift_error_deg(600.0, np.array([-10.0, 0.0, 10.0]))
    assert error[0] > 0.0 == error[1] > error[2]


def test_chatter_measured_in_process_ends_with_the_move(in_process):
    run = in_process.late[0]
    assert 725.0 <= run.before_hz <= 740.0
    assert run.moved_s < run.arrived_s
    assert run.calm_s - run.arrived_s < 0.15


def test_every_figure_can_be_drawn(rows, equal_pitch, phases, sweep, depth, in_process, directions):
    from services.figures.thesis import THESIS_FIGURES
    from services.reproduce.chapter6 import Chapter6

    chapter = Chapter6(
        rows=tuple(rows), equal_pitch=equal_pitch, phases=phases, sweep=sweep, depth=depth, in_process=in_process,
        directions=directions,
    )
    for draw in THESIS_FIGURES.values():
        draw(chapter).draw_without_rendering()


def test_rows_judge_by_their_tolerance():
    assert near("a", "b", 1.0, 1.05, "mm", within=0.1, why="c").agrees
    apart = near("a", "b", 1.0, 1.2, "mm", within=0.1, why="c", otherwise="Because")
    assert not apart.agrees
    assert apart.why.endswith("Because")
    assert not near("a", "b", 1.0, None, "mm", within=0.1, why="c").agrees
    assert said("a", "b", "quiet", "chatter", False, why="c").unit == ""


def test_printed_numbers_live_in_one_file():
    # a computed value that equals a printed one must have been computed: no other file of the package may hold it
    folder = pathlib.Path(services.reproduce.__file__).parent
    printed = {652.0, 612.0, 572.0, 532.0, 738.0, 6.02, 1.54, 5.52, 592.0, 3611.0, 533.0, 599.0, 8.2, 13.8, 19.3}
    printed |= {
        value for column in thesis.TABLE_6_4 for value in (column.dx1_um, column.dy1p_um, column.half_angle_deg)
    }
    for path in folder.glob("*.py"):
        if path.stem == "published":
            continue
        constants = {n.value for n in ast.walk(ast.parse(path.read_text())) if isinstance(n, ast.Constant)}
        assert not {c for c in constants if isinstance(c, float)} & printed, path.name


def test_an_unknown_name_is_refused():
    from services.cli.reproduce import reproduce

    with pytest.raises(InputError, match="chapter6"):
        reproduce("chapter7")


def test_numbers_need_no_matplotlib():
    code = "import sys, services.reproduce.chapter6; sys.exit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_the_gain_of_a_pass_sums_what_grows():
    """Falling from 6 1/s to zero within half of 10 s: 6 times 5/2 nepers. What decays before undoes nothing."""
    case = prepared_case(PLANT, "thesis-652")
    assert gain_of_pass(case, [6.0 + 4000j, -6.0 + 4000j], [0.0, 0.030]) == pytest.approx(15.0, rel=1e-2)
    assert gain_of_pass(case, [-6.0, 0.0], [0.0, 0.030]) == 0.0
    assert gain_of_pass(case, [2.0, -9.0, -9.0, 2.0], [0.0, 0.01, 0.02, 0.03]) == pytest.approx(
        gain_of_pass(case, [2.0, -9.0], [0.0, 0.01]), rel=2e-2
    )


def test_the_linear_process_is_that_of_the_plant():
    lumped, mapped = (linear_process(prepared_case(plant, "thesis-652"), 0.0) for plant in ("lumped", "surface"))
    assert (len(lumped.modes), len(mapped.modes)) == (1, 2)
    assert lumped.cutting_stiffness == 1.06e6
    assert mapped.cutting_stiffness == pytest.approx(1.06e6, rel=2e-3)
    assert mapped.tangential_overlap < mapped.overlap
    assert lumped.rake_gain == mapped.rake_gain > 0.0
