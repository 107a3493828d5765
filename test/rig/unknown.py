"""Physics that is in no catalogue, along the signal's way.

Random courses come from a `seed` among the parameters, so that a record with an effect and one
without differ by the effect alone. In signal order:

- ``two_mounts`` (`first_hz`, `second_hz`, `damping_ratio`): two resonant mounts in series.
- ``duffing_mount`` (`frequency_hz`, `damping_ratio`, `cubic` [1/(m/s²)²]): a mount whose spring
  stiffens, y = p + cubic p³, p'' + 2ζω p' + ω² y = ω² a; it passes on y + 2ζ/ω p'.
- ``lever_arm`` (`rms` [m/s²], `low_hz`, `high_hz`, `seed`): the body turns; the sensor, away from
  the reference, feels angular acceleration times arm that the reference does not.
- ``slew_limit`` (`most_per_s`): the output follows no faster.
- ``rectification_memory`` (`strength`, `corner_hz`): strength · (low-passed y²) is added.
- ``moving_delay`` (`amplitude_s`, `frequency_hz`, `phase_rad`): a delay that swings.
- ``resampling_glitches`` (`rate_hz`): what stands at a stamp is the nearest value of a sampler at
  another rate.
- ``gain_modulation`` (`depth`, `frequency_hz`, `phase_rad`): gain 1 + depth sin(...).
- ``gain_by_axis`` (`depth`): gain 1 + depth · (y's output, without its mean, over its RMS).
- ``multiplicative_noise`` (`depth`, `seed`): gain 1 + depth · white noise.
- ``loose_contact`` (`share`, `gain`, `seed`): for a share of the time the gain is another.
- ``delayed_cross_talk`` (`coefficient`, `delay_s`): y's output of a while ago is
  added, without its mean.
- ``asymmetric_gain`` (`ratio`): the gain of values below zero, relative to that of those above.
- ``tanh_saturation`` (`limit`): limit · tanh(y / limit).
- ``folded_tones`` (`amplitude`, `rates_hz`, `seed`): three tones beyond the Nyquist frequency whose
  speed wanders; they appear folded.
- ``wandering_offset`` (`rms`, `seed`): a random walk.
- ``held_values`` (`share`, `seed`): for a share of the time the last value is repeated.
- ``batched_stamps`` (`count`): messages come `count` at a time and are stamped on arrival.
- ``wrong_model`` (`effect`): the sensor is as it was; the model in use has an effect too many.
"""

import numpy as np
import scipy.fft
import scipy.signal

from . import links
from .oscillator import integrate
from .path_dependent import slew_limited

# Causes of the catalogue that a diagnosis may rightly name where a kind is there: a part of it.
PARTLY = {
    "duffing_mount": ("mounting_resonance",),               # for small motion
    "batched_stamps": ("time_delay", "timestamp_jitter"),   # its mean and the rest
    # a read-out of the nearest value instead of the last; its pattern may pass for chance
    "resampling_glitches": ("sampling_jitter", "polled_readout"),
    # a drift with a course of its own
    "wandering_offset": ("offset_drift",),
}


def felt_motion(effects, values, step_s, axis):
    """Acceleration of one axis behind the mounts, on the grid."""
    if "two_mounts" in effects:
        mounts = effects["two_mounts"]
        for name in ("first_hz", "second_hz"):
            values = links.mounting(values, step_s, mounts[name], mounts["damping_ratio"])
    if "duffing_mount" in effects:
        mount = effects["duffing_mount"]
        w, ratio = 2 * np.pi * mount["frequency_hz"], mount["damping_ratio"]
        motion = integrate(values, step_s, mount["frequency_hz"], ratio, alpha3=mount["cubic"])
        values = motion.q + mount["cubic"] * motion.q ** 3 + 2 * ratio / w * motion.v
    if "lever_arm" in effects:
        arm = effects["lever_arm"]
        course = _band_course(np.random.default_rng([arm["seed"], axis]), len(values),
                              arm["low_hz"] * step_s, arm["high_hz"] * step_s)
        values = values + arm["rms"] * course
    return values


def passed_on(effects, values, step_s):
    """Output of one axis behind its conditioner, on the grid."""
    if "slew_limit" in effects:
        values = slew_limited(values, effects["slew_limit"]["most_per_s"] * step_s)
    if "rectification_memory" in effects:
        memory = effects["rectification_memory"]
        values = values + memory["strength"] * links.low_pass(values ** 2, step_s,
                                                              memory["corner_hz"])
    return values


def instants(effects, t, true_instants):
    """Instants at which the values are true, for stamps t."""
    if "moving_delay" in effects:
        moving = effects["moving_delay"]
        true_instants = true_instants - moving["amplitude_s"] * _sine(moving, t)
    if "resampling_glitches" in effects:
        rate = effects["resampling_glitches"]["rate_hz"]
        true_instants = np.round(true_instants * rate) / rate
    return true_instants


def gain(effects, t, other):
    """Factor on the values at stamps t; `other` is the next axis's output."""
    factor = np.ones(len(t))
    if "gain_modulation" in effects:
        factor *= 1 + effects["gain_modulation"]["depth"] * _sine(effects["gain_modulation"], t)
    if "gain_by_axis" in effects:
        factor *= 1 + effects["gain_by_axis"]["depth"] * (other - other.mean()) / other.std()
    if "multiplicative_noise" in effects:
        noise = effects["multiplicative_noise"]
        factor *= 1 + noise["depth"] * np.random.default_rng(noise["seed"]).normal(size=len(t))
    if "loose_contact" in effects:
        contact = effects["loose_contact"]
        factor[stretches(np.random.default_rng(contact["seed"]), len(t), contact["share"])] \
            *= contact["gain"]
    return factor


def values_behind(effects, values, t):
    """Values of one axis behind gain and cross-axis, at stamps t."""
    if "asymmetric_gain" in effects:
        values = np.where(values < 0, effects["asymmetric_gain"]["ratio"], 1.0) * values
    if "tanh_saturation" in effects:
        limit = effects["tanh_saturation"]["limit"]
        values = limit * np.tanh(values / limit)
    if "folded_tones" in effects:
        values = values + _folded(effects["folded_tones"], t)
    if "wandering_offset" in effects:
        walk = effects["wandering_offset"]
        course = np.cumsum(np.random.default_rng(walk["seed"]).normal(size=len(t)))
        values = values + walk["rms"] * (course - course.mean()) / course.std()
    if "held_values" in effects:
        held = effects["held_values"]
        frozen = stretches(np.random.default_rng(held["seed"]), len(t), held["share"])
        latest = np.maximum.accumulate(np.where(frozen, 0, np.arange(len(t))))
        values = values[latest]
    return values


def stamps(effects, stamps_ns):
    """Stamps on arrival, with a tenth of a millisecond between the messages of a batch."""
    if "batched_stamps" not in effects:
        return stamps_ns
    count = int(effects["batched_stamps"]["count"])
    place = np.arange(len(stamps_ns))
    last = np.minimum(place // count * count + count - 1, len(stamps_ns) - 1)
    return stamps_ns[last] + 100_000 * (place - last)


def partly_true(kinds):
    """Causes that may be named besides, with no parameters of their own."""
    return {cause: {} for kind in sorted(kinds) for cause in PARTLY.get(kind, ())}


def stretches(rng, count, share, shortest=5, longest=60):
    """Flags that are true for a share of the samples, in stretches; the first one is false."""
    flags = np.zeros(count, bool)
    while flags.sum() < share * count:
        start = rng.integers(1, count)
        flags[start:start + rng.integers(shortest, longest + 1)] = True
    return flags


def _sine(effect, t):
    return np.sin(2 * np.pi * effect["frequency_hz"] * t + effect["phase_rad"])


def _folded(tones, t):
    rng = np.random.default_rng(tones["seed"])
    # the speed of the machine wanders by some per cent, in seconds
    knots = np.linspace(t[0], t[-1], max(4, int((t[-1] - t[0]) / 4)))
    speed = 1 + 0.03 * np.interp(t, knots, rng.normal(size=len(knots)))
    turns = np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2 * np.diff(t))])
    return tones["amplitude"] * sum(
        np.sin(2 * np.pi * (rate * turns + rng.random())) for rate in tones["rates_hz"])


def _band_course(rng, count, low, high):
    """Noise of unit RMS between two frequencies in cycles per grid step."""
    period = scipy.fft.next_fast_len(count, real=True)
    frequency = np.fft.rfftfreq(period)
    inside = (frequency >= low) & (frequency <= high) & (frequency > 0)
    spectrum = np.zeros(len(frequency), complex)
    spectrum[inside] = rng.normal(size=(inside.sum(), 2)) @ [1, 1j]
    course = scipy.fft.irfft(spectrum, period)[:count]
    return course / course.std()
