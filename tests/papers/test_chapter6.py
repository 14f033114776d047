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
from services.open_cut import cut_open
from services.reproduce import published as thesis
from services.reproduce.depth import depth_rows, study_depth
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
from services.reproduce.plant import prepared_case, strongest_root
from services.reproduce.rows import as_table, near, said
from services.reproduce.sweep import study_sweep, sweep_rows

PLANT = "lumped"
MISSED = {
    "first mode of the 25 x 130 mm bar, held rigidly",  # erratum: 592 Hz is not eq. (6-11) of that bar
    "half angle for 3 pi at 652 Hz",  # erratum: 8.28 deg, not 8.2
    "quiet near 7 pi of the momentary frequency",  # not reached within 20 deg
    "half angle where the simulated sweep is quiet near 3 pi",  # the frequency falls while the tools cut on
    "half angle where the simulated sweep is quiet near 5 pi",
    "growth there (5 pi)",  # one family of roots stays unstable near the tip
    "growth there (7 pi)",
    "1.2 pi at 24.9 mm: largest growth",  # neutral in the model
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
def rows(equal_pitch, phases, sweep, depth, in_process):
    return [
        *natural_frequencies(PLANT),
        *depth_rows(depth),
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
    keys = {"source", "quantity", "printed", "computed", "unit", "agrees", "why", "doubts"}
    assert all(set(row) == keys for row in table["rows"])


@pytest.mark.parametrize(
    ("position", "line_hz", "growth"),
    [(0.0, 652.2, 30.2), (0.015, 612.1, 27.1), (0.03, 572.1, 22.6), (0.045, 532.3, 16.5)],
)
def test_the_strongest_root_along_the_pass(position, line_hz, growth):
    # within 0.5 %: the values that the whole set of constants was fitted to
    root = strongest_root(prepared_case(PLANT, "thesis-652"), position, 0.0)
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


def test_the_signs_of_the_measured_phases(phases):
    # 0.7 and 1.2 pi lie within 1 1/s of the border in the model
    signs = {cut.column.phase_pi: cut.root.real > 0.0 for cut in phases}
    assert [signs[p] for p in (0.5, 0.6, 0.8, 0.9, 1.1, 1.15)] == [True, True, False, False, False, True]
    assert abs(phases[-1].root.real) < 2.0


def test_the_shift_follows_the_speed_and_the_frequency():
    assert half_angle_deg(1.0, 652.0, 600.0) == pytest.approx(half_angle_deg(1.0, 652.0) / 2)
    error = shift_error_deg(600.0, np.array([-10.0, 0.0, 10.0]))
    assert error[0] > 0.0 == error[1] > error[2]


def test_chatter_measured_in_process_ends_with_the_move(in_process):
    run = in_process.late[0]
    assert 725.0 <= run.before_hz <= 740.0
    assert run.moved_s < run.arrived_s
    assert run.calm_s - run.arrived_s < 0.15


def test_every_figure_can_be_drawn(rows, equal_pitch, phases, sweep, depth, in_process):
    from services.figures.thesis import THESIS_FIGURES
    from services.reproduce.chapter6 import Chapter6

    chapter = Chapter6(
        rows=tuple(rows), equal_pitch=equal_pitch, phases=phases, sweep=sweep, depth=depth, in_process=in_process
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
