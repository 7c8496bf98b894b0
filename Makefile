# Needs Python 3.11-3.13 and make; uv is used where there is one.
# Another interpreter: make setup PYTHON=python3.12
# Options for a command: make figures ARGS="--smoke --out out"

PYTHON ?= python3
ARGS ?=
VENV := .venv
PY := $(VENV)/bin/python
STAMP := $(VENV)/.stamp
PEERS_STAMP := $(VENV)/.peers
DOCS_STAMP := $(VENV)/.docs

.DEFAULT_GOAL := help
.PHONY: setup figures test bench peers sweeps docs explore lint types lock-check lock banks clean help

setup: $(STAMP)  ## make .venv with the locked packages and this project

# The stamp goes first and comes back last: an interrupted set-up leaves none, and
# without one the environment is made anew, since a half-installed package can look whole.
# Installers skip bytecode or write it file by file, so it is compiled once, in parallel.
$(STAMP): pyproject.toml requirements.lock
	@$(PYTHON) -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))' || { \
	  echo "error: $(PYTHON) is missing or is not Python 3.11, 3.12 or 3.13 ($$($(PYTHON) --version 2>&1));" \
	    "try: make setup PYTHON=python3.12" >&2; exit 1; }
	@echo "installing the locked packages into $(VENV) (about a minute)"
	@set -e; \
	uv=$$(command -v uv || true); \
	if ! [ -e $@ ] || { [ -z "$$uv" ] && ! $(PY) -m pip --version >/dev/null 2>&1; }; then rm -rf $(VENV); fi; \
	rm -f $@; \
	if [ -n "$$uv" ]; then \
	  [ -e $(PY) ] || uv venv --quiet --python "$$($(PYTHON) -c 'import sys; print(sys.executable)')" $(VENV); \
	  uv pip install --quiet --python $(PY) --require-hashes -r requirements.lock; \
	  uv pip install --quiet --python $(PY) --no-deps --no-build-isolation --editable .; \
	else \
	  [ -e $(PY) ] || $(PYTHON) -m venv $(VENV); \
	  $(PY) -m pip install --disable-pip-version-check --quiet --no-compile --require-hashes -r requirements.lock; \
	  $(PY) -m pip install --disable-pip-version-check --quiet --no-compile --no-deps --no-build-isolation --editable .; \
	fi; \
	$(PY) -W ignore -m compileall -qq -j 0 "$$($(PY) -c 'import sysconfig; print(sysconfig.get_path("purelib"))')" || true
	@touch $@

figures: $(STAMP)  ## draw the paper's figures
	$(PY) -m paper_figs $(ARGS)

test: $(STAMP)  ## run the tests
	$(PY) -m pytest $(ARGS)

bench: $(STAMP) $(PEERS_STAMP)  ## time the code, beside its peers
	$(PY) -m benchmarks $(ARGS)

peers: $(STAMP) $(PEERS_STAMP)  ## install the peers, for benchmarks and for the tests of adapters

# The peers come on top of the locked packages, whose versions they leave alone. The PyTorch is pinned here: of the
# releases that the peers allow, installers would take the newest.
$(PEERS_STAMP): $(STAMP)
	@echo "installing the benchmarks' peers into $(VENV) (some minutes)"
	@set -e; \
	sed -e '/^ *--hash/d' -e 's/ *\\$$//' requirements.lock > $(VENV)/constraints.txt; \
	$(PY) -m pip --version >/dev/null 2>&1 || $(PY) -m ensurepip >/dev/null; \
	$(PY) -m pip install --disable-pip-version-check --quiet --no-compile --constraint $(VENV)/constraints.txt \
	  torch==2.13.0; \
	$(PY) -m pip install --disable-pip-version-check --quiet --no-compile --constraint $(VENV)/constraints.txt \
	  --no-build-isolation --editable '.[peers]'
	@touch $@

sweeps: $(STAMP)  ## run parameter sweeps
	$(PY) -m sweeps $(ARGS)

docs: $(STAMP) $(DOCS_STAMP)  ## build the documentation into site/
	NO_MKDOCS_2_WARNING=1 $(PY) -m mkdocs build --strict --clean --site-dir site

$(DOCS_STAMP): $(STAMP)
	@echo "installing what builds the documentation into $(VENV)"
	@set -e; \
	sed -e '/^ *--hash/d' -e 's/ *\\$$//' requirements.lock > $(VENV)/constraints.txt; \
	$(PY) -m pip --version >/dev/null 2>&1 || $(PY) -m ensurepip >/dev/null; \
	$(PY) -m pip install --disable-pip-version-check --quiet --no-compile --constraint $(VENV)/constraints.txt \
	  --no-build-isolation --editable '.[docs]'
	@touch $@

explore: $(STAMP)  ## open the explorer in a browser
	$(PY) -m explorer $(ARGS)

lint: $(STAMP)  ## check style
	$(VENV)/bin/ruff check .
	$(VENV)/bin/ruff format --check --quiet .

types: $(STAMP)  ## check types
	$(VENV)/bin/pyright

lock-check: $(STAMP)  ## check requirements.lock against pyproject.toml
	$(PY) .ci/check_lock.py

# One version per package for every Python ("fewest"), so that results do not depend on which one is at hand.
lock:  ## renew requirements.lock (needs uv; UPGRADE=--upgrade for newer versions)
	@command -v uv >/dev/null || { echo "error: make lock needs uv" >&2; exit 1; }
	uv pip compile --universal --python-version 3.11 --fork-strategy fewest --prerelease if-necessary-or-explicit \
	  --generate-hashes --no-header --no-annotate --no-emit-index-url --no-emit-find-links --quiet $(UPGRADE) \
	  --extra studies --extra dev pyproject.toml -o requirements.lock

banks: $(STAMP)  ## renew the stored placements of the paper's environments, after what draws them has changed
	$(PY) .ci/renew_banks.py

clean:  ## remove the environment and everything else that was built
	rm -rf $(VENV) build dist site .pytest_cache .ruff_cache .hypothesis
	find . -name .git -prune -o -type d -name __pycache__ -exec rm -rf {} +

help:  ## list the targets
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/  make \1\t\2/p' $(MAKEFILE_LIST) | expand -t 20
