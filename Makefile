# One definition of each check, for people and for CI. `make check` runs them all.
# PYTHON is the interpreter of an environment that has `pip install '.[test,lint]'`.
PYTHON ?= .venv/bin/python

.PHONY: check quick format lint types stub rust python docs bench develop aarch64 fuzz mutants sample
.PHONY: looks transcripts nightly exam walks asan kills pythons readings chance chance-core pulls
.PHONY: rehearse version

# Damaged files for each loader, and loaders at a time: `make fuzz CASES=1000000 JOBS=2`.
CASES ?= 20000
JOBS ?= 1
# Faults drawn by chance: hours by the hundred. `SEED=7001` draws the same ones again.
COUNT ?= 400
SEED ?=
# Of every case whose errors and p values are asked for.
SEEDS ?= 200
# `SAMPLE=--trust` where the tests have just passed.
SAMPLE ?=

check: lint types stub rust python docs

# Without link-time optimisation a change of the core is built in a fifth of the time; what is
# built so is right, but no figure of speed.
develop:            ## build the core in place, for work on it
	CARGO_PROFILE_RELEASE_LTO=off CARGO_PROFILE_RELEASE_CODEGEN_UNITS=16 \
	$(PYTHON) -m pip install --editable '.[test,lint,docs]'

format:             ## rewrite the code in the project's style
	cargo fmt
	$(PYTHON) -m ruff check --fix .
	$(PYTHON) -m ruff format .

lint:               ## style and lints, warnings are errors
	cargo fmt --check
	cargo clippy --lib --locked -- -D warnings
	cargo clippy --all-targets --locked --features python -- -D warnings
	RUSTDOCFLAGS="-D warnings" cargo doc --no-deps --locked
	$(PYTHON) -m ruff check .
	$(PYTHON) -m ruff format --check .
	$(PYTHON) .ci/arrows
	$(PYTHON) .ci/weight
	$(PYTHON) -m check_jsonschema --builtin-schema vendor.github-workflows .github/workflows/*.yml
	$(dir $(PYTHON))zizmor --offline --quiet .github/workflows

types:              ## types of the whole package
	$(PYTHON) -m mypy

stub:               ## the stub against the built module
	$(PYTHON) -m mypy.stubtest trueangle._core

rust:               ## tests of the core
	cargo test --locked

aarch64:            ## tests of the core on an emulated aarch64; apart from `check`, for it takes minutes
	CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER=aarch64-linux-gnu-gcc \
	CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_RUNNER="qemu-aarch64 -L /usr/aarch64-linux-gnu" \
	cargo test --locked --target aarch64-unknown-linux-gnu --tests

quick:              ## what to run while working: style and the quick tests, a minute
	$(PYTHON) -m ruff check --quiet .
	$(PYTHON) .ci/arrows
	$(PYTHON) -m pytest -q -n auto --dist worksteal -m "not slow"

python:             ## tests of the package
	$(PYTHON) -m pytest -n auto --dist worksteal

transcripts:        ## write anew what commands print and write, after a change that is meant; read the difference
	TRUEANGLE_APPROVE=1 $(PYTHON) -m pytest -q -n auto --dist worksteal tests/python/transcripts

exam:               ## the diagnosis' own exam at full size: an hour or more, figures asserted
	TRUEANGLE_NIGHTLY=1 TRUEANGLE_EXAM_SEEDS=20 $(PYTHON) -m pytest -s \
	  tests/python/hidden tests/python/diagnosis/test_diagnosis.py tests/python/rehearsal/test_followed.py \
	  tests/python/diagnosis/test_account.py tests/python/effects/test_joint_coupling.py

looks:              ## what a reader sees, as pictures and texts in target/looks; needs Chromium
	$(PYTHON) tests/looks

walks:              ## exported steps over 10^7 random readings, units over 10^6: half an hour
	TRUEANGLE_NIGHTLY=1 $(PYTHON) -m pytest -s tests/python/export/test_steps.py \
	  tests/python/export/test_fmu.py

docs:               ## documentation, warnings are errors
	$(PYTHON) -m sphinx -W --keep-going -q docs docs/_build/html

fuzz:               ## CASES damaged files for every loader; Ctrl-C tells how far each has come
	$(PYTHON) tests/fuzz --cases $(CASES) --jobs $(JOBS)

sample:             ## some of the planted faults; minutes
	$(PYTHON) tests/mutants --sample $(SAMPLE)

mutants:            ## planted faults: each must be noticed by its tests; an hour or two
	$(PYTHON) tests/mutants

chance:             ## faults that nobody chose, in lines that tests reach; needs '.[faults]'
	$(PYTHON) tests/mutants/chance.py --count $(COUNT) $(SEED:%=--seed %)

chance-core:        ## the same in the core, all in one build
	$(PYTHON) tests/mutants/chancecore.py --count $(COUNT) $(SEED:%=--seed %)

pulls:              ## errors that are stated and p values by SEEDS seeds, as a table
	$(PYTHON) tests/pulls --seeds $(SEEDS)

version:            ## VERSION=0.3.0 everywhere, and the changelog's heading
	$(PYTHON) .ci/version $(VERSION)

rehearse:           ## all of a release but the upload: artefacts, metadata, an installation without Rust
	$(PYTHON) .ci/rehearse

pythons:            ## the wheel tried on every Python that is to be had here
	rm -rf target/tried
	$(PYTHON) -m pip wheel --quiet --no-deps --wheel-dir target/tried .
	$(PYTHON) .ci/pythons target/tried/*.whl

readings:           ## time and memory up to 10^8 readings, beside the model of cost
	$(PYTHON) benches/scaling.py --largest 1e8

kills:              ## 40 kills of each of five commands at random moments; logs of any size
	TRUEANGLE_KILLS=40 $(PYTHON) -m pytest -q tests/python/injection tests/python/recording

asan:               ## tests of the core under AddressSanitizer, by the compiler's unstable flag
	ASAN_OPTIONS=allocator_may_return_null=1 \
	RUSTC_BOOTSTRAP=1 RUSTFLAGS="-Zsanitizer=address" CARGO_TARGET_DIR=target/asan \
	cargo test --locked --tests --target $$(rustc -vV | sed -n 's/^host: //p')

NIGHTLY = aarch64 asan pythons readings kills pulls fuzz mutants chance chance-core exam walks
nightly: $(NIGHTLY) ## what takes hours; each has a job of its own in .github/workflows/nightly.yml

bench:              ## benchmarks against a reference, in one run
	cargo bench
	$(PYTHON) -m trueangle bench
