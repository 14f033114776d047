"""The subscriber in the README works as printed, with nothing but the schema beside it."""

import pathlib
import re
import shutil
import subprocess
import sys

import numpy as np
import pytest

from services.messages import ForceBlock
from services.zenoh_bus import ZenohBus
from tests.system.kit import until

ROOT = pathlib.Path(__file__).resolve().parents[2]
pytestmark = pytest.mark.system


def test_the_printed_subscriber_prints_what_is_published(tmp_path):
    (code,) = re.findall(r"```python\n(\"\"\"Print the strongest.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    (tmp_path / "listen.py").write_text(code)
    shutil.copy(ROOT / "services" / "schemas" / "antiphase_pb2.py", tmp_path)
    said = tmp_path / "said.txt"
    with ZenohBus.router("lathe-9", "tcp/127.0.0.1:0") as bus, said.open("wb") as out:
        bus.offer(ForceBlock)
        line = [sys.executable, "-u", str(tmp_path / "listen.py"), bus.endpoint]
        listener = subprocess.Popen(line, stdout=out, stderr=subprocess.STDOUT, cwd=tmp_path)
        try:
            wanted = b"force at 0.50 s: at most 7.0 N"
            assert until(lambda: publish(bus) or wanted in said.read_bytes()), said.read_text()
        finally:
            listener.kill()
            listener.wait()


def publish(bus):
    zeros = np.zeros(90)
    force = np.where(np.arange(90) == 4, -7.0, zeros)
    bus.publish(
        ForceBlock(
            run="r", source="monitor", sequence=50, first_sample=4500, sample_rate_hz=9000.0, force_x1_n=force,
            force_y1p_n=zeros, latency_s=0.0,
        )  # fmt: skip
    )
