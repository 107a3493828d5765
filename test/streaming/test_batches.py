"""Samples that share a stamp, as drivers that read a queue publish them, are corrected as if each
had its own."""

import functools

import numpy as np
import pytest
import rig
import rig.record
import scipy.interpolate
import yaml

from frac_accel import Corrector, SensorModel, diagnose, validate
from frac_accel.cli import main
from frac_accel.io.bag import RAW_TOPIC, REFERENCE_TOPIC, Samples, read_bag, write_bag
from frac_accel.record.clock import usable
from frac_accel.streaming.batches import LONGEST

RATE = 1000.0
START = rig.record.START_NS
N = 6000
SENSOR = rig.Sensor({"type": "oscillator", "natural_frequency_hz": 180.0, "damping_ratio": 0.15,
                     "damping_order": 1.0, "sensitivity": 2.0})
MODEL = SensorModel.from_dict(SENSOR.to_model())


@functools.cache
def recorded():
    rng = np.random.default_rng(7)
    excitation = rig.band_noise(rng, RATE, N / RATE, (2.0, 150.0), lead_s=0.5)
    return rig.simulate_record(SENSOR, excitation, rng, snr_db=50.0)


def batched(size, rng=None, scatter=0.0, jitter_s=0.0):
    """Stamps of batches of `size` samples (drawn by up to `scatter` of it), read on their end."""
    stamps = START + np.round(np.arange(N) * 1e9 / RATE).astype(np.int64)
    if not scatter:
        last = np.minimum(np.arange(N) // size * size + size - 1, N - 1)
    else:
        sizes = np.maximum(1, np.round(size * rng.uniform(1 - scatter, 1 + scatter, N))).astype(int)
        ends = np.cumsum(sizes)
        last = np.minimum(ends[np.searchsorted(ends, np.arange(N), "right")] - 1, N - 1)
    stamps = stamps[last]
    if jitter_s:
        late = rng.exponential(jitter_s, N)
        stamps = np.maximum.accumulate(stamps + np.round(1e9 * late[last]).astype(np.int64))
    return stamps


def run(stamps, rate=0.0, values=None, blocks=1, model=MODEL):
    record = recorded()
    values = record.sensor if values is None else values
    kernel = Corrector(model, rate, noise_std=record.noise_std)
    edges = np.linspace(0, len(stamps), blocks + 1).astype(int)
    parts = [kernel.process(stamps[a:b], values[a:b]) for a, b in zip(edges[:-1], edges[1:])]
    parts.append(kernel.finish())
    result = [np.concatenate([getattr(part, name) for part in parts])
              for name in ("index", "stamps_ns", "values", "variance")]
    total = sum(kernel.counters[name] for name in (
        "given", "waiting", "warm_up", "cut_off", "duplicates", "stamps_back", "early",
        "not_finite", "implausible", "without_rate", "faulty"))
    assert total == kernel.counters["samples"] == len(stamps)
    return kernel, *result


def share_within(stamps, values, variance):
    """Share of the values within two stated deviations of the motion at their stamps."""
    record = recorded()
    motion = scipy.interpolate.make_interp_spline(1e-9 * (record.stamps_ns - START),
                                                  record.reference, 7)
    return np.mean(np.abs(values - motion(1e-9 * (stamps - START))) < 2 * np.sqrt(variance))


@pytest.mark.parametrize("size, scatter", [(2, 0.0), (7, 0.5), (64, 0.3), (300, 0.0)])
@pytest.mark.parametrize("rate", [0.0, RATE])
def test_each_sample_gets_its_own_instant_and_the_variance_holds(size, scatter, rate):
    kernel, index, stamps, values, variance = run(
        batched(size, np.random.default_rng(size), scatter), rate)
    assert kernel.sampling_rate_hz == pytest.approx(RATE, rel=1e-9)
    # a stated rate filters at once, and sees then that stamps are shared
    most = 50 + (2 * size if rate else 0)
    assert len(index) > N - most
    np.testing.assert_allclose(stamps, recorded().stamps_ns[index], atol=2)
    assert 0.93 < share_within(stamps, values, variance) < 0.98
    assert kernel.batch_size == pytest.approx(size, rel=0.4)


@pytest.mark.parametrize("size, jitter_s", [(4, 5e-5), (32, 1e-3)])
def test_late_stamps_move_the_instants_by_less_than_they_are_late(size, jitter_s):
    stamps = batched(size, np.random.default_rng(size), jitter_s=jitter_s)
    _, index, found, *_ = run(stamps, RATE)
    off = 1e-9 * (found - recorded().stamps_ns[index])
    assert len(index) > N - 100
    assert np.std(off) < 0.7 * jitter_s and abs(np.mean(off) - jitter_s) < 0.5 * jitter_s


@pytest.mark.parametrize("rate", [0.0, RATE])
def test_blocks_change_nothing(rate):
    rng = np.random.default_rng(3)
    stamps = batched(9, rng, 0.5, 2e-4)
    stamps[3000:3200] = stamps[3000]        # and nothing of it where stamps go wrong
    stamps[4000:] -= 10**9
    whole = run(stamps, rate)[1:]
    for blocks in (N, 611):
        for mine, theirs in zip(whole, run(stamps, rate, blocks=blocks)[1:]):
            np.testing.assert_array_equal(mine, theirs)


@pytest.mark.parametrize("lost", [10, 20])
def test_a_lost_batch_is_a_gap(lost):
    stamps = batched(10)
    kept = np.delete(np.arange(N), np.arange(3000, 3000 + lost))
    kernel, index, found, values, variance = run(stamps[kept], values=recorded().sensor[kept])
    assert kernel.counters["filled"] + kernel.counters["cut_off"] + kernel.counters["warm_up"] >= 10
    np.testing.assert_allclose(found, recorded().stamps_ns[kept[index]], atol=2)
    assert 0.93 < share_within(found, values, variance) < 0.98


@pytest.mark.parametrize("rate", [0.0, RATE])
def test_a_loss_while_the_rate_is_estimated_does_not_bend_it(rate):
    kept = np.delete(np.arange(N), np.arange(150, 190))
    kernel, index, *found = run(batched(10)[kept], values=recorded().sensor[kept])
    assert kernel.sampling_rate_hz == pytest.approx(RATE, rel=1e-9)
    assert 0.93 < share_within(*found) < 0.98


def test_samples_that_rest_on_one_level_are_of_the_batch():
    values = 4.0 * np.round(recorded().sensor / 4.0)
    assert np.mean((np.diff(values, axis=0) == 0).all(axis=1)) > 0.05
    kernel, index, stamps, *_ = run(batched(10), values=values)
    np.testing.assert_allclose(stamps, recorded().stamps_ns[index], atol=2)
    assert not kernel.counters["duplicates"]
    assert usable(Samples.of(batched(10), values)).all()


def test_stamps_that_no_longer_advance_are_no_batch():
    stamps = batched(10)
    stamps[2000:] = stamps[2000]
    kernel, index, *_ = run(stamps, RATE)
    assert index[-1] < 2000 + 10 * LONGEST
    assert kernel.counters["duplicates"] > N - 2100
    assert len(kernel.waiting) < 100 and not kernel.batch_size


def test_two_sensors_with_common_stamps_are_no_batches_at_the_stated_rate():
    """As ever: the first of the samples with one stamp."""
    stamps = np.repeat(recorded().stamps_ns[:N // 2], 2)
    values = np.repeat(recorded().sensor[:N // 2], 2, axis=0)
    values[1::2] += 3.0
    kernel, index, *found = run(stamps, RATE, values=values)
    assert not (index % 2).any() and kernel.counters["duplicates"] == N // 2
    assert 0.93 < share_within(*found) < 0.98


def test_copies_of_a_message_are_no_batch():
    stamps, values = (np.repeat(part[:N // 2], 2, axis=0) for part in (
        recorded().stamps_ns, recorded().sensor))
    kernel, index, *_ = run(stamps, values=values)
    assert kernel.sampling_rate_hz == pytest.approx(RATE) and not (index % 2).any()


@pytest.fixture
def bags(tmp_path):
    """The same record, each sample with its own stamp and in batches."""
    record = recorded()
    for name, stamps in (("own", record.stamps_ns), ("batched", batched(16))):
        write_bag(tmp_path / f"{name}.mcap", {
            REFERENCE_TOPIC: Samples.of(record.stamps_ns, record.reference),
            RAW_TOPIC: Samples.of(stamps, record.sensor)})
    (tmp_path / "m.yaml").write_text(yaml.safe_dump(SENSOR.to_model()))
    return tmp_path


def test_validate_says_the_same_of_batches(bags):
    own, shared = (validate(bags / f"{name}.mcap", MODEL) for name in ("own", "batched"))
    assert shared.counters["given"] == own.counters["given"]
    for name in ("corrected", "scaled"):
        mine, theirs = (getattr(each.comparison, name).total.nrmse for each in (shared, own))
        assert mine == pytest.approx(theirs, rel=1e-3)
    assert shared.simulation.total.nrmse == pytest.approx(own.simulation.total.nrmse, rel=1e-2)


def test_diagnose_takes_batches_whose_stamps_scatter():
    record = recorded()
    stamps = batched(10, np.random.default_rng(5), jitter_s=2e-4)
    found = diagnose((Samples.of(record.stamps_ns, record.reference),
                      Samples.of(stamps, record.sensor)), MODEL)
    assert any("batches" in words for words in found.integrity.words)
    assert any("scatter" in words for words in found.integrity.words)
    assert {finding.cause for finding in found.findings} <= {"timestamp_jitter", "time_delay"}


def test_correct_gives_each_sample_of_a_batch(bags, capsys):
    for name in ("own", "batched"):
        assert main(["correct", str(bags / f"{name}.mcap"), "--model", str(bags / "m.yaml"), "-o",
                     str(bags / f"{name}_out.mcap"), "--report", str(bags / f"{name}.html")]) == 0
    said = capsys.readouterr().out
    assert said.count("at a time with one stamp") == 1
    own, shared = (read_bag(bags / f"{name}_out.mcap", ["/imu/data"])["/imu/data"]
                   for name in ("own", "batched"))
    np.testing.assert_allclose(shared.stamps_ns, own.stamps_ns, atol=2)
    np.testing.assert_array_equal(shared.values, own.values)
    assert "is shown without its reference" not in (bags / "batched.html").read_text()
