"""A faulty axis is noticed, said and no longer trusted; a quiet one is left alone."""

import numpy as np
import pytest

from frac_accel import Corrector
from frac_accel.errors import FracAccelError
from frac_accel.model import SensorModel
from frac_accel.streaming.stream import DISTRUSTED

RATE = 500.0
START = 1_700_000_000_000_000_000
AT = 4000


def corrector(effects=(), **options):
    return Corrector(SensorModel.from_dict({
        "schema": "frac_accel/sensor_model/1", "effects": list(effects),
        "core": {"natural_frequency_hz": 80.0, "damping_ratio": 0.3}}), RATE, **options)


def motion(seed, n=8000, step=0.0):
    rng = np.random.default_rng(seed)
    t = np.arange(n)[:, None] / RATE
    values = (2 * np.sin(2 * np.pi * rng.uniform(1, 5, 3) * t) + [0, 0, 9.81]
              + 0.02 * rng.normal(size=(n, 3)))
    return np.round(values / step) * step if step else values


def at_rest(seed, n, step):
    values = [0.0, 0.0, 9.81] + 0.1 * step * np.random.default_rng(seed).normal(size=(n, 3))
    return np.round(values / step) * step


def run(kernel, values, length=100):
    parts, faults = [], []
    for i in range(0, len(values), length):
        stamps = START + np.arange(i, min(i + length, len(values)), dtype=np.int64) * 2_000_000
        parts.append(kernel.process(stamps, values[i:i + length]))
        faults.append(kernel.faults)
    names = ("index", "values", "variance")
    return [np.concatenate([getattr(p, name) for p in parts]) for name in names], faults


def broken(kind, values):
    part = values[AT:, 1]
    if kind == "dead":
        part[:] = 0.0
    elif kind == "dithered":
        part[:] = 3.0 + 1e-9 * np.random.default_rng(0).normal(size=len(part))
    elif kind == "stuck":
        part[:] = part[0]
    elif kind == "held":
        part[1::2] = part[0:-1:2] if len(part) % 2 else part[0::2]
    elif kind == "saturated":
        part[:] = 4.0 + 0.3 * np.random.default_rng(0).random(len(part))
    return values


@pytest.mark.parametrize("value", [0.0, 0.7])
def test_an_axis_that_fails_two_seconds_after_the_start_is_named_at_once(value):
    values = motion(2)
    start = int(2.2 * RATE)
    values[start:, 1] = value
    kernel = corrector(noise_std=0.02)
    (index, _, variance), _ = run(kernel, values)
    assert (variance[index > start + 0.5 * RATE, 1] == DISTRUSTED).all()


@pytest.mark.parametrize("at_s", [0.0, 0.05, 0.13, 0.25, 0.4, 0.9, 1.5])
@pytest.mark.parametrize("value", [0.0, 0.7])
def test_an_axis_that_fails_at_the_start_is_named_within_a_second(value, at_s):
    values = motion(12)
    start = int(at_s * RATE)
    values[start:, 1] = value
    (index, _, variance), faults = run(corrector(noise_std=0.02), values)
    assert faults[-1][1] == ("not connected" if not value + at_s else "stuck" if value else "dead")
    assert (variance[index > start + RATE, 1] == DISTRUSTED).all()
    assert (variance[:, [0, 2]] < 1).all()


@pytest.mark.parametrize("seed", range(3))
def test_a_coarse_axis_at_rest_from_the_start_beside_others_that_move_is_left_alone(seed):
    """For the time that tells it from one that has failed."""
    step = 0.25
    values = motion(seed, 2000, step)
    assert np.mean(np.diff(values[:, 1]) == 0) > 0.3
    values[:, 0] = 0.0981
    values[10, 0] += 0.0981
    _, faults = run(corrector(noise_std=0.1), values)
    assert {f for each in faults for f in each} == {""}


@pytest.mark.parametrize("kind, word, effects", [
    ("dead", "dead", ()), ("stuck", "stuck", ()), ("dithered", "stuck", ()), ("held", "held", ()),
    ("saturated", "saturated", [{"cause": "clipping", "lower": -4.0, "upper": 4.0},
                                ])])
def test_one_axis_that_fails_is_named_and_distrusted(kind, word, effects):
    values = broken(kind, motion(1) - [0, 0, 9.81 * bool(effects)])
    kernel = corrector(effects, noise_std=0.02)
    (index, _, variance), faults = run(kernel, values)
    assert {f for each in faults[:AT // 100] for f in each} == {""}
    assert faults[-1] == ("", word, "")
    late = index > AT + RATE
    assert (variance[late, 1] == DISTRUSTED).all()
    assert (variance[late][:, [0, 2]] < 1).all()
    assert kernel.counters["distrusted"] >= late.sum()


def test_it_is_trusted_again_when_it_is_well():
    values = motion(2)
    values[AT:AT + 1000, 0] = values[AT, 0]
    (index, _, variance), faults = run(corrector(noise_std=0.02), values)
    assert (variance[index > AT + 2000] < 1).all() and faults[-1] == ("", "", "")


def test_no_sample_by_parameter_and_the_sum_holds():
    kernel = corrector(noise_std=0.02, on_fault="drop")
    (index, *_), _ = run(kernel, broken("stuck", motion(3)))
    assert index[-1] < AT + RATE
    counters = kernel.counters
    assert counters["faulty"] > 3000
    assert counters["samples"] == sum(counters[name] for name in (
        "given", "waiting", "warm_up", "cut_off", "duplicates", "stamps_back", "early",
        "not_finite", "implausible", "without_rate", "faulty"))
    reported = corrector(noise_std=0.02, on_fault="report")
    (_, _, variance), faults = run(reported, broken("stuck", motion(3)))
    assert variance.max() < 1 and faults[-1][1] == "stuck"


def test_where_noise_is_not_known_the_fault_still_shows():
    (index, _, variance), _ = run(corrector(), broken("dead", motion(4)))
    late = index > AT + RATE
    assert np.isnan(variance[index < AT - 100]).all()
    assert (variance[late] == DISTRUSTED).all()


@pytest.mark.parametrize("seed", range(6))
def test_a_coarse_sensor_at_rest_or_on_its_way_is_left_alone(seed):
    """A lattice of 0.01 g: half a minute of the same values, then motion, then rest again."""
    step = 0.0981
    rest = at_rest(seed, 15_000, step)
    values = np.concatenate([rest, motion(seed, 4000, step), rest[:2000]])
    _, faults = run(corrector(noise_std=0.03), values)
    assert {fault for each in faults for fault in each} == {""}


@pytest.mark.parametrize("absent", ["z", "yz"])
@pytest.mark.parametrize("on_fault", ["covariance", "drop"])
def test_an_axis_that_a_sensor_does_not_have_withholds_nothing(absent, on_fault):
    """Zero from the first sample on: said, never trusted, and no reason to drop the others."""
    values = motion(7, 8000)
    rows = ["xyz".index(axis) for axis in absent]
    values[:, rows] = 0.0
    kernel = corrector(noise_std=0.02, on_fault=on_fault)
    (index, _, variance), faults = run(kernel, values)
    expected = tuple("not connected" if axis in absent else "" for axis in "xyz")
    assert faults[-1] == expected and {f for f in faults if any(f)} == {expected}
    late = index > 6 * RATE
    assert late.sum() > 4900 and (variance[late][:, rows] == DISTRUSTED).all()
    assert (np.delete(variance, rows, axis=1) < 1).all()
    assert kernel.counters["faulty"] == kernel.counters["distrusted"] == 0


def test_an_axis_that_has_ever_moved_is_dead_and_not_absent():
    values = motion(8)
    values[:, 1] = 0.0
    values[10, 1] = 0.02
    _, faults = run(corrector(noise_std=0.02), values)
    assert faults[-1] == ("", "dead", "")


def test_nothing_that_moves_for_a_minute_is_said():
    values = np.tile([0.0, 0.0981, 9.81], (int(61 * RATE), 1))
    values[0, 0] = 0.0981
    _, faults = run(corrector(), values)
    assert faults[-1] == ("dead", "stuck", "stuck") and faults[290] == ("", "", "")


def test_a_rate_of_change_beyond_the_stated_one():
    values = motion(5)
    values[AT, 2] += 10.0
    _, faults = run(corrector(largest_rate=1000.0), values)
    assert ("", "", "too fast") in faults and faults[-1] == ("", "", "")
    _, faults = run(corrector(), values)
    assert {fault for each in faults for fault in each} == {""}


@pytest.mark.parametrize("kind", ["dead", "held", "stuck"])
def test_the_verdict_does_not_depend_on_the_blocks(kind):
    values = broken(kind, motion(6))
    results = [run(corrector(noise_std=0.02), values, length)[0] for length in (1, 37, 8000)]
    for other in results[1:]:
        assert all(a.tobytes() == b.tobytes() for a, b in zip(results[0], other))


def test_a_word_that_means_nothing_is_refused():
    with pytest.raises(FracAccelError, match="on_fault: 'pray' given"):
        corrector(on_fault="pray")
