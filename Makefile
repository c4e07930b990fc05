# One command each; every target makes its own .venv on first use and takes no set-up time afterwards.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
# Small matrices: more threads only get into each other's way.
export OMP_NUM_THREADS := 1
export OPENBLAS_NUM_THREADS := 1

.DEFAULT_GOAL := help
.PHONY: help package test-oldest audit demo test test-full test-long times doctest lint structure docs linkcheck notebooks lab figure validation browser bench compleib hidden-effects fuzz clean clean-cache

help: ## Show this list
	@grep -E '^[a-z-]+:.*## ' Makefile | sed 's/:.*## /\t/' | expand -t 18

$(READY): pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
		|| { echo "robustpolish needs Python 3.11 or newer; try: make PYTHON=python3.11 $(MAKECMDGOALS)"; exit 1; }
	@echo "Setting up $(VENV) (once; takes a few minutes) ..."
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	@touch $@

demo: $(READY) ## Run the main job; table, figure and HTML report go to demo-results/
	$(BIN)/robustpolish design --out demo-results --report --force

PYTEST := $(BIN)/python -m pytest -q -n 2 --dist loadfile

test: $(READY) ## Run the quick tests (five minutes on two cores)
	$(PYTEST) -m "not slow and not long" --durations 40

test-full: $(READY) ## Run the slower tests that `make test` leaves out
	$(PYTEST) -m "slow and not long" --durations 40

test-long: $(READY) ## Run the tests that take more than five seconds each, some of them minutes
	$(PYTEST) -m long --timeout 3600

times: $(READY) ## Measure on an idle machine which tests are slow: tests/slow.txt
	rm -f tests/slow.txt
	$(PYTEST) -m "not long" --measure-times

doctest: $(READY) ## Run the examples in docstrings
	$(PYTEST) --doctest-modules robustpolish

LINES := 55201
FILES_AT_MOST := 262

lint: $(READY) ## Check style, types, the direction of imports, cycles and the size of the package
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright --threads 2
	$(BIN)/lint-imports
	$(BIN)/python -m tests.structure.imports
	$(BIN)/python -m tests.structure.size --lines $(LINES) --files $(FILES_AT_MOST)

structure: $(READY) ## Print the files that public calls enter, and the size of the package
	$(BIN)/python -m tests.structure.call_path
	$(BIN)/python -m tests.structure.size

docs: $(READY) ## Build the documentation, warnings are errors; pages go to docs/_build/html
	$(BIN)/sphinx-build -W --keep-going -b html docs docs/_build/html

linkcheck: $(READY) ## Follow every link of the documentation; needs a network
	$(BIN)/python docs/list_links.py
	$(BIN)/sphinx-build -D nb_execution_mode=off -b linkcheck docs docs/_build/linkcheck

notebooks: $(READY) ## Run every notebook in full and keep its outputs beside its text
	$(BIN)/python notebooks/run.py

LAB := $(VENV)/.lab
$(LAB): $(READY)
	@echo "Installing JupyterLab (once) ..."
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[lab]'
	@touch $@

lab: $(LAB) ## Open the tutorials in JupyterLab
	$(BIN)/jupyter lab notebooks

figure: demo ## Refresh the README's figure with what the demo drew
	cp demo-results/figure.png docs/_static/demo.png

validation: $(READY) ## Measure every figure of the validation page again (a few minutes)
	$(BIN)/python docs/build_validation.py

browser: ## Install Chromium for the tests of reports, where that is possible
	@{ command -v chromium && command -v chromedriver; } >/dev/null \
		|| { test "$$(id -u)" = 0 && apt-get -qq update && apt-get -qq -y install chromium chromium-driver; } >/dev/null 2>&1 \
		|| echo "No Chromium: the tests of reports in a browser will be skipped."

PYSINDY := $(VENV)/.pysindy
$(PYSINDY): | $(READY)
	@echo "Installing pysindy beside (once) ..."
	@$(PYTHON) -m venv $(PYSINDY) && $(PYSINDY)/bin/pip install --quiet --disable-pip-version-check pysindy \
		|| { rm -rf $(PYSINDY); echo "No pysindy: the benchmark leaves its line out."; }

bench: $(READY) | $(PYSINDY) ## Time everything against other solvers: docs/benchmarks.md and .json (half an hour)
	$(BIN)/python -m benchmarks.run --pysindy $(PYSINDY)/bin/python

compleib: $(READY) ## Try all synthesis methods on the benchmark plants: docs/compleib_table.md
	$(BIN)/python -m benchmarks.compleib_table

hidden-effects: $(READY) ## Examine the diagnosis on all hidden cases (hours); goes on where it stopped
	$(BIN)/python -m tests.hidden_effects.run --keep .hidden_effects_rows.jsonl

SEED ?= 1
FILES ?= 100000
PLANTS ?= 10000
fuzz: $(READY) ## Try damaged files and random plants on everything (an hour); FILES, PLANTS and SEED
	$(BIN)/python -m tests.fuzz.files --count $(FILES) --seed $(SEED) --keep .fuzz_crashes
	$(BIN)/python -m tests.fuzz.plants --count $(PLANTS) --seed $(SEED)

RELEASE := $(VENV)/.release
$(RELEASE): $(READY)
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[release]'
	@touch $@

package: $(RELEASE) ## Build sdist and wheel, install the wheel where there is nothing else, run demo and examples
	$(BIN)/python -m tests.package.check

OLDEST := .venv-oldest
test-oldest: $(READY) ## Run the tests with the oldest versions of all packages that are asked for
	$(PYTHON) -m venv --clear $(OLDEST)
	$(OLDEST)/bin/pip install --quiet --disable-pip-version-check uv
	$(OLDEST)/bin/uv pip install --quiet --python $(OLDEST)/bin/python --resolution lowest-direct --editable '.[dev]'
	# What old packages use of newer ones is theirs to mend.
	$(OLDEST)/bin/python -m pytest -q -n 2 -m "not slow and not long" -W default::DeprecationWarning

audit: $(RELEASE) ## Ask whether weaknesses of installed packages are known; needs a network
	$(BIN)/python -m pip freeze --exclude-editable > $(VENV)/audited.txt
	$(BIN)/pip-audit --strict --no-deps --disable-pip -r $(VENV)/audited.txt

clean-cache: ## Forget compiled functions
	find robustpolish tests -name '*.nb?' -delete
	rm -rf $${XDG_CACHE_HOME:-$$HOME/.cache}/robustpolish/compiled

clean: clean-cache ## Remove what the other targets made
	rm -rf $(VENV) $(OLDEST) demo-results docs/_build docs/api docs/effects docs/notebooks .pytest_cache .ruff_cache .import_linter_cache
