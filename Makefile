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

.PHONY: help setup run view check test thorough newest docs fuzz soak benchmark clean

help:
	@echo 'make run [SCENE=slider_crank] [DURATION=seconds] [ARGS=...]   simulate, publish, record (Ctrl-C ends it)'
	@echo 'make view [ARGS=...]   show what runs in a web browser, at http://localhost:8080'
	@echo 'make setup [PYTHON=python3.12]   only prepare .venv (run and test do it themselves)'
	@echo 'make check   linters (of prose too), type checks, quick tests without a node and their coverage, under 90 s'
	@echo 'make test    linters, type checks and all tests'
	@echo 'make thorough   the same, with all cases of large families of tests, all campaigns, and numpy 1'
	@echo 'make newest [PYTHON=python3.13]   tests that need no ROS, with the newest versions of all libraries'
	@echo 'make docs [ARGS=--no-films]   the documentation site: build/docs/html/index.html'
	@echo 'make fuzz [ARGS="--minutes 60"]   files, logs and commands nobody would write, by the thousand'
	@echo 'make soak [ARGS="--minutes 60"]   two nodes for hours: commands, resets, kills; every log verified'
	@echo 'make benchmark [ARGS=--no-peers]   what accuracy costs here, and elsewhere: benchmark/results, half an hour'
	@echo 'make clean   remove caches and build products; .venv/ and logs/ stay'

setup:
	@$(or $(PYTHON),python3) scripts/environment.py $(if $(PYTHON),--python-given)

# Without characters that need a shell make starts Python itself: signals reach it, Ctrl-C ends quietly.
run: setup
	@$(BIN)/python -m alf_ros simulator --scene '$(SCENE)' $(if $(DURATION),--duration '$(DURATION)') $(ARGS)

view: setup
	@$(BIN)/python -m alf_ros view $(ARGS)

# For every change, before `make test`: quick tests without a node, the linter of the prose, and the
# coverage of these tests. What kills processes and waits for them is left to `make test`.
LONG := test/kernel/test_cache_attacks.py test/scene/test_mutants.py
CHECKED := $(filter-out $(LONG),$(wildcard $(addsuffix /test_*.py,test/kernel test/mechanism test/scene))) \
	test/project/test_prose.py test/studies/test_loads.py test/studies/test_alike_members.py \
	test/simulation/test_bearing_shares.py
# Plugins are named: a sourced ROS 2 brings some that do not fit this pytest.
# Four workers keep two cores busy: tests of nodes wait for a part of their time. They take whole
# files, in the order of test/conftest.py.
PYTEST := -m pytest --disable-plugin-autoload -p xdist -p hypothesispytest \
	-n 4 --dist loadfile --no-loadscope-reorder
COVERAGE := COVERAGE_FILE='$(CURDIR)/.coverage' $(BIN)/coverage

# Hundreds of short processes start: each would compile what it imports, where bytecode is not kept.
check test: export PYTHONDONTWRITEBYTECODE =
# Every check runs and every failure counts. One process checks types, beside the first tests: before
# them it would keep one core for most of a minute. What it says comes when the tests have ended.
check test: setup
	@failed=''; said=$$(mktemp); \
	$(BIN)/mypy >"$$said" 2>&1 & types=$$!; \
	trap 'kill $$types 2>/dev/null; rm -f "$$said"' EXIT; trap 'exit 130' INT TERM; \
	$(BIN)/ruff check . || failed="$$failed, ruff check"; \
	$(BIN)/ruff format --check . || failed="$$failed, ruff format"; \
	$(if $(ARGS)$(filter test,$@),$(BIN)/python $(PYTEST) $(ARGS) || failed="$$failed$(COMMA) pytest";,$(QUICK)) \
	wait $$types || failed="$$failed, mypy"; cat "$$said"; \
	if [ -n "$$failed" ]; then echo "make $@: failed: $${failed#, }" >&2; exit 1; fi

# Also cases and tests that repeat what others prove (test/support/thorough.py).
thorough:
	@ALF_ROS_LONG=1 $(MAKE) --no-print-directory test ARGS='$(ARGS)'

COMMA := ,
define QUICK
$(COVERAGE) erase; \
	$(COVERAGE) run $(PYTEST) $(CHECKED) || failed="$$failed, pytest"; \
	$(COVERAGE) combine --quiet; printf 'lines of the library that these tests run, %%: '; \
	$(COVERAGE) report --format=total || failed="$$failed, coverage";
endef

# `requirements/` pins versions; pip without them takes the newest ones, as users of the library do.
newest:
	@$(or $(PYTHON),python3) -m venv --clear .venv_newest
	@.venv_newest/bin/python -m pip install --quiet --upgrade --upgrade-strategy eager pip setuptools \
		'.[record,plot,table,import,ensemble,view]' $$(sed -n 's/==.*//p' requirements/test.txt)
	@.venv_newest/bin/python -m pip uninstall --quiet --yes alf_ros
	@PYTHONPATH='$(CURDIR)' .venv_newest/bin/python $(PYTEST) --without-ros $(ARGS)

# Moving pictures of the gallery take two minutes; they are kept, and drawn again when they would change.
docs: setup
	@$(BIN)/python doc/site/build.py $(ARGS)

# For hours, on a machine that does nothing else.
soak: setup
	@$(BIN)/python benchmark/soak.py $(ARGS)

fuzz: setup
	@$(BIN)/python fuzz/run.py $(ARGS)

# On a machine that does nothing else.
benchmark: setup
	@$(BIN)/python benchmark/run.py $(ARGS)

clean:
	rm -rf build install log .mypy_cache .pytest_cache .ruff_cache .hypothesis .coverage* *.egg-info
	find . -path ./.venv -prune -o -name __pycache__ -exec rm -rf {} +
