"""Cases for a blind diagnosis: a record with hidden effects, and the truth about it.

A case is a random sensor of one of three kinds on a random excitation, with each effect scaled to a
drawn multiple of the noise: the RMS, on axis x, of the record with this effect alone minus the
record without it, both free of noise. Where an effect acts on stamps and not on values:

- `timestamp_jitter`: the error of a value that is taken for true at its stamp, q' times the jitter;
- `dropped_samples`: the error of holding the last value where a message is lost.
"""

import dataclasses

import numpy as np

from .effect_sizes import draw_family
from .excitation import Excitation, band_noise, multisine, noise_bursts
from .record import Record, simulate_record
from .sensor import CAUSES, Sensor

RATE_HZ = 2000.0
FEWEST_TIMES_NOISE = 3.0
MOST_TIMES_NOISE = 100.0
EXCITATIONS = ("band_noise", "multisine", "noise_bursts")
TEMPERATURE_RATE_HZ = 20.0
ON_STAMPS = {"timestamp_jitter", "dropped_samples"}

# The second one of these says what the first one says: the truth would not be unique.
INSEPARABLE = ({"core_parameter_shift", "fractional_damping"},)


@dataclasses.dataclass(frozen=True)
class Kind:
    """Ranges of one kind of sensor."""

    natural_frequency: tuple  # as a fraction of the sampling rate
    damping_ratio: tuple
    snr_db: tuple


KINDS = {
    "lab": Kind((0.1, 0.3), (0.02, 0.7), (60, 80)),
    "dongle": Kind((0.05, 0.2), (0.3, 1.0), (40, 60)),  # taped into a vehicle
    "soft": Kind((0.03, 0.1), (0.05, 0.3), (50, 70)),   # micromechanical, on a soft mount
}


@dataclasses.dataclass(frozen=True)
class HiddenCase:
    """One record and what is hidden in it.

    Attributes
    ----------
    record : Record
    sensor, baseline : Sensor
        The truth, and the same without its effects.
    causes : set of str
    truth : dict
        Cause -> parameters.
    noise_std : float
        Noise of axis x [output units].
    effect_rms : dict
        Cause -> RMS of its effect alone on axis x [output units].
    kind, excitation : str
    seed : int
    has_temperature : bool
        True where the record comes with a temperature topic.
    """

    record: Record
    sensor: Sensor
    baseline: Sensor
    causes: set
    truth: dict
    noise_std: float
    effect_rms: dict
    kind: str
    excitation: str
    seed: int
    has_temperature: bool

    def samples(self):
        """Reference and sensor as `Samples`, and stamps and °C of the temperature or None."""
        from frac_accel.record.samples import Samples

        record = self.record
        temperature = None
        if self.has_temperature:
            every = round(RATE_HZ / TEMPERATURE_RATE_HZ)
            temperature = record.stamps_ns[::every], record.temperature_c[::every]
        return (Samples.of(record.stamps_ns, record.reference),
                Samples.of(record.sensor_stamps_ns, record.sensor), temperature)

    def write(self, path):
        """The same as a bag, under the default topics."""
        from frac_accel import bag

        reference, sensor, temperature = self.samples()
        topics = {bag.REFERENCE_TOPIC: reference, bag.RAW_TOPIC: sensor}
        if temperature is not None:
            stamps_ns, celsius = temperature
            topics[bag.TEMPERATURE_TOPIC] = bag.Temperatures(
                stamps_ns, celsius, np.full(len(celsius), np.nan), "accel_link")
        bag.write_bag(path, topics)

    def model(self):
        """The baseline as the `SensorModel` that is in use."""
        from frac_accel.model import SensorModel

        return SensorModel.from_dict(self.baseline.to_model())


def draw_causes(seed, count):
    """`count` different causes that can be told apart."""
    rng = np.random.default_rng([seed, count])
    while True:
        causes = set(rng.choice(CAUSES, count, replace=False).tolist())
        if not any(pair <= causes for pair in INSEPARABLE):
            return causes


def draw_case(seed, causes=(), kind=None, excitation=None, times_noise=None):
    """Random case with the given causes.

    Parameters
    ----------
    seed : int
    causes : iterable of str
        Of `CAUSES` and `UNCATALOGUED`; none for a sensor that is as modelled.
    kind : str, optional
        Of `KINDS`; default: drawn.
    excitation : str, optional
        Of `EXCITATIONS`; default: drawn.
    times_noise : float, optional
        Effect's RMS over the noise's; default: drawn between 3 and 100. An effect that its physical
        bounds keep larger or smaller is drawn as near as they allow.

    Returns
    -------
    HiddenCase
    """
    causes = set(causes)
    rng = np.random.default_rng([seed, *sorted(map(ord, "".join(sorted(causes))))])
    kind = kind or str(rng.choice(list(KINDS)))
    excitation = excitation or str(rng.choice(EXCITATIONS))
    for _ in range(30):
        case = _draw(rng, seed, causes, kind, excitation, times_noise)
        if case is not None:
            return case
    raise RuntimeError(f"seed {seed}, {sorted(causes)}: no draw has effects of the wanted size")


def _draw(rng, seed, causes, kind, excitation_name, times_noise):
    """One draw; None where an effect is too small, or more than the sensor survives."""
    core, snr_db = _draw_core(rng, KINDS[kind])
    excitation = _draw_excitation(rng, excitation_name)
    along_x = _axis_x_only(excitation)
    temperature_c = _draw_temperature(rng, excitation.samples)

    def output(effects):
        """Noise-free values of axis x, with every sample in its place."""
        effects = {cause: effects[cause] for cause in effects if cause not in ON_STAMPS}
        moved = excitation if "cross_axis_sensitivity" in effects else along_x
        try:
            record = simulate_record(Sensor(core, effects), moved, temperature_c=temperature_c)
        except FloatingPointError:  # more than the spring can hold
            return np.full(excitation.samples, np.inf)
        return record.sensor[:, 0]

    clean = output({})
    noise_std = clean.std() * 10 ** (-snr_db / 20)

    def effect_rms(cause, effects, others=()):
        """RMS of what a cause adds to the other causes."""
        others = {other: effects[other] for other in others}
        without = output(others) if others else clean
        if cause == "timestamp_jitter":
            return _rms(np.gradient(without) * RATE_HZ) * effects[cause]["rms_s"]
        if cause == "dropped_samples":
            return _rms(np.diff(without)) * float(np.sqrt(effects[cause]["fraction"]))
        return _rms(output({**others, cause: effects[cause]}) - without)

    def strong_enough(effect):
        return effect < np.inf and (times_noise or effect >= FEWEST_TIMES_NOISE * noise_std)

    effects, alone = {}, {}
    for cause in CAUSES + tuple(causes - set(CAUSES)):
        if cause not in causes:
            continue
        family = draw_family(rng, cause, RATE_HZ, core, clean)
        def of_size(parameters, cause=cause):
            return effect_rms(cause, {cause: parameters})

        if times_noise:
            wanted = times_noise * noise_std
        else:
            smallest = of_size(family.parameters(family.smallest))
            wanted = _draw_wanted(rng, cause, smallest, noise_std, family.most * clean.std())
        effects[cause], alone[cause] = _scaled(family, of_size, wanted)
        if not strong_enough(alone[cause]):
            return None
    # One effect can hide another: a smaller gain never reaches the limits.
    if len(causes) > 1 and not all(
            strong_enough(effect_rms(cause, effects, causes - {cause})) for cause in causes):
        return None
    sensor = Sensor(core, effects)
    try:
        record = simulate_record(sensor, excitation, rng, noise_std=noise_std,
                                 temperature_c=temperature_c)
    except FloatingPointError:  # another axis moves more than its spring can hold
        return None
    has_temperature = "temperature_sensitivity" in causes or bool(rng.integers(2))
    return HiddenCase(record, sensor, Sensor(core), causes, effects, float(noise_std), alone, kind,
                      excitation_name, seed, has_temperature)


def _draw_wanted(rng, cause, smallest, noise_std, most):
    """RMS that an effect is to have; `smallest` is what its bounds leave at least."""
    low = max(1.1 * FEWEST_TIMES_NOISE * noise_std, smallest)
    high = max(MOST_TIMES_NOISE * noise_std, 3 * low)
    if cause == "time_delay":  # delays of whole samples are common
        high = most
    return np.exp(rng.uniform(np.log(low), np.log(max(low, min(high, most)))))


def _scaled(family, effect_rms, wanted):
    """Parameters and the effect's RMS: as wanted within 10 %, or as near as the bounds allow."""
    low, high = np.log(family.smallest), np.log(family.largest)
    place = (low + high) / 2
    for _ in range(12):
        parameters = family.parameters(float(np.exp(place)))
        found = effect_rms(parameters)
        if abs(np.log(max(found, 1e-300) / wanted)) < 0.1:
            break
        low, high = (low, place) if found > wanted else (place, high)
        nearer = place + np.log(wanted / max(found, 1e-300)) if np.isfinite(found) else np.nan
        place = nearer if low < nearer < high else (low + high) / 2
    return parameters, found


def _draw_core(rng, kind):
    low, high = np.log(kind.natural_frequency)
    core = {"type": "oscillator",
            "natural_frequency_hz": float(RATE_HZ * np.exp(rng.uniform(low, high))),
            "damping_ratio": float(np.exp(rng.uniform(*np.log(kind.damping_ratio)))),
            "damping_order": 1.0,
            "sensitivity": float(10 ** rng.uniform(-0.7, 0.7))}
    return core, rng.uniform(*kind.snr_db)


def _draw_excitation(rng, name) -> Excitation:
    """12 s, in a third of the draws 4 to 8 s; in mid-motion in half of those that can be."""
    duration_s = float(rng.choice([12.0, 12.0, rng.integers(4, 9)]))
    band_hz = RATE_HZ * 10 ** rng.uniform(-3, -2.3), RATE_HZ * rng.uniform(0.22, 0.3)
    amplitude = 10 ** rng.uniform(0, 1.3, 3)
    lead_s = float(rng.integers(2))
    if name == "band_noise":
        return band_noise(rng, RATE_HZ, duration_s, band_hz, amplitude, lead_s)
    if name == "multisine":
        period_s = rng.integers(1000, 4001) / RATE_HZ
        return multisine(rng, RATE_HZ, duration_s, band_hz, period_s, amplitude, lead_s)
    levels = rng.permutation([0.2, 0.5, 1.0, 2.0])
    return noise_bursts(rng, RATE_HZ, duration_s, band_hz, levels, amplitude)


def _axis_x_only(excitation):
    """The rig spends no time on an axis at rest."""
    acceleration = np.zeros_like(excitation.acceleration)
    acceleration[0] = excitation.acceleration[0]
    return dataclasses.replace(excitation, acceleration=acceleration)


def _draw_temperature(rng, samples):
    """A smooth course between 10 and 50 °C that is no straight line in time."""
    t = np.linspace(0, 1, samples)
    course = rng.uniform(-1, 1) * t + rng.uniform(0.3, 1) * np.sin(
        2 * np.pi * (rng.uniform(0.6, 1.5) * t + rng.random()))
    course = (course - course.min()) / np.ptp(course)
    return rng.uniform(10, 25) + rng.uniform(10, 25) * course


def _rms(values):
    return float(np.sqrt(np.mean(np.square(values))))
