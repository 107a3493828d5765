"""`import frac_accel` in a notebook: bags or arrays, quick to load, results that show."""

import doctest
import importlib
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import frac_accel
from frac_accel import FracAccelError, Samples, SensorModel, read_bag
from frac_accel.io.bag import RAW_TOPIC, REFERENCE_TOPIC
from frac_accel.model.core import Oscillator

BAGS = Path(__file__).parents[2] / "bags"
RATE = 1000.0
MODEL = SensorModel(Oscillator(90.0, 0.2, sensitivity=2.0))
PUBLIC = ("simulation", "streaming.offline", "validation", "identification", "diagnosis",
          "effect_checks", "report.page")


@pytest.fixture(scope="module")
def pair():
    """Motion along x and the output of MODEL with a little noise, shape (n,) each."""
    rng = np.random.default_rng(3)
    motion = np.convolve(rng.normal(size=6000), np.hanning(5), "same")
    return motion, frac_accel.simulate(MODEL, motion, RATE, "x") + 1e-3 * rng.normal(size=6000)


@pytest.mark.parametrize("name", PUBLIC)
def test_examples_of_the_docstrings_run(name, monkeypatch):
    monkeypatch.chdir(BAGS.parent)
    done = doctest.testmod(importlib.import_module(f"frac_accel.{name}"))
    assert done.attempted and not done.failed


@pytest.mark.parametrize("name", frac_accel.__all__)
def test_every_public_name_is_there_and_documented(name):
    assert getattr(frac_accel, name).__doc__
    assert name in dir(frac_accel)


def test_version_is_that_of_the_package():
    assert frac_accel.__version__ == "not installed" or frac_accel.__version__[0].isdigit()
    with pytest.raises(AttributeError, match="nothing_such"):
        _ = frac_accel.nothing_such


def test_import_loads_nothing_yet():
    code = ("import sys, frac_accel; "
            "print(*{n.partition('.')[0] for n in sys.modules} & {'numpy', 'scipy', 'yaml'})")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""


def wide(column):
    """The same along x, and nothing along y and z."""
    return np.stack([column, 0 * column, 0 * column], axis=1)


def test_arrays_samples_and_bags_give_the_same(pair, tmp_path):
    samples = [Samples.of(np.arange(6000) * 1_000_000, wide(column)) for column in pair]
    path = tmp_path / "pair.mcap"
    frac_accel.write_bag(path, dict(zip((REFERENCE_TOPIC, RAW_TOPIC), samples)))
    sources = [(pair, {"sampling_rate_hz": RATE}),
               (tuple(map(wide, pair)), {"sampling_rate_hz": RATE}), (tuple(samples), {}),
               (path, {})]
    values = {"identify": [], "diagnose": [], "validate": [], "correct": []}
    for source, rate in sources:
        found = frac_accel.identify(source, structure="oscillator", **rate)
        values["identify"].append(found.parameters)
        values["diagnose"].append(frac_accel.diagnose(source, MODEL, **rate).as_dict()["baseline"])
        values["validate"].append(frac_accel.validate(source, MODEL, **rate).as_dict())
        raw = source if source is path else source[1]
        values["correct"].append(frac_accel.correct(raw, MODEL, **rate).values.tolist())
    for name, results in values.items():
        assert all(result == results[0] for result in results[1:]), name
    simulated = frac_accel.simulate(MODEL, path)
    np.testing.assert_allclose(simulated.values[:, 0], frac_accel.simulate(MODEL, pair[0], RATE,
                                                                           "x"), atol=1e-9)


def test_several_pairs_of_arrays(pair):
    halves = [tuple(column[part] for column in pair) for part in (slice(3000), slice(3000, None))]
    found = frac_accel.identify(halves, structure="oscillator", sampling_rate_hz=RATE)
    assert len(found.validation.records.records) == 2


ONES = np.ones(1000)
BAD = {
    "no rate": ((ONES, ONES), {}, "sampling_rate_hz"),
    "rate of nothing": ((ONES, ONES), {"sampling_rate_hz": 0}, "sampling_rate_hz"),
    "rate in words": ((ONES, ONES), {"sampling_rate_hz": "fast"}, "sampling_rate_hz"),
    "two columns": ((np.ones((100, 2)), ONES), {"sampling_rate_hz": RATE}, r"\(100, 2\)"),
    "no samples": ((np.ones(0), ONES), {"sampling_rate_hz": RATE}, r"\(0,\)"),
    "not as long": ((ONES, ONES[1:]), {"sampling_rate_hz": RATE}, "1000 and 999"),
    "not finite": ((ONES, np.r_[ONES[:7], np.nan, ONES[8:]]), {"sampling_rate_hz": RATE},
                   "sensor: sample 7"),
    "words": ((ONES, ["a", "b"]), {"sampling_rate_hz": RATE}, "sensor: no array"),
    "axis": ((ONES, ONES), {"sampling_rate_hz": RATE, "axis": "w"}, "axis: 'w'"),
}


@pytest.mark.parametrize("kind", BAD)
@pytest.mark.parametrize("name", ["identify", "diagnose", "validate"])
def test_bad_arrays_are_refused_in_one_line(kind, name):
    source, options, words = BAD[kind]
    given = (source,) if name == "identify" else (source, MODEL)
    with pytest.raises(FracAccelError, match=words) as failure:
        getattr(frac_accel, name)(*given, **options)
    assert "\n" not in str(failure.value)


@pytest.mark.parametrize("kind", [kind for kind in BAD if kind != "not as long"])
def test_bad_samples_are_not_corrected(kind):
    source, options, words = BAD[kind]
    one = source[0] if "shape" in words or "(" in words else source[1]
    with pytest.raises(FracAccelError, match=words):
        frac_accel.correct(one, MODEL, **options)


@pytest.mark.parametrize("source", [None, 3, (ONES,), (ONES, ONES, ONES)])
def test_what_is_no_pair_is_refused(source):
    for name in ("diagnose", "validate"):
        with pytest.raises(FracAccelError, match="expected a bag, or"):
            getattr(frac_accel, name)(source, MODEL)


def test_results_show_themselves(pair):
    rate = {"sampling_rate_hz": RATE}
    for result in (frac_accel.identify(pair, structure="oscillator", **rate),
                   frac_accel.diagnose(pair, MODEL, **rate),
                   frac_accel.validate(pair, MODEL, **rate)):
        assert repr(result).startswith(f"<{type(result).__name__}: ") and len(repr(result)) < 300
        figure = result.plot()
        assert len(figure.axes) == 2 and all(axes.lines for axes in figure.axes)
        page = result._repr_html_()
        assert "data:image/png;base64," in page and "&lt;" in page
    short = frac_accel.diagnose(tuple(column[:400] for column in pair), MODEL, **rate)
    assert "insufficient_data" in repr(short) and short._repr_html_()


def test_bag_of_the_examples_is_read_by_its_path_in_either_form():
    path = BAGS / "soft_mount.mcap"
    model = SensorModel.load(path.with_suffix(".yaml"))
    one, other = (frac_accel.correct(form, model) for form in (path, str(path)))
    np.testing.assert_array_equal(one.values, other.values)
    assert len(read_bag(path)[RAW_TOPIC].values) > len(one.values) > 0
