"""Let coverage guide the bending, by atheris (`pip install 'antiphase[fuzz]'`); a finding ends it and leaves a file.

    python -m tests.fuzz.guided message runs/fuzz 100000 1 300

The arguments: a door, a folder for what it learns, inputs, seed, longest time (s).
"""

import contextlib
import pathlib
import sys

import atheris

with atheris.instrument_imports(include=["services", "nptdms", "pyuff", "mcap", "msgspec"]):
    from tests.fuzz.targets import NO, doors


def main() -> None:
    """Fuzz one door."""
    name, folder, runs, seed, seconds = sys.argv[1:6]
    door, place = doors()[name], pathlib.Path(folder) / name
    place.mkdir(parents=True, exist_ok=True)
    for number, data in enumerate(door.seeds):
        (place / f"seed-{number}").write_bytes(data)

    def one(data: bytes) -> None:
        with contextlib.suppress(*NO):
            door.open(data)

    bounds = [f"-runs={runs}", f"-seed={seed}", f"-max_total_time={seconds}", "-timeout=10", "-rss_limit_mb=4096"]
    atheris.Setup([sys.argv[0], *bounds, f"-artifact_prefix={place}/found-", "-print_final_stats=1", str(place)], one)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
