# Needs git, make and Python 3.11; everything else is set up in .venv and .matrix here.
SHELL := /bin/bash
.DEFAULT_GOAL := help
.PHONY: help demo extension test form lint test-convergence test-kernel mutants test-matrix test-window test-proof test-release release docs guide-pictures clean

# An interpreter to use instead of the one that is found: make demo PYTHON=/path/to/python3.11
PYTHON ?=
# The same for Blender 5.2 in `make test-matrix`.
PYTHON313 ?=
# For the message that asks for one.
export GOAL := $(firstword $(MAKECMDGOALS))

ENVIRONMENT := tools/environment .venv
IN_311 := 3.11 PYTHON "$(PYTHON)"
PART := .venv/bin/python tools/run_part.py
# A test that hangs is a failure with its place; none takes a tenth of that. Tests themselves wait up to 240 s.
HANGS := --timeout 300

help: ## print this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "make %-14s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

demo: ## run the paper's session and leave its results and pictures in demo/
	@$(ENVIRONMENT) requirements/demo.txt $(IN_311)
	@.venv/bin/digiclay run ridge_mound_valley --out demo --overwrite --export stl,obj --plots --render

extension: ## build the Blender extension and leave its zip in dist/
	@$(ENVIRONMENT) requirements/demo.txt $(IN_311)
	@.venv/bin/python tools/extension.py

BEHAVIOR := tests/unit tests/property tests/scenes tests/regression
# Modules are compiled once, not again by each process that a test starts.
test: export PYTHONDONTWRITEBYTECODE =
test: ## run the tests of behavior and of file formats, in Blender 4.5 too
	@$(ENVIRONMENT) requirements/test.txt $(IN_311)
	@rm -f .reports/test.txt; status=0; \
	$(PART) .reports/test.txt "tests" 1800 -- $(HANGS) -n auto --dist loadfile $(BEHAVIOR) || status=1; \
	$(PART) .reports/test.txt "tests in Blender 4.5" 1200 -- $(HANGS) -n auto --dist loadfile tests/blender || status=1; \
	awk '/ s of processor time/ { sub(/.*; /, ""); total += $$1 } \
	  END { printf "processor time of make test: %d s, to be kept below 400 s\n", total }' .reports/test.txt >.reports/time.txt; \
	cat .reports/time.txt >>.reports/test.txt; rm .reports/time.txt; \
	echo; cat .reports/test.txt; exit $$status

test-convergence: ## run tests/convergence: errors of integration and fits against references, tolerances and estimates
	@$(ENVIRONMENT) requirements/test.txt $(IN_311)
	@rm -f .reports/convergence.txt; $(PART) .reports/convergence.txt "tests of convergence" 900 -- $(HANGS) -n auto --dist loadfile tests/convergence

test-kernel: ## run tests/regression and tests/convergence on the kernel of numpy's library for unknown processors
	@$(ENVIRONMENT) requirements/test.txt $(IN_311)
	@rm -f .reports/kernel.txt; OPENBLAS_CORETYPE=Prescott $(PART) .reports/kernel.txt "tests on another kernel" 1200 -- $(HANGS) -n auto --dist loadfile tests/regression tests/convergence

lint: ## check style, format and types, and mend nothing
	@$(ENVIRONMENT) requirements/test.txt $(IN_311)
	@.venv/bin/ruff check . && .venv/bin/ruff format --check . && .venv/bin/mypy

# With CHECK=1 what had to be mended is a failure.
CHECK ?=
form: ## mend style, format and generated pages; then check types, layers, names, spelling, pages and texts
	@$(ENVIRONMENT) requirements/test.txt $(IN_311)
	@status=0; .venv/bin/python tools/mend_form.py $(if $(CHECK),--check) || status=1; \
	rm -f .reports/form.txt; $(PART) .reports/form.txt "form" 300 -- $(HANGS) -n auto tests/form || status=1; exit $$status

# All mutants of some modules: make mutants MODULES="model.valve steppers.bernoulli"
MODULES ?=
mutants: ## change the core's physics, engine, control and metrics here and there, and list what no test notices
	@$(ENVIRONMENT) requirements/mutation.txt $(IN_311)
	@mkdir -p .reports; set -o pipefail; .venv/bin/python tools/mutants.py --most 0.21 $(MODULES) | tee .reports/mutants.txt

# Some of them: make test-matrix BLENDERS="4.2 5.2"
BLENDERS ?= 4.2 4.5 5.0 5.2
test-matrix: ## run tests/blender in Blender 4.2, 4.5, 5.0 and 5.2
	@PYTHON="$(PYTHON)" PYTHON313="$(PYTHON313)" tools/matrix $(BLENDERS)

# With WHOLE=1 a skipped test is a failure, for instance where DIGICLAY_BLENDER_DISPLAY is not set.
WHOLE ?=
# What the screen with a pen is built of and runs by: see tests/window/tablet.
PEN_FILES := gcc pkg-config /usr/lib/xorg/Xorg /usr/lib/xorg/modules/drivers/dummy_drv.so /usr/include/xorg/xf86Xinput.h
PEN_PACKAGES := gcc libc6-dev pkg-config xserver-xorg-core xserver-xorg-video-dummy xserver-xorg-dev
test-window: ## run tests/window in the Blender named by DIGICLAY_BLENDER_WINDOW
	@[ -n "$$DIGICLAY_BLENDER_WINDOW" ] || { echo "DIGICLAY_BLENDER_WINDOW must name the command of a Blender with a window." >&2; exit 1; }
	@$(ENVIRONMENT) requirements/test.txt $(IN_311)
	@[ -z "$$DIGICLAY_BLENDER_DISPLAY" ] || tools/programs .reports/pen.log "$(PEN_FILES)" "$(PEN_PACKAGES)" || true
	@rm -f .reports/window.txt; $(PART) .reports/window.txt "tests in Blender's window" 2700 $(if $(WHOLE),--whole) -- tests/window

guide-pictures: ## follow the tutorial and the guide in a window, and retake their pictures and film
	@[ -n "$$DIGICLAY_BLENDER_WINDOW" ] || { echo "DIGICLAY_BLENDER_WINDOW must name the command of a Blender with a window." >&2; exit 1; }
	@$(ENVIRONMENT) requirements/test.txt $(IN_311)
	@rm -rf .reports/guide; DIGICLAY_SCREENSHOTS=$(CURDIR)/.reports/guide .venv/bin/python -m pytest tests/window/test_first_minute.py tests/window/test_press_tool.py
	@.venv/bin/python tools/doc_pictures.py --guide .reports/guide

test-proof: ## judge exports by admesh, assimp and PrusaSlicer, which root installs on Debian, job templates by openjd, studies by grids; reproduce the paper
	@tools/programs .reports/proof.log "admesh assimp prusa-slicer" "admesh assimp-utils prusa-slicer"
	@$(ENVIRONMENT) requirements/proof.txt $(IN_311)
	@rm -f .reports/proof.txt; $(PART) .reports/proof.txt "exports and job templates judged by other programs, studies by grids, the paper" 600 -- $(HANGS) -n auto --dist loadfile tests/proof

docs: ## build the site in site/, without a warning, and check it: links, search in a browser, commands of all pages
	@$(ENVIRONMENT) requirements/docs.txt $(IN_311)
	@tools/programs .reports/docs.log "chromium chromedriver" "chromium chromium-driver"
	@NO_MKDOCS_2_WARNING=1 .venv/bin/mkdocs build --quiet
	@rm -f .reports/docs.txt; $(PART) .reports/docs.txt "the site: links, search, commands of all pages" 1500 -- -n auto tests/site

test-release: ## release a copy, and run its wheel in bare Pythons 3.11, 3.12, 3.13 with lowest and highest libraries
	@$(ENVIRONMENT) requirements/release.txt $(IN_311)
	@rm -f .reports/release.txt; PYTHON311="$(PYTHON)" PYTHON313="$(PYTHON313)" $(PART) .reports/release.txt "release, and its wheel in bare Pythons" 1200 -- -n 2 --dist loadfile tests/release

# The version in the files and in the changelog: make release VERSION=0.2.0
VERSION ?=
release: ## check, build twice, tag: zip, wheel, source archive and checksums in dist/digiclay-VERSION
	@[ -n "$(VERSION)" ] || { echo "VERSION must be named: make release VERSION=0.2.0" >&2; exit 1; }
	@$(ENVIRONMENT) requirements/release.txt $(IN_311)
	@.venv/bin/python tools/make_release.py "$(VERSION)"

clean: ## remove all that make made
	rm -rf .venv .matrix .reports demo build dist site addon/*.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find addon benchmarks digiclay_fit digiclay_paper digiclay_serve digiclay_study tests tools -name __pycache__ -type d -prune -exec rm -rf {} +
