# Needs Python 3.10 to 3.13 with its venv module, and make. `make run` is the place to start.
PYTHON ?=
SCENE ?= slider_crank
DURATION ?=
ARGS ?=

BIN := .venv/bin
# Nothing of this leaves the machine unless the user says so (Humble knows only the older variable).
export ROS_AUTOMATIC_DISCOVERY_RANGE ?= LOCALHOST
ifeq ($(ROS_DISTRO),humble)
export ROS_LOCALHOST_ONLY ?= 1
endif

.PHONY: help setup run view check test benchmark clean

help:
	@echo 'make run [SCENE=slider_crank] [DURATION=seconds] [ARGS=...]   simulate, publish, record (Ctrl-C ends it)'
	@echo 'make view [ARGS=...]   show what runs in a web browser, at http://localhost:8080'
	@echo 'make setup [PYTHON=python3.12]   only prepare .venv (run and test do it themselves)'
	@echo 'make check   linters, type checks and the tests that need no node, under 90 s'
	@echo 'make test    linters, type checks and all tests'
	@echo 'make benchmark [ARGS=--no-peers]   what accuracy costs here, and elsewhere: benchmark/results, half an hour'
	@echo 'make clean   remove caches and build products; .venv/ and logs/ stay'

setup:
	@$(or $(PYTHON),python3) scripts/environment.py $(if $(PYTHON),--python-given)

# Without characters that need a shell make starts Python itself: signals reach it, Ctrl-C ends quietly.
run: setup
	@$(BIN)/python -m alf_ros simulator --scene '$(SCENE)' $(if $(DURATION),--duration '$(DURATION)') $(ARGS)

view: setup
	@$(BIN)/python -m alf_ros view $(ARGS)

# For every change, before `make test`: what a mistake in a file shows up in at once.
CHECKED := block chart check_table curve digest expression exact_solutions import_order input_errors joints kernel mass \
  repetition row_arrays scene schema screw structs
check: ARGS += $(foreach name,$(CHECKED),$(wildcard test/test_$(name).py))
check: test

# Every check runs and every failure counts; pytest stays last, so that its summary ends the output.
# Plugins are named: a sourced ROS 2 brings some that do not fit this pytest.
test: setup
	@failed=''; \
	$(BIN)/ruff check . || failed="$$failed, ruff check"; \
	$(BIN)/ruff format --check . || failed="$$failed, ruff format"; \
	$(BIN)/mypy || failed="$$failed, mypy"; \
	$(BIN)/python -m pytest --disable-plugin-autoload -p xdist -p hypothesispytest -n 2 --dist loadfile $(ARGS) \
	  || failed="$$failed, pytest"; \
	if [ -n "$$failed" ]; then echo "make test: failed: $${failed#, }" >&2; exit 1; fi

# On a machine that does nothing else.
benchmark: setup
	@$(BIN)/python benchmark/run.py $(ARGS)

clean:
	rm -rf build install log .mypy_cache .pytest_cache .ruff_cache .hypothesis *.egg-info
	find . -path ./.venv -prune -o -name __pycache__ -exec rm -rf {} +
