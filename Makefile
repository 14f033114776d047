# Everything runs from a fresh clone: each target makes .venv first when it is missing or pyproject.toml is newer.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
CONSTRAINTS := $(if $(CI),-c .ci/constraints.txt,)

.PHONY: demo test lint bench soak faults mutants fuzz clean

demo: $(STAMP)
	$(BIN)/antiphase demo thesis-652 --out runs/thesis-652

# what needs neither clock nor network runs on all cores; real processes and browsers have them to themselves
test: $(STAMP) lint
	$(BIN)/python -m pytest -n auto -m "not system and not browser"
	$(BIN)/python -m pytest -m "system or browser"

lint: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/pyright
	$(BIN)/lint-imports --no-cache

bench: $(VENV)/.bench
	$(BIN)/python -m pytest tests/benchmarks -s

# 20 minutes with three dashboards and a recorder, every core four times over, the link cut each minute
soak: $(STAMP)
	$(BIN)/antiphase soak --duration-s 1200 --load 4 --cut-every-s 60 --dashboards 3 --out runs/soak

# ten thousand bad days of the closed loop
faults: $(STAMP)
	$(BIN)/antiphase faults --runs 10000 --out runs/faults

# mistakes put into the guard, one at a time: do its tests notice?
mutants: $(STAMP)
	$(BIN)/python -m tests.mutation.run --out runs/mutants

# a million bent inputs at everything that reads bytes
fuzz: $(STAMP)
	-$(BIN)/pip install --quiet --disable-pip-version-check $(CONSTRAINTS) -e '.[fuzz]'
	$(BIN)/python -m tests.fuzz.run --runs 1000000 --out runs/fuzz

# peers that only the benchmarks need; where one does not install, or has no C compiler, the tables go without it
$(VENV)/.bench: $(STAMP)
	-$(BIN)/pip install --quiet --disable-pip-version-check $(CONSTRAINTS) -e '.[bench]'
	@touch $@

$(STAMP): pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "antiphase needs Python 3.11 or newer: make PYTHON=python3.12")'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --disable-pip-version-check $(CONSTRAINTS) -e '.[all]'
	@touch $(STAMP)

clean:
	rm -rf $(VENV) runs build *.egg-info
