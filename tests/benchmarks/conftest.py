"""Benchmarks run when they are asked for by path, as `make bench` does; a plain run of the tests leaves them out."""

import pathlib

HERE = pathlib.Path(__file__).resolve().parent


def pytest_ignore_collect(collection_path, config):
    asked = [(config.invocation_params.dir / name.split("::")[0]).resolve() for name in config.args]
    return None if any(path == HERE or HERE in path.parents for path in asked) else True
