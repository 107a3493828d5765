"""What comes across from other axes is described where it has no name."""

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from frac_accel import diagnose, validate
from frac_accel.commands.diagnose import table
from frac_accel.io.samples import Samples
from frac_accel.model import SensorModel
from frac_accel.model.core import Gain
from frac_accel.report.diagnosis import diagnosis_page

RATE = 100.0


@pytest.mark.thorough
@pytest.mark.parametrize("seed", range(3))
def test_noise_of_one_axis_of_the_reference_filters_that_axis_only(seed):
    """The motion across was guessed by what is there of the own axis's motion, and lost."""
    rng = np.random.default_rng([42, seed])
    motion = rng.normal(size=(6000, 3))
    for axis, band_hz in enumerate(([0.3, 4.0], [0.5, 25.0], [0.5, 30.0])):
        motion[:, axis] = sosfiltfilt(butter(2, band_hz, "band", fs=RATE, output="sos"),
                                      motion[:, axis])
    motion /= motion.std(axis=0)
    shares = rng.uniform(0.1, 0.3, 2) * rng.choice([-1, 1], 2)
    sensor = motion + 0.01 * rng.normal(size=motion.shape)
    sensor[:, 0] += motion[:, 1:] @ shares
    noise = rng.uniform(0.08, 0.12)
    reference = motion + noise * rng.normal(size=motion.shape)
    stamps = np.round(np.arange(len(motion)) * 1e9 / RATE).astype(np.int64)
    record = Samples.of(stamps, reference), Samples.of(stamps, sensor)
    found = diagnose(record, SensorModel(Gain(1.0)), time_limit_s=60)
    effects = {finding.cause: finding.effect for finding in found.findings}
    assert effects.keys() == {"cross_axis_sensitivity", "reference_noise"}
    across = effects["cross_axis_sensitivity"]
    # noise of the other axes makes shares smaller by its part of what they move
    np.testing.assert_allclose([across.y, across.z], shares, rtol=0.03)
    assert validate(record, found.model).whole_nrmse == pytest.approx(
        found.extended["nrmse"], rel=0.2)


@pytest.mark.parametrize("seed", range(3))
def test_shares_of_other_axes_describe_what_hides_behind_more(seed):
    """Two gyroscopes of one body: 3.2 % was left, of which 68 % came across, and 1.3 % is
    possible. Here as much comes across from accelerations, which no cause has, as shares make."""
    rng = np.random.default_rng([41, seed])
    motion = sosfiltfilt(butter(2, [0.3, 3.0], "band", fs=RATE, output="sos"),
                         rng.normal(size=(8000, 3)), axis=0)
    motion /= motion.std(axis=0)
    sensor = motion + 0.003 * rng.normal(size=motion.shape)
    ahead = np.gradient(motion[:, 2])
    sensor[:, 0] += rng.uniform(0.03, 0.06) * motion[:, 1] + 0.03 * ahead / ahead.std()
    stamps = np.round(np.arange(len(motion)) * 1e9 / RATE).astype(np.int64)
    record = Samples.of(stamps, motion), Samples.of(stamps, sensor)
    found = diagnose(record, SensorModel(Gain(1.0)), time_limit_s=60)
    assert not found.findings
    assert found.extended["nrmse"] < 0.035 < found.baseline["nrmse"]
    # told, though nothing is named
    assert f"the extended model leaves {found.extended['rmse']:.4g} " in table(found, "x")
    assert ">extended model</th>" in diagnosis_page(found).html()
    assert validate(record, found.model).whole_nrmse == pytest.approx(
        found.extended["nrmse"], rel=0.2)
