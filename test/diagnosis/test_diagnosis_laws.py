"""Laws of force and filters that no cause says, and noise of the reference: no name is theirs.

The equation of motion is integrated here by Runge and Kutta's rule at 20 times the sampling rate.
"""

import numba
import numpy as np
import pytest
from scipy.signal import cheby1, lfilter

import frac_accel
from frac_accel.model.core import Gain, Oscillator
from frac_accel.model.effects import effect_of

RATE, OVERSAMPLING, SAMPLES = 1000.0, 40, 8000


@numba.njit(cache=True)
def motion(base, step_s, omega, zeta, damping, power, quintic):
    """Motion of the mass; a step spans two samples of the base's acceleration."""
    q, v, out = 0.0, 0.0, np.zeros(len(base))
    for i in range(0, len(base) - 2, 2):
        dq, dv = 0.0, 0.0
        kq, kv = 0.0, 0.0
        for place, weight in ((0.0, 1.0), (0.5, 2.0), (0.5, 2.0), (1.0, 1.0)):
            x, y = q + place * step_s * kq, v + place * step_s * kv
            a = base[i + int(2 * place)]
            speed = abs(y) / omega
            kq = y
            kv = omega**2 * (a - x - quintic * x**5
                             - np.sign(y) * damping * speed**power) - 2 * zeta * omega * y
            dq, dv = dq + weight * kq / 6, dv + weight * kv / 6
        q, v = q + step_s * dq, v + step_s * dv
        out[i + 2] = q
    return out


def shaken(rng, level, highest_hz):
    """Band-limited noise on the fine grid."""
    n = SAMPLES * OVERSAMPLING
    frequency = np.fft.rfftfreq(n, 1 / (RATE * OVERSAMPLING))
    band = (frequency > 2) & (frequency < highest_hz)
    spectrum = band * (rng.standard_normal(len(band)) + 1j * rng.standard_normal(len(band)))
    values = np.fft.irfft(spectrum, n) * np.minimum(np.arange(n) / (0.05 * n), 1.0)
    return values * level / values.std()


def of_law(seed, share_of_noise, **law):
    """Record of an oscillator with a law of force, and the model without it."""
    rng = np.random.default_rng(seed)
    f0, zeta = rng.uniform(120, 180), rng.uniform(0.08, 0.2)
    base = shaken(rng, 20.0, 350.0)
    output = motion(base, 2 / (RATE * OVERSAMPLING), 2 * np.pi * f0, zeta,
                    law.get("damping", 0.0), law.get("power", 1.0), law.get("quintic", 0.0))
    output, reference = output[::OVERSAMPLING], base[::OVERSAMPLING]
    noisy = output + share_of_noise * output.std() * rng.standard_normal(len(output))
    return frac_accel.diagnose((reference, noisy), frac_accel.SensorModel(
        Oscillator(f0, zeta, sensitivity=1.0)), sampling_rate_hz=RATE, time_limit_s=60.0)


def named(found):
    return {finding.cause for finding in found.findings}


@pytest.mark.parametrize("seed", [3501, 3502])
def test_the_simulation_here_is_right(seed):
    found = of_law(seed, 1e-3)
    assert (found.verdict, named(found)) == ("consistent", set())


@pytest.mark.parametrize(("seed", "power"), [(3511, 1.5), (3512, 3.0)])
def test_damping_by_another_power_of_the_speed_is_not_the_quadratic_one(seed, power):
    found = of_law(seed, 0.027, damping=0.06 if power < 2 else 2e-4, power=power)
    assert found.verdict not in ("consistent", "explained")
    assert not named(found) & {"quadratic_damping", "core_parameter_shift", "coulomb_friction"}


@pytest.mark.long  # two to four minutes each
@pytest.mark.parametrize("seed", [3521, 3522])
def test_a_spring_by_the_fifth_power_has_no_hysteresis(seed):
    found = of_law(seed, 0.026, quintic=1.3e-7)
    assert found.verdict not in ("consistent", "explained")
    assert not named(found) & {"hysteresis", "cubic_stiffness"}


def test_a_hysteresis_that_only_bends_is_none():
    cls = effect_of("hysteresis")
    assert cls(0.01, 0.003, -0.1).degenerate({})
    # that of the Bouc-Wen benchmark
    assert not cls(1.0, 800.0, -1100.0).degenerate({})


def test_a_stop_within_every_swing_is_none():
    cls = effect_of("impact_stop")
    # of an output of unit standard deviation
    assert cls(-2e-5, 3.0, 1.0).degenerate({"gap": 0.1})
    assert not cls(1.5, 3.0, 1.0).degenerate({"gap": 0.1})


@pytest.mark.parametrize("seed", [3531, 3532])
def test_one_chebyshev_filter_is_not_three_causes(seed):
    rng = np.random.default_rng(seed)
    reference = shaken(rng, 1.0, 350.0)[::OVERSAMPLING]
    # the corner where a car's sensor has it, for its rate
    output = lfilter(*cheby1(3, 0.5, rng.uniform(125, 225), fs=RATE), reference)
    noisy = output + 0.044 * output.std() * rng.standard_normal(len(output))
    found = frac_accel.diagnose((reference, noisy), frac_accel.SensorModel(Gain(1.0)),
                                sampling_rate_hz=RATE)
    assert len(named(found)) <= 1
    assert not named(found) & {"mounting_resonance", "low_pass_lag"}


@pytest.mark.long  # a minute of processor time each
@pytest.mark.parametrize("seed", [3541, 3542])
def test_noise_of_a_reference_that_rings_through_the_model_is_no_cause(seed):
    rng = np.random.default_rng(seed)
    rate, n, f0, zeta = 10_000.0, 12_000, rng.uniform(2000, 3000), 0.05
    time = np.arange(n * OVERSAMPLING) / (rate * OVERSAMPLING)
    begin, width = 0.7, rng.uniform(1e-3, 2e-3)
    shock = np.where((time > begin) & (time < begin + width),
                     np.sin(np.pi * (time - begin) / width)**2, 0.0) * rng.uniform(2000, 4000)
    output = motion(shock, 2 / (rate * OVERSAMPLING), 2 * np.pi * f0, zeta, 0.0, 1.0, 0.0)
    reference = shock[::OVERSAMPLING] + 0.3 * rng.standard_normal(n)
    sensor = output[::OVERSAMPLING] + rng.standard_normal(n)
    found = frac_accel.diagnose((reference, sensor), frac_accel.SensorModel(
        Oscillator(f0, zeta, sensitivity=1.0)), sampling_rate_hz=rate, time_limit_s=60.0)
    assert (found.verdict, named(found)) == ("consistent", set())
    assert "reference's own noise" in found.reason
