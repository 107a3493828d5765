"""Simulation of nonlinear sensors: time over that of the linear one, 24 000 samples, one axis."""

import time

import numpy as np

from frac_accel import SensorModel
from frac_accel.simulation import AxisSimulator

RATE_HZ = 1000.0
CUBIC = {"cause": "cubic_stiffness", "alpha3": 0.01}
HYSTERESIS = {"cause": "hysteresis", "strength": 0.2, "beta": 1.0, "gamma": 0.2}
FRICTION = {"cause": "coulomb_friction", "level": 0.05}


def reference(count=24_000):
    """Noise of unit standard deviation up to 0.6 of the Nyquist frequency."""
    spectrum = np.fft.rfft(np.random.default_rng(0).normal(size=count))
    frequency = np.fft.rfftfreq(count, 1 / RATE_HZ)
    spectrum[(frequency < 5) | (frequency > 300)] = 0
    noise = np.fft.irfft(spectrum, count) * np.minimum(1, np.arange(count) / 500)
    return noise / noise.std()


def cpu_seconds(function, repeats=5):
    """Shortest of several CPU times [s], after one run that compiles."""
    function()
    times = []
    for _ in range(repeats):
        start = time.process_time()
        function()
        times.append(time.process_time() - start)
    return min(times)


def run():
    """Rows of the table."""
    values, rows = reference(), []
    for order in (1.0, 0.6):
        linear = None
        for name, effects in (("linear", []), ("cubic", [CUBIC]), ("hysteresis", [HYSTERESIS]),
                              ("friction", [FRICTION]), ("all", [CUBIC, HYSTERESIS, FRICTION])):
            axis = SensorModel.from_dict({
                "schema": "frac_accel/sensor_model/1", "effects": effects,
                "core": {"natural_frequency_hz": 120.0, "damping_ratio": 0.1,
                         "damping_order": order}}).axes[0]
            # a simulator keeps what it has simulated
            taken = cpu_seconds(lambda axis=axis: AxisSimulator(values, RATE_HZ).simulate(axis))
            linear = linear or taken
            rows.append({"order": order, "spring": name, "CPU time [ms]": 1e3 * taken,
                         "over linear": taken / linear})
    return rows
