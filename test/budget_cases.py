"""Residuals whose parts are known exactly, made without the package."""

import numpy as np
import scipy.signal as sig

KINDS = ("linear", "across", "even", "odd", "time_varying", "lines", "bursts", "slow")


def excitation(rng, n, axes=3):
    """Band noise on each axis, shape (n, axes), and a sensor's output of the first."""
    low, high = rng.uniform(0.005, 0.03), rng.uniform(0.1, 0.7)
    sos = sig.butter(4, [low, high], "bandpass", output="sos")
    reference = sig.sosfilt(sos, rng.normal(size=(n + 500, axes)), axis=0)
    natural, damping = np.pi * rng.uniform(0.1, 0.5), rng.uniform(0.1, 0.7)
    pole = np.exp((-damping + 1j * np.sqrt(1 - damping**2)) * natural)
    a = np.real(np.poly([pole, pole.conj()]))
    return reference[500:], sig.lfilter([a.sum()], a, reference[:, 0])[500:]


def noise(rng, n, colour):
    """White (colour 0) or autoregressive noise of unit power."""
    values = sig.lfilter([1.0], [1.0, -colour], rng.normal(size=n + 500))[500:]
    return values / np.sqrt(np.mean(values**2))


def component(kind, rng, reference, y):
    """A residual of one kind, of unit power."""
    n = len(y)
    t = np.arange(n) / n
    if kind in ("linear", "across"):
        source = reference[:, 0 if kind == "linear" else 1]
        taps = rng.normal(size=20) * np.exp(-np.arange(20) / rng.uniform(1, 6))
        values = np.roll(sig.lfilter(taps, [1.0], source), int(rng.integers(-5, 6)))
    elif kind == "even":
        shape = [y**2, np.abs(y), np.gradient(y)**2][rng.integers(3)]
        values = sig.lfilter([1.0], [1.0, -rng.uniform(0, 0.6)], shape - shape.mean())
        values = values - values.mean()
    elif kind == "odd":
        v = np.gradient(y)
        shape = [y**3, np.sign(v), np.tanh(1.5 * y / y.std())][rng.integers(3)]
        # what a filter would take of it is no part of it
        lagged = np.stack([np.roll(y, k) for k in range(-15, 16)], axis=1)
        values = shape - lagged @ np.linalg.lstsq(lagged, shape, rcond=None)[0]
    elif kind == "time_varying":
        shift = [t - 0.5, (t > rng.uniform(0.3, 0.7)) - 0.5, np.sin(2 * np.pi * t)][rng.integers(3)]
        shift = shift - np.sum(shift * y**2) / np.sum(y**2)
        values = (y if rng.random() < 0.5 else np.gradient(y)) * shift
    elif kind == "lines":
        values = sum(rng.uniform(0.3, 1) * np.sin(2 * np.pi * f * np.arange(n) + rng.uniform(0, 6))
                     for f in rng.uniform(0.02, 0.48, rng.integers(1, 4)))
    elif kind == "bursts":
        values = np.zeros(n)
        if rng.random() < 0.5:
            place = rng.choice(n, max(n // 1000, 3), replace=False)
            values[place] = rng.choice([-1, 1], len(place)) * rng.uniform(0.5, 1.5, len(place))
        else:
            for start in rng.integers(0, n - 60, 3):
                values[start:start + 50] = rng.normal(size=50)
    else:
        values = [t - 0.5, 1.0 * (t > rng.uniform(0.3, 0.7)) - 0.5,
                  np.sin(2 * np.pi * t * rng.uniform(0.5, 2))][rng.integers(3)]
        values = values - values.mean()
    return values / np.sqrt(np.mean(values**2))


def draw(seed, kinds=None, n=None):
    """Residual, measured, simulated, reference and true shares."""
    rng = np.random.default_rng(seed)
    n = n or int(rng.choice([3000, 8000, 20000]))
    reference, y = excitation(rng, n)
    kinds = kinds if kinds is not None else (KINDS[seed % len(KINDS)],)
    colour = rng.choice([0.0, 0.5, 0.9])
    weights = rng.uniform(0.3, 1.0, len(kinds) + 1)
    parts = [np.sqrt(w) * component(kind, rng, reference, y) for w, kind in zip(weights, kinds)]
    parts.append(np.sqrt(weights[-1]) * noise(rng, n, colour))
    residual = 0.05 * y.std() * sum(parts)
    power = weights / weights.sum()
    return residual, y + residual, y, reference, dict(zip((*kinds, "noise"), power.tolist()))
