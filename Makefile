# tadcore: `make` or `make help` lists the targets.
#
# Everything Python happens in .venv; Rust builds land in target/. Both are made on first use.

PYTHON  ?= python3
VENV    := .venv
BIN     := $(VENV)/bin
PIP     := $(BIN)/python -m pip install --quiet
OUT     ?= out
RUSTDOC := -D warnings --html-in-header $(CURDIR)/rust/tadcore/katex.html
RUST    := $(shell find rust -name '*.rs' -o -name Cargo.toml) Cargo.toml Cargo.lock
# Made by: the compiler; pip, what tadcore runs with; pip, what tests and linters need; pip, tadcore itself, editable.
CORE      := python/tadcore/_core.abi3.so
PACKAGES  := $(VENV)/.packages
TOOLS     := $(VENV)/.tools
INSTALLED := $(VENV)/.installed
# Requirements of tadcore and of the extras named, read without building the package.
LISTED := $(BIN)/python -c 'import sys, tomllib; p = tomllib.load(open("pyproject.toml", "rb"))["project"]; \
  print(*p["dependencies"], *(x for e in sys.argv[1:] for x in p["optional-dependencies"][e]), sep="\n")'

.DEFAULT_GOAL := help
.PHONY: help setup develop installed demo test test-rust test-python test-games test-rest lowest heavy faults fuzz sanitize mutants audit lint format \
        bench peers images docs wheel sdist check clean

help:  ## list the targets
	@echo "tadcore: target-attacker-defender games with limited observations"
	@grep -E '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | awk -F'\t' '{printf "  make %-12s %s\n", $$1, $$2}'

$(BIN)/maturin:
	@echo "== a virtual environment with maturin in $(VENV)"
	@$(PYTHON) -m venv $(VENV)
	@$(PIP) 'maturin>=1.9.4,<2'

$(PACKAGES): pyproject.toml | $(BIN)/maturin
	@echo "== NumPy, SciPy and what else tadcore runs with"
	@$(LISTED) | $(PIP) --requirement /dev/stdin
	@touch $@

$(TOOLS): pyproject.toml | $(PACKAGES)
	@echo "== what tests and linters need"
	@$(LISTED) test | $(PIP) --requirement /dev/stdin
	@touch $@

$(CORE): $(RUST) pyproject.toml | $(BIN)/maturin
	@echo "== the core"
	@VIRTUAL_ENV=$(CURDIR)/$(VENV) $(BIN)/maturin develop --release --locked --skip-install

# Finds the core compiled, as long as the sources are those that it was compiled from.
$(INSTALLED): pyproject.toml Cargo.toml | $(PACKAGES) $(CORE)
	@echo "== tadcore, editable"
	@$(PIP) --no-deps --no-build-isolation --editable .
	@touch $@

# Two jobs: pip unpacks on one core while the compiler begins on the other.
installed:
	@$(MAKE) --silent --jobs=2 $(INSTALLED)

setup:  ## make .venv with tadcore in it, editable, and what tests and linters need (compiles the core)
	@$(MAKE) --silent --jobs=2 $(INSTALLED) $(TOOLS)

develop: installed  ## after a change in Rust: compile it in place, optimised, for the tadcore in .venv

demo: installed  ## reproduce the paper: every run of section 6, computed, compared and drawn into $(OUT)/
	$(BIN)/tadcore reproduce --out $(OUT)

test: test-rust test-python  ## run every test, Rust and Python

# The bindings are named for their features: so tests and extension share one build of the core and its dependencies.
test-rust:
	cargo test --release --locked --package tadcore --package tadcore-kernels --package tadcore-python

# Two halves side by side, of about the same length; with one thread of BLAS each, or they get in each other's way.
test-games test-rest: export OPENBLAS_NUM_THREADS := 1
test-games test-rest: export OMP_NUM_THREADS := 1
GAMES := $(addprefix tests/python/,study simulation verification analysis report)
test-python: setup
	@$(MAKE) --silent --jobs=2 test-games test-rest
	$(BIN)/python -m mypy.stubtest tadcore._core

test-games:
	$(BIN)/python -m pytest -q -p no:cacheprovider $(GAMES)

test-rest:
	$(BIN)/python -m pytest -q -p no:cacheprovider tests/python $(addprefix --ignore=,$(GAMES))

# The compiled core is the one of this checkout. Old wheels are made for old Pythons: 3.11 where there is one.
LOWEST        := .venv-lowest
LOWEST_PYTHON ?= $(or $(shell command -v python3.11),$(PYTHON))
$(LOWEST)/.packages: pyproject.toml tests/lowest.py
	@echo "== the lowest versions that pyproject.toml declares, in $(LOWEST)"
	@$(LOWEST_PYTHON) -m venv --clear $(LOWEST)
	@$(LOWEST)/bin/python tests/lowest.py requirements \
	  | $(LOWEST)/bin/python -m pip install --quiet --requirement /dev/stdin
	@touch $@

lowest: $(CORE) $(LOWEST)/.packages  ## every part of the package once, with the lowest versions of all dependencies
	PYTHONPATH=python MPLBACKEND=agg $(LOWEST)/bin/python tests/lowest.py

heavy: setup  ## the tests that take minutes or gigabytes: a million steps, forty defenders with limited sight
	$(BIN)/python -m pytest -m heavy

faults: setup  ## inject faults into a study (kill, full disk, damage, two writers) and print a table of the results
	$(BIN)/python -W ignore tests/faults

# Any compiler will do: the switch lets a stable one count coverage. FUZZ_SECONDS is for each of the three targets.
FUZZ_SECONDS ?= 20
fuzz: setup  ## fuzz the core, the saved gain table and the readers of files, 60 s in all (needs cargo-fuzz)
	cd fuzz && for target in core table; do \
	  mkdir -p corpus/$$target && RUSTC_BOOTSTRAP=1 cargo fuzz run -s none $$target corpus/$$target seeds/$$target -- \
	    -max_total_time=$(FUZZ_SECONDS) -timeout=60 -max_len=2048 || exit 1; done
	$(PIP) atheris
	$(BIN)/python fuzz/scenario.py fuzz/corpus/scenario -max_total_time=$(FUZZ_SECONDS) -timeout=60 -max_len=6000

# A stable compiler that is told to be another; docs/reliability.md says why there is no ThreadSanitizer.
sanitize:  ## the core's Rust tests under AddressSanitizer (Linux, x86-64)
	RUSTC_BOOTSTRAP=1 RUSTFLAGS=-Zsanitizer=address CARGO_TARGET_DIR=$(or $(CARGO_TARGET_DIR),target)/sanitize PROPTEST_CASES=8 \
	  cargo test --locked --profile sanitize --target x86_64-unknown-linux-gnu -p tadcore -p tadcore-kernels --lib --tests --no-fail-fast

mutants:  ## mutation testing: flip a sign or swap an operator in each formula of the core, report which Rust test fails
	$(PYTHON) tests/mutants

audit: setup  ## check licences and sources of all dependencies; known vulnerabilities where a database can be reached
	$(BIN)/python tests/audit.py

lint: $(TOOLS)  ## format check, clippy, rustdoc, ruff, mypy: warnings are errors
	cargo fmt --all --check
	$(BIN)/ruff format --check
	$(BIN)/ruff check
	cargo clippy --workspace --all-targets --locked -- -D warnings
	RUSTDOCFLAGS="$(RUSTDOC)" cargo doc --workspace --no-deps --locked --quiet
	$(BIN)/mypy

format:  ## rewrite sources in the project's format
	cargo fmt --all
	$(BIN)/ruff format
	$(BIN)/ruff check --fix

bench:  ## Criterion benchmarks of the core
	cargo bench

peers: setup  ## compare with the same work in SciPy, Numba and JAX, one process for each
	$(LISTED) bench | $(PIP) --requirement /dev/stdin
	for script in benches/peers/[a-z]*.py; do $(BIN)/python $$script || exit 1; done

images: setup  ## redraw the reference images of the tests, and labelled copies into out/images
	$(BIN)/python -m pytest -q tests/python/plotting/test_images.py \
	  --mpl-generate-path=tests/python/plotting/baseline

docs: setup  ## build the documentation, every code cell executed, and the core's; warnings are errors
	RUSTDOCFLAGS="$(RUSTDOC)" cargo doc --workspace --no-deps --locked
	$(LISTED) docs | $(PIP) --requirement /dev/stdin
	$(BIN)/python -m sphinx -W --keep-going -q -b html docs docs/_build/html
	$(BIN)/python docs/check_pages.py docs/_build/html
	@echo "open docs/_build/html/index.html"

# On Linux zig links against the glibc of 2012, so that the wheel runs wherever NumPy's does; plain rustc would ask for
# the glibc of this machine.
ZIG := $(if $(filter Linux,$(shell uname -s)),--zig --compatibility manylinux2014)

wheel: $(BIN)/maturin  ## build one wheel for every Python from 3.11 on (Linux: glibc 2.17 or later), into dist/
	$(PIP) 'maturin[zig]>=1.9.4,<2'
	PATH="$(CURDIR)/$(BIN):$$PATH" $(BIN)/maturin build --release --locked --strip $(ZIG) --out dist

sdist: $(BIN)/maturin  ## build the source archive, into dist/
	$(PIP) 'maturin[zig]>=1.9.4,<2'
	$(BIN)/maturin sdist --out dist

check: lint test  ## everything that must pass before a change lands

clean:  ## remove what the other targets made
	rm -rf $(VENV) $(LOWEST) $(OUT) target dist build docs/_build
