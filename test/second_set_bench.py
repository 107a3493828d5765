"""Small independent simulations of what the second set of causes does: exact at any instant."""

import numpy as np
from scipy.integrate import solve_ivp

from frac_accel.io.bag import Samples
from frac_accel.model import SensorModel

RATE = 500.0
CORE = {"type": "oscillator", "natural_frequency_hz": 80.0, "damping_ratio": 0.3,
        "damping_order": 1.0, "sensitivity": 1.0}


class Multisine:
    """Sum of sines of random phase: acceleration and steady motion of `CORE` at any instant."""

    def __init__(self, rng, lines=60, band_hz=(1.0, 140.0), rms=1.0):
        self.frequency = np.sort(rng.uniform(*band_hz, lines))
        self.amplitude = rng.uniform(0.5, 1.5, lines)
        self.amplitude *= rms / np.sqrt(np.sum(self.amplitude**2) / 2)
        self.phase = rng.uniform(0, 2 * np.pi, lines)

    def _sum(self, t, gain):
        t = np.asarray(t, float)
        total = np.zeros(t.shape)
        for f, a, phase, g in zip(self.frequency, self.amplitude, self.phase, gain):
            total += a * abs(g) * np.cos(2 * np.pi * f * t + phase + np.angle(g))
        return total

    def acceleration(self, t):
        return self._sum(t, np.ones(len(self.frequency)))

    def motion(self, t):
        """Output of the linear core, which has always moved like this."""
        s = 2j * np.pi * self.frequency
        w = 2 * np.pi * CORE["natural_frequency_hz"]
        return self._sum(t, w**2 / (s**2 + 2 * CORE["damping_ratio"] * w * s + w**2))

    def nonlinear(self, t, acceleration_of):
        """Motion by `solve_ivp`, from rest at t[0]: q'' = acceleration_of(t, q, q', S a)."""
        def slope(now, y):
            return y[1], acceleration_of(now, y[0], y[1], float(self._one(now)))
        solved = solve_ivp(slope, (t[0], t[-1]), (0.0, 0.0), "DOP853", t_eval=t, rtol=1e-8,
                           atol=1e-9, max_step=0.5 / RATE)
        return solved.y[0]

    def _one(self, t):
        return np.cos(2 * np.pi * self.frequency * t + self.phase) @ self.amplitude


def times(duration_s=8.0):
    return np.arange(round(duration_s * RATE)) / RATE


def samples(t, values):
    """One signal on x, or three, as a topic."""
    values = np.asarray(values, float)
    if values.ndim == 1:
        values = np.stack([values, 0 * values, 0 * values], axis=1)
    stamps = np.round(1e9 * np.asarray(t)).astype(np.int64) + 10**18
    return Samples(stamps, values, np.full(values.shape, np.nan), "")


def model(*effects, **core):
    return SensorModel.from_dict({"schema": "frac_accel/sensor_model/1",
                                  "core": {**CORE, **core}, "effects": list(effects)})
