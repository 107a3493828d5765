"""A sensor's clock that is set: the stamps say it, and the reference whether samples are lost."""

import numpy as np
import pytest
from second_set_bench import RATE, Multisine, model

from frac_accel import Corrector, Samples, SensorModel, diagnose, validate

N = 6000


def recorded(rng, step, lost=0, finer=1):
    """Reference and sensor whose stamps jump by a number of sampling intervals, before which as
    many samples are lost as stated, and the jump's first stamp and size [s]."""
    sine, at = Multisine(rng), int(rng.integers(2000, 4000))
    index = np.delete(np.arange(N), np.arange(at, at + lost))
    behind = np.arange(len(index)) >= at
    stamps = np.round(1e9 * (index + step * behind) / RATE)
    values = sine.motion(index / RATE) + 0.005 * rng.normal(size=len(index))
    instants = np.arange(finer * N) / (finer * RATE)
    reference = sine.acceleration(instants)

    def on_x(stamps, values):
        return Samples.of(stamps, np.outer(values, [1, 0, 0]))
    return ((on_x(np.round(1e9 * instants), reference), on_x(stamps, values)),
            1e-9 * stamps[at], step / RATE)


@pytest.mark.parametrize("finer", [1, 2])
@pytest.mark.parametrize("step", [0.3, -0.4, 0.7, 1.0, 4.6, 25.0])
def test_a_clock_that_is_set_loses_no_samples(step, finer):
    rng = np.random.default_rng([int(100 * abs(step)), finer])
    pair, at_s, step_s = recorded(rng, step, finer=finer)
    found = diagnose(pair, model())
    assert [finding.cause for finding in found.findings] == ["time_step"]
    effect, std = found.findings[0].effect, found.findings[0].std
    assert effect.at_s == pytest.approx(at_s, abs=1.8 * std["at_s"])
    assert effect.step_s == pytest.approx(step_s, abs=3 * std["step_s"])
    assert found.extended["nrmse"] < 0.02


def test_the_model_that_was_written_says_the_same_of_its_record():
    pair, *_ = recorded(np.random.default_rng(5), 4.6)
    found = diagnose(pair, model())
    written = SensorModel.from_dict(found.model.to_dict())
    assert validate(pair, written).whole_nrmse == pytest.approx(
        found.extended["nrmse"], rel=0.1)
    assert diagnose(pair, written).verdict == "consistent"


def test_the_corrector_sets_the_stamps_back():
    pair, at_s, step_s = recorded(np.random.default_rng(6), 0.3)
    written = diagnose(pair, model()).model
    corrected = Corrector(written, RATE, noise_std=0.005).process(*pair[1][:2])
    after = corrected.stamps_ns > 1e9 * (at_s + 0.1)
    true = corrected.index[after] / RATE
    np.testing.assert_allclose(1e-9 * corrected.stamps_ns[after], true, atol=2e-8)


@pytest.mark.parametrize("finer", [1, 2])
@pytest.mark.parametrize("lost", [1, 5, 25])
def test_samples_that_are_lost_set_no_clock(lost, finer):
    pair, *_ = recorded(np.random.default_rng([7, lost]), 0.0, lost, finer)
    found = diagnose(pair, model())
    assert {finding.cause for finding in found.findings} <= {"dropped_samples"}
    assert found.extended["nrmse"] < 0.02


@pytest.mark.parametrize("pause", [0.3, 7.3])
def test_stamps_that_are_true_set_no_clock(pause):
    """It sampled a third of an interval later from there on: its stamps say when."""
    rng = np.random.default_rng(8)
    sine = Multisine(rng, band_hz=(1.0, 40.0))
    instants = (np.arange(N) + np.where(np.arange(N) < 2500, 0.0, pause)) / RATE
    pair = [Samples.of(np.round(1e9 * t), np.outer(values, [1, 0, 0])) for t, values in (
        (np.arange(N) / RATE, sine.acceleration(np.arange(N) / RATE)),
        (instants, sine.motion(instants) + 0.005 * rng.normal(size=N)))]
    found = diagnose(pair, model())
    assert {finding.cause for finding in found.findings} <= {"dropped_samples"}
    assert found.extended["nrmse"] < 0.02
    assert any("begin anew, 0.3 of an interval after" in words for words in found.integrity.words)


@pytest.mark.parametrize("step", [0.3, -0.4])
def test_a_clock_that_stamps_both_makes_nothing_late(step):
    pair, *_ = recorded(np.random.default_rng(9), step)
    stamps = pair[1].stamps_ns
    for other in (stamps, stamps + 700_000):  # with its own instants, too
        reference = pair[0]._replace(stamps_ns=other[:len(pair[0].stamps_ns)])
        if other is not stamps:
            sine = Multisine(np.random.default_rng(9))
            reference = reference._replace(values=np.outer(
                sine.acceleration(np.arange(N) / RATE + 7e-4), [1, 0, 0]))
        found = diagnose((reference, pair[1]), model())
        assert [finding.cause for finding in found.findings] == []


def test_a_reference_whose_clock_was_set_is_told():
    (reference, sensor), *_ = recorded(np.random.default_rng(10), 0.0)
    stamps = reference.stamps_ns + np.where(np.arange(N) < 2500, 0, 600_000)
    found = diagnose((reference._replace(stamps_ns=stamps), sensor), model())
    assert found.findings == []
    assert any("the reference's stamps jump by 0.6 ms at 5.0006 s" in words
               for words in found.integrity.words)
