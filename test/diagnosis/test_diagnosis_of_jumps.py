"""Motion that is over after a second or two, such as a jump on a plate: few samples decide."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfilt, sosfiltfilt

import frac_accel
from frac_accel import SensorModel
from frac_accel.model.core import Gain

RATE, SECONDS, FINER = 200.0, 8.0, 10


def jump(rng):
    """Instants, and the force of a jump after standing: down, up, in the air, landed."""
    time = np.arange(int(RATE * SECONDS)) / RATE
    begins = rng.uniform(2.7, 3.3)
    force = 800 - 400 * np.exp(-((time - begins) / 0.15)**2) \
        + 900 * np.exp(-((time - begins - 0.45) / 0.12)**2)
    flies = (time > begins + 0.62) & (time < begins + 1.1)
    landed = np.maximum(time - begins - 1.1, 0.0)
    force = np.where(flies, 0.0, force) + 6e4 * landed * np.exp(1 - landed / 0.023) \
        + 300 * np.exp(-((time - begins - 1.5) / 0.2)**2)
    sway = sosfiltfilt(butter(2, 3, fs=RATE, output="sos"), rng.standard_normal(len(time)))
    return time, force + np.where(flies, 0.0, 4 * sway / sway.std())


@pytest.mark.parametrize("seed", [3401, 3402, 3403])
def test_a_lag_in_a_jump_is_no_oscillator_with_a_lead(seed):
    """Two lags and a lead that undoes the faster one bend themselves to what a spline between the
    samples has left; the one sample of the landing that holds a sixth of all that the lag does
    left a part of the record without any, in which it was said not to be there."""
    rng = np.random.default_rng(seed)
    time, force = jump(rng)
    corner, offset = rng.uniform(9, 16), rng.uniform(80, 160)
    fine = np.arange((len(time) - 1) * FINER + 1) / RATE / FINER
    between = CubicSpline(time, force)(fine)
    lag = butter(1, corner, fs=RATE * FINER, output="sos")
    late = sosfilt(lag, between - between[0]) + between[0]
    found = frac_accel.diagnose((force, late[::FINER] + offset), sampling_rate_hz=RATE)
    named = {finding.cause: finding for finding in found.findings}
    assert set(named) == {"low_pass_lag", "offset"}
    assert named["low_pass_lag"].effect.corner_hz == pytest.approx(corner, rel=1e-3)
    assert named["offset"].effect.offset == pytest.approx(offset, rel=1e-3)


@pytest.mark.parametrize("while_it_moves", [True, False])
@pytest.mark.parametrize("seed", [3411, 3412])
def test_bursts_that_come_with_the_motion_are_its(seed, while_it_moves):
    rng = np.random.default_rng(seed)
    time = np.arange(2_400) / RATE
    strength = 0.02 + np.exp(-((time - rng.uniform(4, 8)) / 0.7)**2)
    motion = strength * sosfilt(butter(2, 20, fs=RATE, output="sos"),
                                rng.standard_normal(len(time)))
    places = np.flatnonzero((strength > 0.6) == while_it_moves)
    sensor = motion + 1e-3 * motion.std() * rng.standard_normal(len(motion))
    for at in places[np.linspace(0, len(places) - 20, 7).astype(int) + rng.integers(0, 8, 7)]:
        sensor[at:at + 9] += 0.02 * motion.std() * rng.standard_normal(9)
    found = frac_accel.diagnose((motion, sensor), SensorModel(Gain(1.0)), sampling_rate_hz=RATE)
    assert {finding.cause for finding in found.findings} \
        == (set() if while_it_moves else {"interference_bursts"})
