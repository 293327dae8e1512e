# Every target does its own set-up: it needs make and a Python 3.11 or 3.13, nothing else.
# PYTHON=COMMAND chooses the interpreter.

PYTHON ?=
OUT ?= out
PLATFORM ?=
# Extras of the two test environments: `ml` in the first only, as on Linux PyPI's torch comes with gigabytes of CUDA.
EXTRAS_3_11 ?= blender,dev,judges,ml
EXTRAS_3_13 ?= blender,dev,judges

export PYTHON
ENVIRONMENT = sh tools/any_env.sh

.DEFAULT_GOAL := help
.NOTPARALLEL:
.PHONY: help demo test test-slow lint docs extension clean distclean

help: ## say what there is
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/  make \1|\2/p' $(MAKEFILE_LIST) | awk -F'|' '{ printf "%-18s %s\n", $$1, $$2 }'
	@echo "  PYTHON=COMMAND chooses the interpreter; the default is the first that fits."

demo: ## make 600 m of motorway and scan it: out/demo
	@python=$$($(ENVIRONMENT) blender) && \
	"$$python" -m headless.generate --scenario rq31-600m --output $(OUT)/demo --overwrite

test: ## check the source and run the tests on both Blender LTS releases
	@sh tools/run_tests.sh "$(EXTRAS_3_11)" "$(EXTRAS_3_13)" "not slow"

test-slow: ## the tests that take long, and the documentation's own
	@sh tools/run_tests.sh "$(EXTRAS_3_11)" "$(EXTRAS_3_13)" "slow"
	@$(MAKE) --no-print-directory docs

lint: ## check the source: ruff and mypy
	@python=$$($(ENVIRONMENT) dev,ml) && "$$python" tools/lint.py

# Whatever the generator complains of is a failure: a link that leads nowhere, a page that is missing or in no menu.
docs: ## build the documentation: build/site/index.html
	@python=$$($(ENVIRONMENT) docs) && \
	"$$python" -m sphinx --jobs auto --fresh-env --fail-on-warning --quiet --doctree-dir build/doctrees docs build/site && \
	echo "built build/site/index.html"

extension: ## build the Blender extensions: dist/*.zip (PLATFORM=windows-x64, macos-arm64 or all)
	@python=$$($(ENVIRONMENT) blender) && \
	"$$python" tools/build_extension.py $(if $(PLATFORM),--platform $(PLATFORM))

clean: ## remove what was built, the demo's output and the caches
	rm -rf build dist docs/reference/api $(OUT)/demo .pytest_cache .mypy_cache .ruff_cache .hypothesis *.egg-info
	find synthroads_addon headless ml tests tools -name __pycache__ -type d -prune -exec rm -rf {} +

distclean: clean ## and the environments too
	rm -rf .venv-3.11 .venv-3.13
