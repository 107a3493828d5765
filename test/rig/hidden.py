"""Cases for a blind diagnosis: a record with hidden effects, and the truth about it.

A case is a random sensor of one of three kinds on a random excitation, with each effect scaled to a
drawn multiple of the noise: the RMS, on axis x, of the record with this effect alone minus the
record without it, both free of noise. Where an effect acts on stamps and not on values:

- `timestamp_jitter`: the error of a value that is taken for true at its stamp, q' times the jitter;
- `dropped_samples`: the error of holding the last value where a message is lost.
"""

import dataclasses

import numpy as np

from .excitation import Excitation, band_noise, multisine, noise_bursts
from .record import Record, simulate_record
from .scaling import Bench, draw_effects
from .sensor import CAUSES, Sensor
from .unknown import partly_true

RATE_HZ = 2000.0
EXCITATIONS = ("band_noise", "multisine", "noise_bursts")
TEMPERATURE_RATE_HZ = 20.0
NEED_TEMPERATURE = {"temperature_sensitivity", "thermal_offset"}

# Of these, one says what the other says, or the rig cannot do both: no truth would be unique.
INSEPARABLE = (
    {"core_parameter_shift", "fractional_damping"},
    {"core_parameter_shift", "stiffness_drift"}, {"fractional_damping", "stiffness_drift"},
    {"coulomb_friction", "stiffness_drift"},
    {"time_delay", "reference_delay"}, {"ac_coupling", "reference_ac_coupling"},
    {"low_pass_lag", "low_pass_filter"}, {"low_pass_filter", "linear_phase_filter"},
    {"low_pass_lag", "linear_phase_filter"}, {"time_delay", "linear_phase_filter"},
    {"mounting_resonance", "second_resonance"}, {"reference_low_pass", "reference_smoothing"},
    {"cross_axis_sensitivity", "misalignment"}, {"sensitivity_error", "misalignment"},
    {"timestamp_jitter", "sampling_jitter"}, {"polled_readout", "sampling_jitter"},
    {"polled_readout", "timestamp_jitter"}, {"offset_drift", "thermal_offset"},
    {"offset_drift", "warm_up_drift"}, {"thermal_offset", "warm_up_drift"},
)


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
        The truth, and the model in use: the same without its effects.
    causes : set of str
    truth : dict
        Cause -> parameters.
    noise_std : float
        Noise of axis x [output units]; what the reference's noise and the lattice make of it
        included.
    effect_rms : dict
        Cause -> RMS of its effect alone on axis x [output units].
    kind, excitation : str
    seed : int
    has_temperature : bool
        True where the record comes with a temperature topic.
    besides : dict
        Cause -> parameters of what is truly there as well, as part of the surroundings: a diagnosis
        may name it or not.
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
    besides: dict = dataclasses.field(default_factory=dict)

    def samples(self):
        """Reference and sensor as `Samples`, and stamps and °C of the temperature or None."""
        from frac_accel.io.samples import Samples

        record = self.record
        temperature = None
        if self.has_temperature:
            interval_s = np.median(np.diff(record.stamps_ns)) * 1e-9
            every = max(1, round(1 / (interval_s * TEMPERATURE_RATE_HZ)))
            temperature = record.stamps_ns[::every], record.temperature_c[::every]
        return (Samples.of(record.stamps_ns, record.reference),
                Samples.of(record.sensor_stamps_ns, record.sensor), temperature)

    def write(self, path):
        """The same as a bag, under the default topics."""
        from frac_accel.io import bag

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


def draw_causes(seed, count, among=CAUSES):
    """`count` different causes that can be told apart."""
    rng = np.random.default_rng([seed, count])
    while True:
        causes = set(rng.choice(among, count, replace=False).tolist())
        if not any(pair <= causes for pair in INSEPARABLE):
            return causes


def draw_case(seed, causes=(), kind=None, excitation=None, times_noise=None):
    """Random case with the given causes.

    Parameters
    ----------
    seed : int
    causes : iterable of str
        Of `CAUSES`, `SECOND_SET`, `VARIANTS` and `UNCATALOGUED`; none for a sensor that is as
        modelled.
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
    temperature_c = draw_temperature(rng, excitation.samples)
    bench = Bench(core, excitation, temperature_c)
    bench.noise_std = bench.clean.std() * 10 ** (-snr_db / 20)
    drawn = draw_effects(rng, bench, causes, times_noise)
    if drawn is None:
        return None
    effects, alone = drawn
    sensor = Sensor(core, effects)
    try:
        record = simulate_record(sensor, excitation, rng, noise_std=bench.noise_std,
                                 temperature_c=temperature_c)
    except FloatingPointError:  # another axis moves more than its spring can hold
        return None
    has_temperature = bool(NEED_TEMPERATURE & set(effects)) or bool(rng.integers(2))
    return HiddenCase(record, sensor, model_in_use(core, effects), set(effects), effects,
                      float(bench.noise_std), alone, kind, excitation_name, seed, has_temperature,
                      partly_true(effects))


def model_in_use(core, effects):
    """The sensor without its effects, and with what a wrong model has besides."""
    return Sensor(core, effects.get("wrong_model", {"effect": {}})["effect"])


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


def draw_temperature(rng, samples):
    """A smooth course between 10 and 50 °C that is no straight line in time."""
    t = np.linspace(0, 1, samples)
    course = rng.uniform(-1, 1) * t + rng.uniform(0.3, 1) * np.sin(
        2 * np.pi * (rng.uniform(0.6, 1.5) * t + rng.random()))
    course = (course - course.min()) / np.ptp(course)
    return rng.uniform(10, 25) + rng.uniform(10, 25) * course

