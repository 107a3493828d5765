"""Drives made by the rig in which a sensor changes on the way."""

import numpy as np
from rig import Sensor, simulate_record
from rig.road import draw_drive, drive_on_road

RATE_HZ = 200.0
CORE = {"type": "oscillator", "natural_frequency_hz": 45.0, "damping_ratio": 0.4,
        "damping_order": 1.0, "sensitivity": 1.5}
MODEL = {"schema": "frac_accel/sensor_model/1", "core": CORE, "effects": []}


class ChangingDrive:
    """A drive of a sensor that is as modelled until something happens to it.

    Parameters
    ----------
    seed : int
    effects : dict of str to dict
        What it has afterwards.
    at_s : float
        When.
    ramp_s : float
        Time over which it grows; 0: at once.
    duration_s : float
    snr_db : float
    noise_std : float, optional
        Instead of that [output units].
    """

    def __init__(self, seed, effects, at_s=0.0, ramp_s=0.0, duration_s=600.0, snr_db=50.0,
                 noise_std=None):
        rng = np.random.default_rng(seed)
        self.drive = draw_drive(rng)
        excitation = drive_on_road(rng, RATE_HZ, duration_s, self.drive)
        before = simulate_record(Sensor(CORE), excitation)
        self.noise_std = noise_std or float(before.clean[:, 0].std() * 10 ** (-snr_db / 20))
        share = 0.0
        after = before
        if effects:
            after = simulate_record(Sensor(CORE, effects), excitation)
            time = np.arange(len(before.clean)) / RATE_HZ
            share = np.clip((time - at_s) / max(ramp_s, 1e-9), 0, 1)[:, None]
        self._rng, self._before = rng, before
        self._clean = before.clean + share * (after.clean - before.clean)
        self.start_ns = int(before.stamps_ns[0])

    def samples(self):
        """Reference and sensor, with new noise each time."""
        from frac_accel.io.samples import Samples

        values = self._clean + self.noise_std * self._rng.normal(size=self._clean.shape)
        return (Samples.of(self._before.stamps_ns, self._before.reference),
                Samples.of(self._before.sensor_stamps_ns, values))

    def since_start_s(self, ns):
        """Time of a stamp in the drive [s]."""
        return (ns - self.start_ns) * 1e-9


def chunks(samples, seconds=1.0):
    """Samples as they come."""
    edges = np.arange(samples.stamps_ns[0], samples.stamps_ns[-1] + 1e9 * seconds, 1e9 * seconds)
    places = np.searchsorted(samples.stamps_ns, edges)
    for first, last in zip(places[:-1], places[1:]):
        yield type(samples)(*(part[first:last] for part in samples[:3]), samples.frame_id)
