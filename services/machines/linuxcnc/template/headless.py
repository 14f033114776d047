#!/usr/bin/python3
"""The display of a LinuxCNC without a screen: says that it runs, and ends when told or when its parent is gone."""

import os
import pathlib
import time

folder = pathlib.Path(os.environ.get("ANTIPHASE_RUN") or ".")
parent = int(os.environ.get("ANTIPHASE_PARENT") or 0)
(folder / "started").touch()
while not (folder / "stop").exists() and (not parent or os.path.exists(f"/proc/{parent}")):
    time.sleep(0.02)
