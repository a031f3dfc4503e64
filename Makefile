# Each target sets up .venv on its first run: Python 3.11 to 3.14 and make are all it needs.
# Settings, as in "make reproduce OUTPUT=results": PYTHON, OUTPUT, JOBS, ARGS (passed on to pytest).

OUTPUT ?= output
JOBS ?= 2
CANDIDATES = "$(PYTHON)" python3 python3.14 python3.13 python3.12 python3.11
SUPPORTED = import sys, venv; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 14))
RUN = .venv/bin/python
NOTEBOOKS = --nbval --nbval-current-env --nbval-sanitize-with tests/notebooks/sanitize.cfg notebooks
SHARED = -n $(JOBS) --dist loadfile --no-loadscope-reorder

.PHONY: reproduce site test check lock coverage lab notebooks oldest newest lint mutation campaign clean

reproduce: .venv/.ready
	$(RUN) -m cra_sym reproduce --output "$(OUTPUT)"

# The notebooks as they are stored, as pages to read offline.
site: OUTPUT = site
site: .venv/.ready
	$(RUN) -m cra_sym site --output "$(OUTPUT)"

# The processes share the processors: linear algebra takes one thread in each. The longest files come first, so that all
# end together.
test: export OPENBLAS_NUM_THREADS = 1
test: .venv/.ready
	$(RUN) -m pytest $(SHARED) README.md $(NOTEBOOKS) tests cra_sym $(ARGS)

# Before each commit, under two minutes on two processors: style, types, and the tests that tests/fast.txt names.
check: export OPENBLAS_NUM_THREADS = 1
check: lint
	$(RUN) -m pytest -n $(JOBS) --dist worksteal -q -m "not browser" @tests/fast.txt $(ARGS)

# Lines and branches of the package that the tests run, without the notebooks; derivations too: the store is empty.
coverage: export OPENBLAS_NUM_THREADS = 1
coverage: export XDG_CACHE_HOME = $(CURDIR)/.venv/coverage
coverage: .venv/.ready
	rm -rf .venv/coverage .coverage .coverage.*
	$(RUN) -m coverage run -m pytest $(SHARED) README.md tests cra_sym $(ARGS)
	$(RUN) -m coverage combine --quiet
	$(RUN) -m coverage report

# Without JupyterLab's news and its question whether to update: both would ask the network.
lab: .venv/.ready
	$(RUN) -m jupyterlab --LabApp.news_url=None --LabApp.check_for_updates_class=jupyterlab.NeverCheckForUpdate notebooks/00_overview.ipynb

notebooks: .venv/.ready
	$(RUN) -m cra_sym.report.notebooks notebooks
	$(RUN) -m cra_sym.report.pictures notebooks/images

# Every notebook and every test on the oldest or the newest versions that pyproject.toml allows, in an environment of its
# own.
oldest: .venv/.ready
	$(call gate,oldest)

newest: .venv/.ready
	$(call gate,newest)

define gate
	$(RUN) -m venv .venv-$(1)
	$(RUN) -m tests.notebooks.gate --requirements $(1) > .venv-$(1)/requirements.txt
	.venv-$(1)/bin/python -m pip install --quiet --disable-pip-version-check -r .venv-$(1)/requirements.txt
	.venv-$(1)/bin/python -m tests.notebooks.gate
	OPENBLAS_NUM_THREADS=1 .venv-$(1)/bin/python -m pytest $(SHARED) -m "not browser" -W ignore::DeprecationWarning tests cra_sym $(ARGS)
endef

lint: .venv/.ready
	$(RUN) -m ruff check .
	$(RUN) -m ruff format --check .
	$(RUN) -m mypy

# Every wheel for every system and Python, with its hash, after a change of requirements.txt.
lock: .venv/.ready
	$(RUN) -m pip install --quiet --disable-pip-version-check uv
	grep -v '^-e' requirements.txt | $(RUN) -m uv pip compile --quiet --universal --no-build --python-version 3.11 \
	    --custom-compile-command "make lock" --format pylock.toml --output-file .ci/pylock.toml -

# Hours on one processor: every mutant of every module, or those left by the run before. ARGS="--sample 10" takes the
# first ten of each, ARGS=arm/lagrangian one module, "--minutes 60" an hour of those least tried, and --again starts anew.
# The record stays out of version control.
mutation: .venv/.ready
	$(RUN) -m tests.mutation $(ARGS)

# Random joints and columns against their own frequencies, coefficients along x and whole Lagrangians against other
# methods, exports of random Lagrangians, built and run, which go on where they were stopped; bad values in every
# argument; a sweep past the memory of its workers, of which one is killed; every case of the tests that run a sample.
campaign: .venv/.ready
	$(RUN) -m tests.campaigns.joints $(ARGS)
	$(RUN) -m tests.campaigns.columns
	$(RUN) -m tests.campaigns.along_x
	$(RUN) -m tests.campaigns.lagrangians
	$(RUN) -m tests.campaigns.attacks
	$(RUN) -m tests.campaigns.workers
	$(RUN) -m tests.campaigns.languages
	$(RUN) -m tests.campaigns.models
	$(RUN) -m tests.campaigns.exports
	$(RUN) -m pytest -q tests -m sample --all-cases

clean:
	rm -rf .venv .venv-oldest .venv-newest .pytest_cache .mypy_cache .ruff_cache .hypothesis .coverage .coverage.*

# Everything is compiled once: where PYTHONDONTWRITEBYTECODE is set, each process of the tests would do it again.
.venv/.ready: requirements.txt pyproject.toml
	@for python in $(CANDIDATES); do \
	    if "$$python" -c '$(SUPPORTED)' 2>/dev/null; then \
	        echo "Setting up .venv with $$python (once; takes a few minutes)"; "$$python" -m venv .venv; exit; \
	    fi; \
	done; echo "Python 3.11 to 3.14 is needed and was not found: set PYTHON to one, as in make PYTHON=/path/to/python3.12 ..." >&2; exit 1
	$(RUN) -m pip install -qq --disable-pip-version-check -r requirements.txt
	$(RUN) -m compileall -q cra_sym tests
	@touch .venv/.ready
