# make run          set up .venv, build the FMUs, reproduce the published table
# make shell        a shell in which the environment is active
# make test         the quick tests; each test runs in one of this and the next three targets
# make test-slow    the slow tests, with campaigns in a tenth of their size
# make platforms    other machines and compilers, FMI 3.0
# make interop      tools of other makers
# make explore      whole campaigns and properties with new seeds; SEED=... repeats one
# make check        lint, format, types, rules of imports and of the text
# make docs         the site of all pages in results/site; a warning is an error
# make dist         a release in dist/: wheel, sdist, FMUs, SSP archives, the playground
# make bench        measurements of speed
# make tables       the variable tables of the equation sheets
# make mutants FILES=plant/gripper_plant/contact.py  changes of a module that its tests let pass
# make pictures     the pictures in docs/ and in the notebook, in ten minutes; needs Chromium
# make playground   docs/playground.html; needs zig if the C code of the FMUs has changed

PYTHON ?= $(firstword $(foreach p,python3 python3.15 python3.14 python3.13 python3.12 python3.11,$(shell \
	$(p) -c 'import sys; print("$(p)" if sys.version_info >= (3, 11) else "")' 2>/dev/null)))
BIN := .venv/bin
PIP := PIP_CONSTRAINT=constraints.txt PIP_DISABLE_PIP_VERSION_CHECK=1 $(BIN)/python -m pip install --quiet

# Tests start hundreds of Pythons: none should compile all modules anew, whatever the environment, nor
# start threads for large matrices.
PYTEST = PYTHONDONTWRITEBYTECODE= OPENBLAS_NUM_THREADS=1 \
	$(BIN)/python -m pytest -n 2 --dist worksteal $(TESTS)

# What there is of another processor, emulated, where all tests would take hours
ON_ARM := tests/fmi tests/master tests/grasp tests/fmus/native

SEED ?= $(shell date +%s)

.PHONY: run shell test test-slow platforms interop explore check docs dist bench mutants tables pictures playground clean

run: .venv/run
	$(BIN)/grasp-cosim build
	@mkdir -p results
	$(BIN)/grasp-cosim evaluate --out results > results/evaluation.txt || (cat results/evaluation.txt; false)
	$(BIN)/grasp-cosim run --out results/first_grasp --plot > results/first_grasp.txt
	@echo
	@echo 'The published table was reproduced: results/evaluation.html'
	@echo 'The fingers closed on the object:   results/first_grasp/grasp.png'
	@echo
	@echo 'Next commands:'
	@echo '  source .venv/bin/activate'
	@echo '  grasp-cosim run --set plant.object_width=0.06 --out results/narrow --plot'
	@echo '  grasp-cosim diff results/first_grasp results/narrow'

shell: .venv/run
	@PATH="$(CURDIR)/$(BIN):$$PATH" VIRTUAL_ENV="$(CURDIR)/.venv" $${SHELL:-sh}

test: .venv/dev
	$(PYTEST) -m "not slow and not platforms and not interop"

test-slow: .venv/dev
	$(PYTEST) -m "slow and not platforms and not interop"

platforms: .venv/platforms run
	$(PYTEST) -m platforms
	.ci/platform trixie amd64 make run test
	.ci/platform sid amd64 make run test
	.ci/platform sid amd64 make run test PYTHON=python3.15
	.ci/platform bookworm arm64 make run test TESTS="$(ON_ARM)"

interop: .venv/interop
	GRASP_COSIM_TOOLS="$$GRASP_COSIM_TOOLS:$$(ls "$(CURDIR)"/.venv/*-[0-9]*/bin/python | tr '\n' :)" \
		$(PYTEST) -m interop

explore: .venv/dev
	$(PYTEST) -m "hypothesis or campaign" --hypothesis-profile explore --hypothesis-seed $(SEED)

check: .venv/dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/mypy --platform win32
	$(BIN)/mypy --platform darwin
	$(BIN)/python -m pytest -q tests/test_import_rules.py
	$(BIN)/python docs/prose.py

docs: .venv/dev
	$(BIN)/python docs/website.py

bench: .venv/dev
	$(BIN)/python -m benchmarks.masters

mutants: .venv/mutants
	$(BIN)/python -m benchmarks.mutants $(FILES) $(MORE)

dist: .venv/dev
	@echo "zig, which compiles for all platforms, is installed first: 100 MB"
	$(PIP) --editable '.[native]'
	$(BIN)/python docs/release.py

tables: .venv/run
	$(BIN)/python -m grasp_cosim.fmu_export.page

pictures: .venv/dev
	$(BIN)/python docs/pictures.py
	$(BIN)/python docs/notebook.py

playground: .venv/run
	PYTHONPATH=docs $(BIN)/python -m playground.page

.venv/run: pyproject.toml constraints.txt
	$(if $(PYTHON),,$(error grasp-cosim needs Python 3.11 or newer; name one with PYTHON=...))
	$(PYTHON) -m venv .venv
	$(PIP) --editable '.[plot]'
	@touch $@

.venv/dev: .venv/run
	$(PIP) --editable '.[plot,dev]'
	@touch $@

# What cannot be installed is said, and the tests that need it are skipped, by name.
.venv/platforms: TOOLS := ziglang
.venv/interop: TOOLS := pyssp-standard pythonfmu3 fmu-manipulation-toolbox
.venv/mutants: TOOLS := cosmic-ray pytest-cov
# Each in its own environment: one version of rumoca writes FMUs, the other one simulates.
.venv/interop: APART := rumoca==0.9.13 rumoca==0.10.2 pymoca==0.12.0 modelica-builder==0.8.0
.venv/platforms .venv/interop .venv/mutants: .venv/dev
	@for tool in $(TOOLS); do $(PIP) $$tool || { echo "not installed: $$tool"; without=$$tool; }; done; \
	for tool in $(APART); do at=.venv/$$(echo $$tool | sed s/==/-/); \
		$(PYTHON) -m venv $$at && $$at/bin/pip install --quiet $$tool \
		|| { echo "not installed: $$tool"; without=$$tool; }; done; \
	[ -n "$$without" ] || touch $@

# ROS 2 and grasp-cosim in one environment, as its page has it
ROS := $(addprefix ros-jazzy-,rclpy==7.1.6 rmw-fastrtps-cpp sensor-msgs std-msgs rosgraph-msgs \
	trajectory-msgs diagnostic-msgs lifecycle-msgs)
ROS_AT := .venv/ros-jazzy-7.1.6
.venv/interop: $(ROS_AT)/made
$(ROS_AT)/made: .venv/dev
	@$(PYTHON) -m venv $(ROS_AT) && $(ROS_AT)/bin/pip install --quiet $(ROS) && \
	PIP_CONSTRAINT=constraints.txt $(ROS_AT)/bin/pip install --quiet --editable . \
	&& touch $@ || echo "not installed: ROS 2"

clean:
	rm -rf .venv fmus/build fmus/native results dist .mypy_cache .ruff_cache .pytest_cache .hypothesis
