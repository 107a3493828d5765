# make setup | demo | check | test | test-all | test-draws | lint | types | bench | bench-fleet | soak | blind |
#      fuzz | docs | browser | pins | clean
# Needs Python 3.10 to 3.13, git and make. PYTHON=python3.12 chooses the Python of .venv.

# A ROS that is sourced, or another venv with ROS, must not leak into ours.
unexport PYTHONPATH LD_LIBRARY_PATH AMENT_PREFIX_PATH COLCON_PREFIX_PATH
unexport _ROS_WHEELS_BOOTSTRAP_COMPLETE

.DELETE_ON_ERROR:
.PHONY: setup demo docs check test test-numerical test-ros test-all test-draws test-oldest lint types bench bench-fleet soak blind fuzz browser pins clean FORCE

venv := .venv
oldest := .venv-oldest
docs := .venv-docs
python := $(venv)/bin/python
numerical := -m pytest -n 2 --durations 25
# What no numerical library's age can change: packages, pages, nodes, workers and the command line;
# and most searches, of which those of the commands are enough.
not_numerical := $(addprefix --ignore=test/,package report nodes diagnosis \
    fleet/test_local_cores.py commands/test_command_line.py)
# What an installer says is kept, and shown only where it fails.
quietly = > $(venv)/install.log 2>&1 || { cat $(venv)/install.log; exit 1; }

pythons := python3 python3.13 python3.12 python3.11 python3.10
# Those for which scipy 1.11.4 has wheels; ROS 2 Jazzy itself has 3.12.
oldest_pythons := python3.12 python3.11 python3.10 python3
find_oldest := sh tools/find_python.sh 12 $(oldest_pythons)

metadata := package.xml setup.py setup.cfg pyproject.toml
sources := $(shell find bags frac_accel config launch resource scripts -type f ! -name '*.pyc')

setup: install/.done

demo: setup
	@$(python) -m frac_accel.demo --output-dir demo_output

# -W: a link that leads nowhere is an error. Pictures are made anew where their causes are newer.
docs: setup $(docs)/.done
	OPENBLAS_NUM_THREADS=1 $(docs)/bin/python -m sphinx -q -W --keep-going -b html docs site
	@echo site/index.html

# BLAS threads would only fight with the other worker.
check test test-numerical test-ros test-all test-draws test-oldest: export OPENBLAS_NUM_THREADS := 1

# In a minute what catches most.
check: $(venv)/.frac_accel lint types
	$(python) -m pytest -q -n 2 -m fast

# Those that need ROS run beside the others: they wait more than they work, and come before them.
test: setup lint types
	@$(MAKE) --no-print-directory -j 2 -k test-numerical test-ros

test-numerical:
	env -u MAKEFLAGS nice -n 10 $(python) $(numerical) -m "not (ros or thorough or long)"

# Told when they are done.
test-ros:
	@env -u MAKEFLAGS $(python) -m pytest -n 2 -m ros > $(venv)/ros.log 2>&1; failed=$$?; \
	    cat $(venv)/ros.log; exit $$failed

# What make test leaves out but for the further draws: the site, searches and Monte Carlos that take
# long, and what make test runs of numerical tests once more with the oldest libraries, where a
# Python has them. PART=1 to 8: an eighth of those that take long.
test-all: setup docs
	$(python) $(numerical) -m "thorough and not long" $(if $(PART),--splits 8 --group $(PART) \
	    --splitting-algorithm least_duration)
	@if $(find_oldest) >/dev/null; then $(MAKE) --no-print-directory test-oldest; else \
	    echo "so the numerical suite was not run with numpy 1.26.4 and scipy 1.11.4"; fi

# Hours.
test-draws: setup
	$(python) $(numerical) -m "long and not ros"

test-oldest: $(oldest)/.done
	@$(oldest)/bin/python -c 'import numpy, platform, scipy; print("once more with Python", \
	    platform.python_version(), "numpy", numpy.__version__, "scipy", scipy.__version__)'
	$(oldest)/bin/python $(numerical) -m "not (ros or thorough or long)" $(not_numerical)

lint: $(venv)/.done
	$(python) -m ruff check .
	$(venv)/bin/lint-imports --no-cache --no-logo

types: $(venv)/.done
	$(python) -m mypy

# On a quiet machine; what else it was busy with stands in the output.
bench: setup
	$(python) -m frac_accel.cli bench --json bench.json
	$(python) benchmarks

# Hours: 10 000 bags with workers killed at random, weak effects in 100 fleets, changes in 200
# drives, 100 healthy hours, a corrector beside a diagnosis.
# BENCH_FLEET="fleet_bench pooling --draws 5" for a part of it.
bench-fleet: export OPENBLAS_NUM_THREADS := 1
bench-fleet: setup
ifdef BENCH_FLEET
	PYTHONPATH=test:. $(python) -m $(BENCH_FLEET)
else
	for part in "fleet_bench workers" "fleet_bench restart" "fleet_bench pooling" \
	    "monitoring_bench drives" "monitoring_bench healthy" "monitoring_bench beside"; do \
	    PYTHONPATH=test:. $(python) -m $$part || exit; done
endif

# MINUTES=2 for a shorter one; SOAK="--rate 2000 --restart 10" with publishers that come and go.
soak: setup
	$(python) -m frac_accel.bench.soak --minutes $(or $(MINUTES),10) --picture soak.png $(SOAK)

# Hours; goes on where it was stopped. BLIND="single --seed-set 1 --first 2" for a part of it.
blind: export OPENBLAS_NUM_THREADS := 1
blind: setup
	PYTHONPATH=test:. $(python) -m blind $(BLIND)

# Damaged inputs for all commands until Ctrl-C; FUZZ="--first 0 --count 1000" for some of them.
# What goes wrong is kept in fuzz_found/ with its inputs.
fuzz: export OPENBLAS_NUM_THREADS := 1
fuzz: setup
	PYTHONPATH=test:. $(python) -m fuzz $(FUZZ)

# Without a Chromium the tests of the reports in a browser are skipped. No other target touches the
# system: this one is for machines that are ours to change, such as those of continuous integration.
browser:
	@command -v chromium chromium-browser google-chrome || \
	    { [ "$$(id -u)" = 0 ] || { echo "no Chromium here, and only root can install it" >&2; \
	    exit 1; }; apt-get update -q && apt-get install -qy --no-install-recommends chromium; }

pins:
	for minor in 10 11 12 13; do \
	    pythons="$$pythons $$(sh tools/find_python.sh $$minor python3.$$minor)" || exit; done; \
	set -- $$pythons; \
	$$1 tools/pin_requirements.py requirements/venv.in $$1 $$2 $$3 $$4 && \
	$$1 tools/pin_requirements.py requirements/docs.in $$1 $$2 $$3 $$4 && \
	$$1 tools/pin_requirements.py requirements/oldest.in $$1 $$2 $$3

clean:
	rm -rf $(venv) $(oldest) $(docs) site docs/made build install log demo_output *.egg-info .pytest_cache .ruff_cache
	find . -name __pycache__ -prune -exec rm -rf {} +

# A venv is made anew when its pins change, so that an interrupted or outdated one is never used;
# .venv also when the folder has moved or the Python is another.
made_for := $(CURDIR) $(shell $(or $(PYTHON),$(python)) -V 2>/dev/null)
ifneq ($(shell cat $(venv)/.done 2>/dev/null),$(made_for))
$(venv)/.done: FORCE
endif
# uv, which takes a tenth of pip's time; pip where uv has no way to the index that pip is set up for.
# empy comes as source only: setuptools first, then no build isolation, which would fetch another.
$(venv)/.done: requirements/venv.txt
	@echo "installing the pinned packages into $(venv)"
	@found=$$(sh tools/find_python.sh 13 $(or $(PYTHON),$(pythons))) && \
	    rm -rf $(venv) && "$$found" -m venv $(venv)
	@sed -n '/^\(setuptools\|uv\)==/,/[^\\]$$/p' $< > $(venv)/first.txt
	@{ $(python) -m pip install --require-hashes --no-deps -r $(venv)/first.txt && \
	    { $(venv)/bin/uv pip install --python $(python) --no-build-isolation --require-hashes --no-deps -r $< || \
	    $(python) -m pip install --no-build-isolation --use-pep517 --require-hashes --no-deps -r $<; }; \
	    } $(quietly)
	@for shell in sh bash; do cp tools/wheels_setup.sh $(venv)/local_setup.$$shell || exit; done
	@echo "$(CURDIR) $$($(python) -V)" > $@

$(oldest)/.done: requirements/oldest.txt
	found=$$($(find_oldest)) && rm -rf $(oldest) && "$$found" -m venv $(oldest)
	$(oldest)/bin/python -m pip install -q --require-hashes --no-deps -r $<
	touch $@

# What .venv has, and its own packages before it: none of the suite's are exchanged for it.
$(docs)/.done: requirements/docs.txt $(venv)/.done
	rm -rf $(docs) && $(python) -m venv $(docs)
	$(docs)/bin/python -m pip install -q --require-hashes --no-deps -r $<
	$(python) -c 'import sysconfig; print(sysconfig.get_path("purelib"))' \
	    > "$$($(docs)/bin/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))')/venv.pth"
	touch $@

$(venv)/.frac_accel: $(venv)/.done $(metadata)
	@$(python) -m pip install --no-deps --no-build-isolation --editable . $(quietly)
	@touch $@

install/.done: $(venv)/.frac_accel $(sources)
	@echo "building the workspace in install"
	@rm -rf build install
	@AMENT_PREFIX_PATH=$(CURDIR)/$(venv) $(venv)/bin/colcon --log-base build/log build $(quietly)
	@touch $@
