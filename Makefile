# `make metrics` and `make test` set up everything that they need; the second time they start at once.
PYTHON ?= $(shell command -v python3.11 || command -v python3)
CORES ?= 2
VENV := .venv
RUN := . $(VENV)/bin/activate &&
SOURCES := Snakefile workflow/rules/*.smk

.PHONY: metrics test setup setup-dev lint types kernel docs lock clean help

metrics: setup ## images to solids and results/metrics.csv, on the objects of config/config.yaml
	$(RUN) snakemake --cores $(CORES) results/metrics.csv

test: setup-dev ## all tests
	$(RUN) python -m pytest -n $(CORES) --dist loadfile

setup: $(VENV)/.runtime kernel ## the virtual environment and the compiled kernel

setup-dev: $(VENV)/.dev kernel

$(VENV)/bin/python:
	sh envs/system.sh $(PYTHON)
	$(PYTHON) -m venv $(VENV)

$(VENV)/.runtime: envs/requirements.txt envs/system-packages.txt pyproject.toml | $(VENV)/bin/python
	sh envs/system.sh $(PYTHON)
	$(RUN) pip install --quiet --disable-pip-version-check --requirement envs/requirements.txt setuptools
	$(RUN) pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	touch $@

$(VENV)/.dev: $(VENV)/.runtime envs/requirements-dev.txt
	$(RUN) pip install --quiet --disable-pip-version-check --requirement envs/requirements-dev.txt
	touch $@

kernel: $(VENV)/.runtime ## the C++ renderer, in build/
	$(RUN) python -m brepgaussian.splatting.build

lint: setup-dev ## style of Python and Snakemake code
	$(RUN) ruff check . && ruff format --check .
	$(RUN) snakefmt --check $(SOURCES)
	$(RUN) snakemake --lint

types: setup-dev ## type hints
	$(RUN) mypy

docs: setup-dev ## the schema, config/README.md and the graph in docs/workflow.md, from the code
	$(RUN) python -m brepgaussian.settings.schema
	$(RUN) snakemake --cores 1 --rulegraph mermaid-js 2>/dev/null > .venv/rulegraph && \
	  python -c "import re, pathlib; p = pathlib.Path('docs/workflow.md'); g = open('.venv/rulegraph').read(); \
	  p.write_text(re.sub(r'(\`{3}mermaid\n).*?(\`{3})', lambda m: m[1] + g + m[2], p.read_text(), flags=re.S))"

lock: ## renew the locked requirements in a fresh environment
	rm -rf build/lock && $(PYTHON) -m venv build/lock
	for name in requirements requirements-dev; do \
	  build/lock/bin/pip install --quiet --requirement envs/$$name.in && \
	  { echo "# Locked by \`make lock\` from $$name.in; Python 3.11."; \
	    build/lock/bin/pip freeze | sed 's/+cpu//'; } > envs/$$name.txt; done
	build/lock/bin/python envs/conda.py

clean: ## results and everything built, but not the environment
	rm -rf results logs benchmarks build .snakemake

help:
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed 's/:.*##/\t/'
