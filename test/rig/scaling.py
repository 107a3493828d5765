"""Effects drawn and scaled to a wanted multiple of the noise, on a given core and motion."""

import dataclasses
import functools

import numpy as np

from .effect_sizes import draw_family
from .exact_response import transfer_function
from .excitation import Excitation
from .logger import Logger
from .record import simulate_record
from .reference_side import recorded_motion
from .sensor import CAUSES, ON_REFERENCE, SECOND_SET, Sensor
from .unknown import stamps

FEWEST_TIMES_NOISE = 3.0
MOST_TIMES_NOISE = 100.0
ON_STAMPS = {"timestamp_jitter", "dropped_samples", "batched_stamps"}
# They need the motion of the other axes.
ACROSS = {"cross_axis_sensitivity", "misalignment", "gain_by_axis", "delayed_cross_talk"}
# Further families of parameters of a cause -> the cause.
VARIANTS = {"hardening_hysteresis": "hysteresis", "turned_axes": "misalignment",
            "late_stamps": "time_delay"}


@dataclasses.dataclass
class Bench:
    """A sensor without effects on its moving base.

    Attributes
    ----------
    core : dict
    excitation : Excitation
    temperature_c : ndarray
        At the reference's instants.
    noise_std : float
        Of axis x; set by whoever knows the signal.
    logger : Logger
    surroundings : dict of str to dict
        Effects that are there in any case, and that the model in use has too.
    """

    core: dict
    excitation: Excitation
    temperature_c: np.ndarray
    noise_std: float = 0.0
    logger: Logger = Logger()
    surroundings: dict = dataclasses.field(default_factory=dict)

    @property
    def rate_hz(self):
        """Rate of the sensor's samples [Hz]."""
        return self.logger.sensor_rate_hz or self.excitation.rate_hz

    @functools.cached_property
    def clean(self):
        """Noise-free values of axis x without effects."""
        return self.output({})

    def output(self, effects, excitation=None):
        """Noise-free values of axis x, with every sample in its place; infinite where it breaks."""
        effects = {cause: own for cause, own in {**self.surroundings, **effects}.items()
                   if cause not in ON_STAMPS and cause not in ON_REFERENCE}
        excitation = excitation or (self.excitation if ACROSS & set(effects) else self._along_x)
        try:
            record = simulate_record(Sensor(self.core, effects), excitation,
                                     temperature_c=self.temperature_c, logger=self.logger)
        except FloatingPointError:  # more than the spring can hold
            return np.full(len(self.logger.sensor_times(excitation)), np.inf)
        return record.sensor[:, 0]

    def effect_rms(self, cause, effects, others=()):
        """RMS of what a cause adds to the other causes [output units]."""
        others = {other: effects[other] for other in others}
        without = self.output(others) if others else self.clean
        own = effects[cause]
        if cause in ("timestamp_jitter", "sampling_jitter"):
            return _rms(np.gradient(without) * self.rate_hz) * own["rms_s"]
        if cause == "polled_readout":
            return _rms(np.gradient(without) * self.rate_hz) * own["interval_s"] / np.sqrt(12)
        if cause == "dropped_samples":
            return _rms(np.diff(without)) * float(np.sqrt(own["fraction"]))
        if cause == "batched_stamps":
            due = np.round(np.arange(len(without)) / self.rate_hz * 1e9).astype(np.int64)
            return _rms(np.gradient(without) * self.rate_hz * 1e-9 * (stamps(effects, due) - due))
        if cause == "interference_bursts":
            return own["rms"] * float(np.sqrt(own["share"]))
        if cause == "reference_noise":
            return own["std"] * self.noise_gain
        if cause in ON_REFERENCE:
            moved = recorded_motion({cause: own}, self._along_x.acceleration,
                                    self.excitation.step_s)
            shifted = dataclasses.replace(self._along_x, acceleration=moved)
            return _rms(self.output(others, shifted) - without)
        if cause == "wrong_model":
            return _rms(self.output({**others, **own["effect"]}) - without)
        return _rms(self.output({**others, cause: own}) - without)

    @functools.cached_property
    def _along_x(self):
        """The rig spends no time on an axis at rest."""
        acceleration = np.zeros_like(self.excitation.acceleration)
        acceleration[0] = self.excitation.acceleration[0]
        return dataclasses.replace(self.excitation, acceleration=acceleration)

    @functools.cached_property
    def noise_gain(self):
        """RMS of the output for white noise of unit RMS on the reference's samples."""
        rate = self.logger.reference_rate_hz or self.excitation.rate_hz
        s = 2j * np.pi * rate * np.linspace(1e-4, 0.5, 20_000)
        return _rms(np.abs(transfer_function(Sensor(self.core, self.surroundings), "x", s)))


def draw_effects(rng, bench, causes, times_noise=None):
    """Parameters of each cause and the RMS of its effect alone.

    Parameters
    ----------
    bench : Bench
    causes : set of str
        Of `CAUSES`, `SECOND_SET`, `VARIANTS` and `UNCATALOGUED`.
    times_noise : float, optional
        Default: drawn between 3 and 100.

    Returns
    -------
    tuple of dict, or None
        None where an effect is too small or more than the sensor survives.
    """
    def strong_enough(effect):
        return effect < np.inf and (times_noise
                                    or effect >= FEWEST_TIMES_NOISE * bench.noise_std)

    effects, alone = {}, {}
    for name in (*CAUSES, *SECOND_SET, *sorted(causes - {*CAUSES, *SECOND_SET})):
        if name not in causes:
            continue
        cause = VARIANTS.get(name, name)
        family = draw_family(rng, name, bench.rate_hz, bench.core, bench.clean)

        def of_size(parameters, cause=cause):
            return bench.effect_rms(cause, {cause: parameters})

        if times_noise:
            wanted = times_noise * bench.noise_std
        else:
            smallest = of_size(family.parameters(family.smallest))
            wanted = _draw_wanted(rng, cause, smallest, bench.noise_std,
                                  family.most * bench.clean.std())
        effects[cause], alone[cause] = _scaled(family, of_size, wanted)
        if not strong_enough(alone[cause]):
            return None
    # One effect can hide another: a smaller gain never reaches the limits.
    if len(effects) > 1 and not all(
            strong_enough(bench.effect_rms(cause, effects, set(effects) - {cause}))
            for cause in effects):
        return None
    return effects, alone


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


def _rms(values):
    return float(np.sqrt(np.mean(np.square(values))))
