"""Records as a lab makes them, for the tests of what is made of each kind of excitation."""

import numpy as np
import rig
import scipy.signal

from frac_accel.io.samples import Samples
from frac_accel.record import Record

RATE_HZ = 2000.0
X_ONLY = (1.0, 0.0, 0.0)

EXCITATIONS = {
    "stepped_sine": lambda rng: rig.stepped_sine(
        RATE_HZ, 10.0, np.geomspace(rng.uniform(20, 30), rng.uniform(400, 600), 15), X_ONLY),
    "multisine": lambda rng: rig.multisine(
        rng, RATE_HZ, 4.0, (5.0, rng.uniform(400, 700)), 0.5, X_ONLY, lead_s=1.0),
    "noise": lambda rng: rig.band_noise(
        rng, RATE_HZ, 4.0, (5.0, rng.uniform(400, 700)), X_ONLY, lead_s=1.0),
    "sweep": lambda rng: rig.swept_sine(
        RATE_HZ, 4.0, (rng.uniform(5, 10), rng.uniform(400, 700)), X_ONLY),
    "shock": lambda rng: rig.shock(RATE_HZ, 1.0, rng.uniform(0.8e-3, 1.2e-3), amplitude=X_ONLY),
}


def draw_sensor(rng):
    """Random classical sensor with a delay, whose resonance is where the lab's band ends."""
    return rig.draw_sensor(rng, RATE_HZ, "classical", ["time_delay"],
                           natural_frequency=(0.1, 0.3), damping_ratio=(0.05, 1.0))


def noise(rng, n, pole=0.0):
    """Noise of unit variance, white or of first order."""
    white = rng.normal(size=n + 500)
    return scipy.signal.lfilter([np.sqrt(1 - pole**2)], [1, -pole], white)[500:]


def pair_of(record, sensor=None, keep=slice(None), late_ns=0):
    """Pair of a rig's record, whose sensor's values may be others, holed or stamped later."""
    values = record.sensor if sensor is None else sensor
    return Record.of(Samples.of(record.stamps_ns, record.reference),
                     Samples.of(record.sensor_stamps_ns[keep] + late_ns, values[keep]))


def noisy(record, rng, snr_db, pole=0.0):
    """The sensor's values of a record without noise, with some."""
    values = record.clean.copy()
    level = values[:, 0].std() * 10 ** (-snr_db / 20)
    values[:, 0] += level * noise(rng, len(values), pole)
    return values


def relative_error(points, sensor):
    """Measured over exact response, less one."""
    exact = rig.transfer_function(sensor, "x", 2j * np.pi * points.frequency_hz)
    return points.response / exact - 1
