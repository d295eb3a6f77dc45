# tadcore: `make` or `make help` lists the targets.
#
# Everything Python happens in .venv; Rust builds land in target/. Both are made on first use.

PYTHON  ?= python3
VENV    := .venv
BIN     := $(VENV)/bin
OUT     ?= out
STAMP   := $(VENV)/.installed
RUSTDOC := -D warnings --html-in-header $(CURDIR)/rust/tadcore/katex.html
RUST    := $(shell find rust -name '*.rs' -o -name Cargo.toml) Cargo.toml Cargo.lock

.DEFAULT_GOAL := help
.PHONY: help setup demo test test-rust test-python heavy faults fuzz sanitize mutants audit lint format bench peers images \
        docs wheel sdist check clean

help:  ## list the targets
	@echo "tadcore: target-attacker-defender games with limited observations"
	@grep -E '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | awk -F'\t' '{printf "  make %-12s %s\n", $$1, $$2}'

$(BIN)/python:
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip

$(STAMP): $(BIN)/python pyproject.toml $(RUST)
	$(BIN)/python -m pip install --quiet --editable '.[test]'
	@touch $@

setup: $(STAMP)  ## make .venv and install tadcore into it (compiles the core)

demo: $(STAMP)  ## reproduce the paper: every run of section 6, computed, compared and drawn into $(OUT)/
	$(BIN)/tadcore reproduce --out $(OUT)

test: test-rust test-python  ## run every test, Rust and Python

# Link-time optimisation would compile the core once more for each test program; what is tested is the same without.
test-rust:
	CARGO_PROFILE_RELEASE_LTO=off cargo test --release --locked

test-python: $(STAMP)
	$(BIN)/python -m pytest
	$(BIN)/python -m mypy.stubtest tadcore._core

heavy: $(STAMP)  ## the tests that take minutes or gigabytes: a million steps, forty defenders with limited sight
	$(BIN)/python -m pytest -m heavy

faults: $(STAMP)  ## inject faults into a study (kill, full disk, damage, two writers) and print a table of the results
	$(BIN)/python -W ignore tests/faults

# Any compiler will do: the switch lets a stable one count coverage. FUZZ_SECONDS is for each of the three targets.
FUZZ_SECONDS ?= 20
fuzz: $(STAMP)  ## fuzz the core, the saved gain table and the readers of files, 60 s in all (needs cargo-fuzz)
	cd fuzz && for target in core table; do \
	  mkdir -p corpus/$$target && RUSTC_BOOTSTRAP=1 cargo fuzz run -s none $$target corpus/$$target seeds/$$target -- \
	    -max_total_time=$(FUZZ_SECONDS) -timeout=60 -max_len=2048 || exit 1; done
	$(BIN)/python -m pip install --quiet atheris
	$(BIN)/python fuzz/scenario.py fuzz/corpus/scenario -max_total_time=$(FUZZ_SECONDS) -timeout=60 -max_len=6000

# A stable compiler that is told to be another; docs/reliability.md says why there is no ThreadSanitizer.
sanitize:  ## the core's Rust tests under AddressSanitizer (Linux, x86-64)
	RUSTC_BOOTSTRAP=1 RUSTFLAGS=-Zsanitizer=address CARGO_TARGET_DIR=$(or $(CARGO_TARGET_DIR),target)/sanitize PROPTEST_CASES=8 \
	  cargo test --locked --profile sanitize --target x86_64-unknown-linux-gnu -p tadcore --lib --tests --no-fail-fast

mutants:  ## mutation testing: flip a sign or swap an operator in each formula of the core, report which Rust test fails
	$(PYTHON) tests/mutants

audit: $(STAMP)  ## check licences and sources of all dependencies; known vulnerabilities where a database can be reached
	$(BIN)/python tests/audit.py

lint: $(STAMP)  ## format check, clippy, rustdoc, ruff, mypy: warnings are errors
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

peers: $(STAMP)  ## compare with the same work in SciPy, Numba and JAX, one process for each
	$(BIN)/python -m pip install --quiet '.[bench]'
	for script in benches/peers/[a-z]*.py; do $(BIN)/python $$script || exit 1; done

images: $(STAMP)  ## redraw the reference images of the tests, and labelled copies into out/images
	$(BIN)/python -m pytest -q tests/python/test_images.py --mpl-generate-path=tests/python/baseline

docs: $(STAMP)  ## build the documentation, every code cell executed, and the core's; warnings are errors
	RUSTDOCFLAGS="$(RUSTDOC)" cargo doc --workspace --no-deps --locked
	$(BIN)/python -m pip install --quiet --editable '.[docs]'
	$(BIN)/python -m sphinx -W --keep-going -q -b html docs docs/_build/html
	$(BIN)/python docs/check_links.py docs/_build/html
	@echo "open docs/_build/html/index.html"

# On Linux zig links against the glibc of 2012, so that the wheel runs wherever NumPy's does; plain rustc would ask for
# the glibc of this machine.
ZIG := $(if $(filter Linux,$(shell uname -s)),--zig --compatibility manylinux2014)

wheel: $(STAMP)  ## build one wheel for every Python from 3.11 on (Linux: glibc 2.17 or later), into dist/
	$(BIN)/python -m pip install --quiet 'maturin[zig]>=1.9,<2'
	PATH="$(CURDIR)/$(BIN):$$PATH" $(BIN)/maturin build --release --locked --strip $(ZIG) --out dist

sdist: $(STAMP)  ## build the source archive, into dist/
	$(BIN)/python -m pip install --quiet 'maturin[zig]>=1.9,<2'
	$(BIN)/maturin sdist --out dist

check: lint test  ## everything that must pass before a change lands

clean:  ## remove what the other targets made
	rm -rf $(VENV) $(OUT) target dist build docs/_build
