"""Fleets made by the rig: vehicles of one type of sensor, some with a weak effect."""

import dataclasses

import numpy as np
from rig import Sensor, band_noise, simulate_record

RATE_HZ = 500.0
CORE = {"type": "oscillator", "natural_frequency_hz": 80.0, "damping_ratio": 0.4,
        "damping_order": 1.0, "sensitivity": 2.0}
LEVEL = 20.0  # output that a size of one belongs to
# Cause -> its parameters for a size.
CAUSES = {
    "cubic_stiffness": lambda size: {"alpha3": size / LEVEL**2},
    "quadratic_stiffness": lambda size: {"alpha2": size / LEVEL},
    "sensitivity_error": lambda size: {"gain": 1 + size},
    "time_delay": lambda size: {"delay_s": size / (2 * np.pi * 40.0)},
    "coulomb_friction": lambda size: {"level": abs(size) * LEVEL},
    "gain_drift": lambda size: {"rate_per_s": size / 2},
}
_SMALL = 2e-3


@dataclasses.dataclass(frozen=True)
class Vehicle:
    """A vehicle's record without noise, and what an effect adds to it.

    Attributes
    ----------
    record : rig.Record
        Without noise and effect.
    added : dict of str to ndarray, shape (n, 3)
        Change of the output by each cause, for a size of one.
    noise_std : float
    """

    record: object
    added: dict
    noise_std: float


def model():
    """The model in use, in the words of the file."""
    return {"schema": "frac_accel/sensor_model/1", "core": CORE, "effects": []}


def vehicle(rng, causes=(), duration_s=4.0, snr_db=50.0):
    """A random vehicle."""
    amplitude = rng.uniform(3.0, 6.0, 3)
    excitation = band_noise(rng, RATE_HZ, duration_s, (2.0, 120.0), amplitude, 1.0)
    record = simulate_record(Sensor(CORE), excitation)
    level = record.clean[:, 0].std()
    added = {}
    for cause in causes:
        # small enough to be of first order, large enough for the rig's own error
        with_it = simulate_record(Sensor(CORE, {cause: CAUSES[cause](_SMALL)}), excitation)
        added[cause] = (with_it.clean - record.clean) / _SMALL
    return Vehicle(record, added, float(level * 10 ** (-snr_db / 20)))


def samples(own, rng, cause=None, size=0.0):
    """Reference and sensor of one drive: new noise, and an effect of some size."""
    from frac_accel.io.samples import Samples

    record = own.record
    values = record.clean + own.noise_std * rng.normal(size=record.clean.shape)
    if cause is not None:
        values = values + size * own.added[cause]
    return (Samples.of(record.stamps_ns, record.reference),
            Samples.of(record.sensor_stamps_ns, values))


def write_bag(path, own, rng, later_s=0.0, **effect):
    """The same as a bag."""
    from frac_accel.io import bag

    later = round(later_s * 1e9)
    reference, sensor = (part._replace(stamps_ns=part.stamps_ns + later)
                         for part in samples(own, rng, **effect))
    bag.write_bag(path, {bag.REFERENCE_TOPIC: reference, bag.RAW_TOPIC: sensor})


class ScreenedVehicle:
    """A vehicle's screening, whose noise is drawn again and again at the cost of its estimates.

    The directions in which causes change the output hang on the motion alone.
    """

    def __init__(self, own, sensor_model):
        from frac_accel.diagnosis.engine import Engine
        from frac_accel.diagnosis.screened import screen_of
        from frac_accel.model.effects import known_effects
        from frac_accel.record import Record

        self._own = own
        record = Record.of(*samples(own, np.random.default_rng(0)))
        core = sensor_model.axis("x").core
        self._engine = Engine(record, 0, sensor_model, record.valid, candidates=[
            cause for cause, effect in known_effects().items()
            if not effect.read_off and effect.acts_on(core)])
        self._screen = screen_of(self._engine)
        self._correlations = self._screen.correlations()
        fitted = self._engine.search.fit(self._engine.search.base)
        self._simulated, self._free = fitted.simulated, fitted.free

    def drawn(self, rng, cause=None, size=0.0):
        """As `Diagnosis.screened` of a new drive."""
        _, sensor = samples(self._own, rng, cause, size)
        problem = self._engine.problem
        residual = problem.clear(sensor.values[:, 0] - self._simulated, self._free)
        return {"estimates": self._screen.estimates(residual[problem.used]),
                "correlations": self._correlations}

    def own_part(self, cause):
        """Standard uncertainties by which an effect of size one moves its own estimate."""
        quiet = self.drawn(np.random.default_rng(0))
        moved = self.drawn(np.random.default_rng(0), cause, _SMALL)
        return max(abs(b["value"] - a["value"]) / a["std"] / _SMALL for a, b in
                   zip(quiet["estimates"], moved["estimates"]) if a["cause"] == cause)
