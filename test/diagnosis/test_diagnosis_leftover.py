"""A residual counts as noise where it is noise, and not where it follows the signal."""

import numpy as np
import pytest
from scipy.signal import butter, lfilter

from frac_accel.diagnosis.leftover import leftover, related

pytestmark = pytest.mark.long

N = 12_000


def signal(rng, kind):
    """Motion as laboratories make it: noise, a period again and again, bursts, one shock."""
    noise = lfilter(*butter(4, 0.4), rng.normal(size=N))
    if kind == "periods":
        return np.tile(noise[:N // 8], 8)
    if kind == "bursts":
        return noise * np.repeat([1.0, 0.1, 0.5, 2.0], N // 4)
    if kind == "shock":
        return np.exp(-0.5 * ((np.arange(N) - 4000) / 20)**2)
    return noise


def judge(residual, values, step=None):
    used = np.ones(N, bool)
    used[:64] = used[-64:] = False
    return leftover(residual * used, values, used, step=step)


@pytest.mark.parametrize("kind", ["noise", "periods", "bursts", "shock"])
@pytest.mark.parametrize("colour", [0.0, 0.9])
def test_noise_of_any_colour_is_noise(kind, colour):
    for seed in range(25):
        rng = np.random.default_rng([seed, len(kind)])
        values = signal(rng, kind)
        noise = lfilter([1], [1, -colour], rng.normal(size=N))
        assert judge(noise, values).share == 0, seed


@pytest.mark.parametrize("kind", ["noise", "periods", "bursts"])
@pytest.mark.parametrize("effect", [
    lambda values: 0.5 * lfilter([0, 1], [1, -0.8], values),
    lambda values: values * np.sin(2 * np.pi * np.arange(N) / 1700),
    lambda values: np.gradient(values) * np.sin(2 * np.pi * np.arange(N) / 700),
    lambda values: np.maximum(np.abs(values) - 1.5 * np.std(values), 0),
], ids=["lag", "modulated gain", "moving delay", "stop"])
def test_what_follows_the_signal_is_not_noise(kind, effect):
    for seed in range(8):
        rng = np.random.default_rng([seed, len(kind)])
        values = signal(rng, kind)
        extra = effect(values)
        noise = rng.normal(size=N) * np.std(extra) / 3
        found = judge(extra + noise, values)
        assert found.share > 0.5, seed


@pytest.mark.parametrize("kind", ["noise", "periods", "bursts"])
def test_rounding_is_no_more_than_the_lattice_makes_it(kind):
    followed = 0
    for seed in range(20):
        rng = np.random.default_rng([seed, len(kind)])
        values = signal(rng, kind)
        step = rng.uniform(0.3, 3) * np.std(values)
        noisy = values + rng.uniform(0.02, 0.3) * step * rng.normal(size=N)
        rounded = step * np.round(noisy / step)
        followed += judge(rounded - values, values).share > 0
        assert judge(rounded - values, values, step).share == 0, seed
        # what is wrong besides shows through the rounding
        delayed = step * np.round((noisy + lfilter([0, 0.5], [1, -0.8], values)) / step)
        assert judge(delayed - values, values, step).share > 0.3, seed
    assert followed > 5  # as if it were another effect


def test_residual_of_a_shock_is_not_noise():
    rng = np.random.default_rng(5)
    values = signal(rng, "shock")
    ringing = lfilter([1], [1, -1.6, 0.95], np.gradient(values))
    noise = 0.01 * np.max(np.abs(ringing)) * rng.normal(size=N)
    assert judge(ringing + noise, values).share > 0.5


@pytest.mark.parametrize("kind", ["noise", "bursts", "shock"])
def test_unrelated_signals_are_unrelated(kind):
    used = np.ones(N, bool)
    for seed in range(20):
        rng = np.random.default_rng(seed)
        other = signal(rng, kind)
        measured = lfilter(*butter(2, 0.3), rng.normal(size=N))
        assert not related(measured, other, used)[0], seed
        noisy = np.roll(other, 37) + np.std(other) * rng.normal(size=N)
        assert kind == "shock" or related(noisy, other, used)[0], seed
