"""Shared by all tests: repeatable hypothesis runs, and floating-point errors that do not pass in silence."""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # small matrices: threads only wait for each other
import numpy as np
import pytest
from hypothesis import HealthCheck, settings

settings.register_profile(
    "antiphase", derandomize=True, deadline=None, print_blob=True, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("antiphase")


@pytest.fixture(autouse=True)
def _floating_point_errors():
    with np.errstate(all="raise", under="ignore"):
        yield


@pytest.fixture(scope="session")
def recorded(tmp_path_factory):
    """One run of the loop as a recording: path, case, tape."""
    from tests.recorded import record_loop

    return record_loop(tmp_path_factory.mktemp("recorded") / "run.mcap")
