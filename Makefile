# The two commands and the others: sets nox up, which needs a Python 3.11 or 3.13, and calls the sessions of noxfile.py.

# PYTHON=COMMAND chooses the interpreter.
PYTHON ?=
OUT ?= out
PLATFORM ?=
export PYTHON

PYENV_ROOT ?= $(HOME)/.pyenv
UV_ROOT = $(HOME)/.local/share/uv/python
PYTHONS = $(or $(PYTHON),$(foreach version,3.11 3.13,python$(version) $(wildcard \
	$(PYENV_ROOT)/versions/$(version).*/bin/python3 $(UV_ROOT)/cpython-$(version).*/bin/python3)) python3)
RUNNER = .nox/runner$(addprefix -,$(subst /,-,$(PYTHON)))
NOX = $(RUNNER)/bin/python -m nox

.DEFAULT_GOAL := help
.NOTPARALLEL:
.PHONY: help demo test quick doors test-slow test-cluster fuzz lint judges docs weights extension clean distclean

help: ## say what there is
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/  make \1|\2/p' $(MAKEFILE_LIST) | awk -F'|' '{ printf "%-18s %s\n", $$1, $$2 }'
	@echo "  PYTHON=COMMAND chooses the interpreter; the default is the first that fits."

demo: $(RUNNER)/made ## make 600 m of motorway and scan it: out/demo
	@$(NOX) -s demo -- --output $(OUT)/demo

test: $(RUNNER)/made ## check the source and run the tests on both Blender LTS releases
	@$(NOX)

quick: $(RUNNER)/made ## for two minutes, the tests nearest to what changed against the branch main
	@$(NOX) -s quick

test-slow: $(RUNNER)/made ## the tests that take long, all doors, and the documentation's own
	@TEST_MARKERS=slow EVERY_DOOR=yes $(NOX) -s tests doors docs summary

fuzz: $(RUNNER)/made ## readers and commands on files made wrong by chance (SEED=N: others; CASES=N: of commands, 10,000)
	@TEST_MARKERS=fuzz FUZZ_SEED=$(SEED) FUZZ_CASES=$(CASES) $(NOX) -s tests summary

test-cluster: $(RUNNER)/made ## data sets made by a Slurm on this machine (as root; slurmctld, slurmd, munge)
	@TEST_MARKERS=cluster PYTHON=here $(NOX) -s tests summary

doors: $(RUNNER)/made ## run all that users are shown, in environments as they make them, on both releases
	@EVERY_DOOR=yes $(NOX) -s doors summary

lint docs judges: $(RUNNER)/made
	@$(NOX) -s $@
lint: ## check the source: style, who imports whom, types, known dangers
judges: ## have programs of others judge the files that SynthRoads writes
docs: ## build the documentation: build/site/index.html

weights: $(RUNNER)/made ## make the models that come with the package anew (resumable): ml/weights
	@$(NOX) -s weights -- --work $(OUT)/weights

extension: $(RUNNER)/made ## build the Blender extensions: dist/*.zip (PLATFORM=windows-x64, macos-arm64 or all)
	@$(NOX) -s extension -- $(if $(PLATFORM),--platform $(PLATFORM))

# bpy has no wheels for free-threaded Pythons.
$(RUNNER)/made: Makefile
	@for python in $(PYTHONS); do if $$python -c 'import ensurepip, sys, sysconfig, venv; \
	sys.exit(sys.version_info[:2] not in ((3, 11), (3, 13)) or sysconfig.get_config_var("Py_GIL_DISABLED"))' \
	2>/dev/null; then \
	  $$python -m venv --clear $(RUNNER) && \
	  $(RUNNER)/bin/python -m pip install -q --disable-pip-version-check "nox>=2026.10,<2027" && touch $@; exit; \
	fi; done; \
	echo "None of these is a Python 3.11 or 3.13 that can make environments: $(PYTHONS)" >&2; \
	echo "Debian 12 and 13: apt install python3 python3-venv" >&2; exit 1

clean: ## remove what was built, the demo's output and the caches
	rm -rf build dist docs/reference/api $(OUT)/demo .pytest_cache .mypy_cache .ruff_cache .hypothesis *.egg-info __pycache__
	find synthroads_addon headless ml tests tools studies -name __pycache__ -type d -prune -exec rm -rf {} +

distclean: clean ## and the environments too
	rm -rf .venv .nox
