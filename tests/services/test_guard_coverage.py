"""The gate: every line and every branch of the guard is taken by its own tests, the quick ones alone."""

import os
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
GUARD = sorted((ROOT / "services").glob("guard*.py"))
PARTS = ("", "_commands", "_details", "_envelope", "_faults", "_limits", "_motion")
TESTS = [f"tests/services/test_guard{part}.py" for part in PARTS]
SLOW = ("whatever_is_asked", "any_length_of_block", "moves_per_minute_at_the_edge", "within_four_fifths")


def coverage(*arguments, file):
    environment = os.environ | {"COVERAGE_FILE": str(file), "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "coverage", *arguments]
    return subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)


def test_every_line_and_branch_of_the_guard(tmp_path):
    own = ("--branch", f"--include={','.join(map(str, GUARD))}", "-m", "pytest", "-x", *TESTS)
    run = coverage("run", *own, "-k", f"not ({' or '.join(SLOW)})", file=tmp_path / "c")
    assert run.returncode == 0, run.stdout + run.stderr
    report = coverage("report", "--show-missing", "--fail-under=100", file=tmp_path / "c")
    assert report.returncode == 0, report.stdout + report.stderr
    assert all(path.name in report.stdout for path in GUARD), report.stdout


def test_no_line_of_the_guard_is_left_out_of_the_count():
    assert len(GUARD) >= 5
    assert not [path.name for path in GUARD if "pragma" in path.read_text()]
