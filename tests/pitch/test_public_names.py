"""The package gives all its names, and costs nothing until one of them is used."""

import subprocess
import sys

import pytest

import pitch


@pytest.mark.parametrize("name", pitch.__all__)
def test_every_public_name_is_there(name):
    assert getattr(pitch, name) is not None
    assert name in dir(pitch)


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="module 'pitch' has no attribute 'nothing'"):
        _ = pitch.nothing


def test_the_import_is_lazy():
    code = "import sys, pitch; print(sorted({'numba', 'scipy', 'numpy'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
