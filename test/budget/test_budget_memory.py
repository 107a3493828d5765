"""The budget of what remembers for long: slow linear relations, curves before a resonance, gains
that follow the level or a tone. Simulated here with numpy; the true share of power is known."""

import numpy as np
import pytest
import scipy.signal as sig
from budget_cases import excitation, noise

from frac_accel.budget import error_budget

RATE = 200.0


def budget(residual, simulated, reference):
    if reference.ndim == 1:
        reference = np.c_[reference, np.zeros((len(reference), 2))]
    return error_budget(residual, simulated + residual, simulated, reference,
                        np.ones(len(residual), bool), RATE, 0)


def beside_noise(values, share, rng, colour=0.0):
    """A part with so much of the power, and noise with the rest."""
    return (np.sqrt(share) * values / np.sqrt(np.mean(values**2))
            + np.sqrt(1 - share) * noise(rng, len(values), colour))


def bent_by(curve, x):
    """What a curve adds that no filter of normally distributed motion would take (Bussgang)."""
    values = curve(x)
    return values - values.mean() - x * (x @ values) / (x @ x)


def resonant(x, natural=0.7, damping=0.1):
    pole = np.exp((-damping + 1j * np.sqrt(1 - damping**2)) * natural)
    a = np.real(np.poly([pole, pole.conj()]))
    return sig.lfilter([a.sum()], a, x)


def gusts(rng, n, time=800, strength=0.7):
    """A level that wanders within some hundred samples."""
    keep = np.exp(-1 / time)
    walk = sig.lfilter([np.sqrt(1 - keep**2)], [1, -keep], rng.normal(size=n + 5000))[5000:]
    return np.exp(strength * walk)


def says(found, part, share, within=0.03, beyond=0.01):
    assert found.share(part) == pytest.approx(share, abs=within)
    entry = next(entry for entry in found.parts if entry["part"] == part)
    assert entry["ci95"][0] - beyond <= share <= entry["ci95"][1] + beyond


@pytest.mark.parametrize("side", ["reference", "sensor"])
@pytest.mark.parametrize("seed", range(4))
def test_a_high_pass_far_below_the_motion_is_linear(seed, side):
    """Its memory is longer than any filter that is tried; a sweep, and noise from one octave up."""
    rng = np.random.default_rng([seed, 1])
    n = 12_000
    corner = rng.uniform(0.1, 0.4)
    t = np.arange(n + 4000) / RATE
    motion = np.sin(2 * np.pi * np.cumsum(np.geomspace(0.4, 20, len(t))) / RATE) if seed % 2 else \
        sig.sosfilt(sig.butter(2, [0.4, 30], "bandpass", fs=RATE, output="sos"), rng.normal(
            size=len(t)))
    passed = sig.sosfilt(sig.butter(1, corner, "highpass", fs=RATE, output="sos"), motion)
    motion, passed = motion[4000:], passed[4000:]
    reference, sensor = (passed, motion) if side == "reference" else (motion, passed)
    gain = reference @ sensor / (reference @ reference)
    share = rng.uniform(0.5, 0.95)
    e = 0.1 * beside_noise(sensor - gain * reference, share, rng)
    found = budget(e, gain * reference, reference)
    # the slowest motion cannot be told from a drift
    assert found.share("linear") + found.share("slow") == pytest.approx(share, abs=0.03)
    assert found.share("noise") == pytest.approx(1 - share, abs=0.03)


@pytest.mark.parametrize("colour", [0.999, 1.0])
@pytest.mark.parametrize("seed", range(4))
def test_noise_that_wanders_is_no_motion_that_was_summed(seed, colour):
    """Both are random walks: without guard against it the one fits the other."""
    rng = np.random.default_rng([seed, 2])
    reference, y = excitation(rng, 8000)
    e = sig.lfilter([1.0], [1.0, -colour], rng.normal(size=8000))
    found = budget(e - e.mean(), y, reference)
    assert found.share("linear") + found.share("time_varying") < 0.02


CURVES = {"dead_zone": lambda x: np.clip(x, -0.2, 0.2), "saturation": np.tanh,
          "coulomb": np.sign, "square_law": lambda x: x * np.abs(x)}


@pytest.mark.parametrize("curve", CURVES)
@pytest.mark.parametrize("seed", range(3))
def test_a_curve_before_a_resonance_is_odd(seed, curve):
    rng = np.random.default_rng([seed, 3])
    x = sig.sosfilt(sig.butter(3, [0.02, 0.6], "bandpass", output="sos"), rng.normal(size=10_500))
    x /= x.std()
    y = resonant(x)[500:]
    bent = resonant(bent_by(CURVES[curve], x))[500:]
    share = rng.uniform(0.5, 0.9)
    found = budget(0.03 * beside_noise(bent, share, rng, 0.5), y, x[500:])
    # where the motion has nothing, the record does not show how the sensor rings
    says(found, "odd", share, 0.05, 0.04)


@pytest.mark.parametrize("seed", range(3))
def test_a_rectifier_before_a_resonance_is_even(seed):
    rng = np.random.default_rng([seed, 4])
    x = sig.sosfilt(sig.butter(3, [0.02, 0.6], "bandpass", output="sos"), rng.normal(size=10_500))
    bent = resonant(bent_by(np.abs, x))[500:]
    found = budget(0.03 * beside_noise(bent, 0.7, rng), resonant(x)[500:], x[500:])
    says(found, "even", 0.7)


@pytest.mark.parametrize("law", ["power", "root"])
@pytest.mark.parametrize("seed", range(4))
def test_a_gain_that_follows_the_level_is_time_varying(seed, law):
    rng = np.random.default_rng([seed, 5])
    n = 16_000
    reference, y = excitation(rng, n)
    y = y * gusts(rng, n) / y.std()
    keep = np.exp(-1 / rng.uniform(100, 600))
    level = sig.lfilter([1 - keep], [1, -keep], y**2)
    gain = level if law == "power" else np.sqrt(level)
    changes = y * gain - y * (y @ (y * gain)) / (y @ y)
    share = rng.uniform(0.4, 0.9)
    found = budget(0.02 * beside_noise(changes, share, rng, 0.3), y, np.c_[y, reference[:, 1:]])
    says(found, "time_varying", share, 0.06)


@pytest.mark.parametrize("seed", range(4))
def test_a_curve_is_odd_though_the_level_changes(seed):
    rng = np.random.default_rng([seed, 6])
    _, y = excitation(rng, 16_000)
    y = y * gusts(rng, 16_000) / y.std()
    bent = bent_by((np.tanh, lambda x: x**3)[seed % 2], y)
    found = budget(0.02 * beside_noise(bent, 0.7, rng), y, y)
    says(found, "odd", 0.7, 0.05)
    assert found.share("time_varying") < 0.03


@pytest.mark.parametrize("seed", range(4))
def test_noise_that_grows_with_the_motion_is_noise(seed):
    rng = np.random.default_rng([seed, 7])
    _, y = excitation(rng, 8000)
    level = gusts(rng, 8000, strength=0.5)
    found = budget(0.02 * level * noise(rng, 8000, 0.5), y * level, y * level)
    assert found.share("noise") > 0.95


@pytest.mark.parametrize("what", ["gain", "timing"])
@pytest.mark.parametrize("seed", range(4))
def test_a_gain_that_changes_with_a_tone_is_time_varying(seed, what):
    """Also beside the tone itself, which is no part of it."""
    rng = np.random.default_rng([seed, 8])
    n = 8000
    reference, y = excitation(rng, n)
    tone = np.sin(2 * np.pi * rng.uniform(0.004, 0.3) * np.arange(n) + 1)
    share, hum = rng.uniform(0.3, 0.8), 0.1
    changes = tone * (y if what == "gain" else np.gradient(y))
    rest = beside_noise(changes, share, rng, 0.5) * np.sqrt(1 - hum) + tone * np.sqrt(2 * hum)
    found = budget(0.03 * rest, y, reference)
    says(found, "time_varying", share * (1 - hum))
    says(found, "lines", hum, 0.02)
