# Two commands need nothing but Python >= 3.11 and make: `make bench` and `make test`.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
STAMP  := $(VENV)/.installed
PIP     = $(BIN)/python -m pip install --quiet --disable-pip-version-check

# Where the results of each study lie; pages are composed of them.
RESULTS := speed/race speed/automatic speed/work-precision speed/planets conservation/endure conservation/drift encounters general \
  general/constraints many/large many/ensemble paper/paper paper/sitnikov peers
OWN := chaos random costs
REPORTS ?= $(RESULTS)
STUDIES ?= $(OWN)
OPTIONS ?=  # of each run, as in OPTIONS=--quick

.PHONY: bench evidence examples pages reports test test-all test-aarch64 docs lint format venv lock clean

bench: venv  ## run Sitnikov through every integrator: results and report in runs/sitnikov/, where git does not look
	$(BIN)/hbvm-bench run sitnikov --report runs/sitnikov/report

examples: venv  ## the fourteen tasks beside other libraries: writes examples/measured.json and docs/tasks.md
	$(BIN)/python examples/run_all.py

reports: venv  ## write the results REPORTS="speed/race paper/sitnikov" from runs/, and every page; what is missing there runs
	@failed=; for place in $(REPORTS) $(STUDIES); do \
	  case " $(OWN) " in *" $$place "*) study=reports/$$place;; *) study=$${place##*/};; esac; \
	  echo "$$(date +%H:%M) $$place"; \
	  $(BIN)/hbvm-bench run $$study $(OPTIONS) --report reports/$$place || { \
	    [ $$? -eq 130 ] && exit 130; failed="$$failed $$place"; }; \
	done; \
	$(MAKE) --no-print-directory pages && date +%H:%M && { [ -z "$$failed" ] || { echo "not whole:$$failed"; exit 1; }; }

evidence: venv  ## every study and its page, with one version of the code on a quiet machine; goes on where it was stopped
	$(BIN)/hbvm-bench doctor
	$(BIN)/python -c "from integrators.kernel import ahead; ahead.ship()"  # as a wheel has it: compilations are a wheel's
	$(MAKE) reports

pages: venv  ## draw every page and the list of reports from the results that lie there; nothing is run
	$(BIN)/hbvm-bench report --pages reports --index reports

test: venv  ## the test suite
	$(BIN)/python -m pytest

test-all: venv  ## with the slow tests: studies that are run whole, and killed in the middle
	$(BIN)/python -m pytest -m ""

test-aarch64: venv  ## each way through the kernel once on an emulated aarch64, 5 minutes; needs Debian's apt-get and qemu-user-static
	.ci/aarch64

docs: pages  ## the site, docs/_build/html/index.html, and its links checked
	@lock="$$(sha256sum < requirements-docs.lock)"; \
	if [ "$$(cat $(VENV)/.docs 2>/dev/null)" != "$$lock" ]; then \
	  $(PIP) --require-hashes -r requirements-docs.lock && echo "$$lock" > $(VENV)/.docs; \
	fi
	$(BIN)/python -m sphinx -W --keep-going -q -b html docs docs/_build/html
	$(BIN)/python -m tests.docs.links docs/_build/html

lint: venv  ## ruff, pyright, import-linter
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	PYRIGHT_PYTHON_IGNORE_WARNINGS=1 $(BIN)/pyright
	$(BIN)/lint-imports

format: venv
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

venv: $(STAMP)

# Each stamp holds the digest of what was installed from, so that a changed file
# (and not a changed time stamp, as after a checkout) renews the environment.
$(STAMP): FORCE
	@lock="$$(sha256sum < requirements.lock)"; project="$$(sha256sum < pyproject.toml)"; \
	if [ "$$(cat $(VENV)/.locked 2>/dev/null)" != "$$lock" ]; then \
	  $(PYTHON) -c 'import sys; sys.exit("hbvm-bench needs Python 3.11 or newer: set PYTHON=" if sys.version_info < (3, 11) else 0)' && \
	  echo "setting up $(VENV) from requirements.lock" && \
	  rm -rf $(VENV) && $(PYTHON) -m venv $(VENV) && \
	  $(PIP) --no-compile --require-hashes -r requirements.lock && \
	  { $(BIN)/python -m compileall -qq -j 0 $(VENV)/lib || true; } && \
	  echo "$$lock" > $(VENV)/.locked || exit 1; \
	fi; \
	if [ "$$(cat $@ 2>/dev/null)" != "$$project" ]; then \
	  $(PIP) --no-build-isolation --no-deps -e . && echo "$$project" > $@ && $(BIN)/hbvm-bench warm; \
	fi
.PHONY: FORCE
FORCE:

lock:  ## rewrite both locks (needs uv)
	uv pip compile --universal --generate-hashes --no-header --no-annotate --no-emit-index-url \
	  pyproject.toml --extra peers --extra dask --extra export --group dev -o requirements.lock
	uv pip compile --universal --generate-hashes --no-header --no-annotate --no-emit-index-url \
	  -c requirements.lock pyproject.toml --extra peers --group docs -o requirements-docs.lock

clean:
	rm -rf $(VENV) .pytest_cache .ruff_cache .hypothesis
