"""A sweep on a real dask scheduler with two workers, one of which is killed; and one that is not there."""

import os
import signal
import socket
import subprocess
import sys
import time

import pytest

pytest.importorskip("distributed", reason="dask.distributed is not installed")

from services.clock import WallClock
from services.config import load_case
from services.errors import InputError, RefusalError
from services.sweep.axes import parse_axis
from services.sweep.sweep import run_sweep

pytestmark = pytest.mark.system
CASE = load_case("thesis-652")
AXES = (parse_axis("phase", "0.6:1.4:0.05"), parse_axis("seed", "1,2,3,4"))
ASKED = {
    "mode": "open", "seed": 1, "length_mm": 1.0, "folder": None, "workers": 2, "fresh": False, "clock": WallClock(),
}  # fmt: skip


def free_port():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


def start(*words):
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    return subprocess.Popen([sys.executable, "-m", "distributed.cli." + words[0], *words[1:]], **quiet)


@pytest.fixture
def scheduler(tmp_path):
    address = f"tcp://127.0.0.1:{free_port()}"
    port = address.rsplit(":", 1)[1]
    processes = [start("dask_scheduler", "--host", "127.0.0.1", "--port", port, "--no-dashboard")]
    worker = ("dask_worker", address, "--no-nanny", "--nthreads", "1", "--no-dashboard", "--local-directory")
    processes += [start(*worker, str(tmp_path / str(k))) for k in range(2)]
    yield address, processes
    for process in processes:
        process.kill()
        process.wait()


def test_a_killed_worker_loses_nothing(scheduler):
    address, processes = scheduler
    here = run_sweep(CASE, AXES, scheduler=None, progress=lambda done, total: None, **ASKED)
    killed = []

    def kill_one(done, total):
        if done > 4 and not killed:
            os.kill(processes[2].pid, signal.SIGKILL)
            killed.append(done)

    there = run_sweep(CASE, AXES, scheduler=address, progress=kill_one, **ASKED)
    assert killed
    assert killed[0] < 68
    assert there.results == here.results
    assert there.failed == 0


def test_a_scheduler_that_is_not_there_is_named():
    begin = time.monotonic()
    with pytest.raises(InputError, match="scheduler must be the address of a dask scheduler that answers"):
        run_sweep(CASE, AXES, scheduler=f"tcp://127.0.0.1:{free_port()}", progress=lambda done, total: None, **ASKED)
    assert time.monotonic() - begin < 60.0


def test_a_scheduler_that_dies_leaves_what_was_finished(scheduler, tmp_path):
    address, processes = scheduler

    def kill_it(done, total):
        if done > 4:
            os.kill(processes[0].pid, signal.SIGKILL)

    kept = ASKED | {"folder": tmp_path}
    with pytest.raises(RefusalError, match="was lost .*run the same command again to go on"):
        run_sweep(CASE, AXES, scheduler=address, progress=kill_it, **kept)
    part = run_sweep(CASE, AXES, scheduler=None, progress=lambda done, total: None, most=1, **kept)
    assert 4 < part.resumed < 68
