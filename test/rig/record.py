"""From an excitation and a sensor to the record that a logger would keep."""

import dataclasses

import numpy as np
import scipy.signal

from . import filters, links, unknown
from .general_equation import integrate_general
from .logger import Logger
from .oscillator import integrate
from .path_dependent import play
from .reference_side import on_reference, recorded_motion
from .sensor import AXES, Sensor

START_NS = 1_700_000_000_000_000_000


@dataclasses.dataclass(frozen=True)
class Record:
    """What was recorded, and the truth.

    Attributes
    ----------
    stamps_ns : ndarray of int64, shape (n,)
        Stamps of the reference.
    reference : ndarray, shape (n, 3)
        Base acceleration [m/s²] as the reference recorded it.
    sensor_stamps_ns : ndarray of int64, shape (m,)
        Stamps of the sensor: those of the reference, but for jitter, lost messages and rates of
        its own.
    sensor : ndarray, shape (m, 3)
        Sensor's output.
    clean : ndarray, shape (m, 3)
        The same without what only chance knows (noise, bursts, scattered instants), clipping and
        quantisation.
    noise_std : ndarray, shape (3,)
        Standard deviation of the noise [output units].
    temperature_c : ndarray, shape (n,)
        Temperature at the reference's stamps [°C].
    """

    stamps_ns: np.ndarray
    reference: np.ndarray
    sensor_stamps_ns: np.ndarray
    sensor: np.ndarray
    clean: np.ndarray
    noise_std: np.ndarray
    temperature_c: np.ndarray
    truth: Sensor


def simulate_record(sensor, excitation, rng=None, snr_db=60.0, noise_std=None, noise_ar=(),
                    temperature_c=None, logger=None, spikes=None):
    """Record of a sensor on a moving base.

    Parameters
    ----------
    sensor : Sensor
    excitation : Excitation
    rng : numpy.random.Generator, optional
        For noise, jitter, losses, bursts and the tone's phase; without it there is none of these.
    snr_db : float
        Level of each axis's signal over its noise; axes without signal get the largest noise.
    noise_std : float or sequence of three, optional
        Noise [output units] instead of `snr_db`.
    noise_ar : sequence of float
        Coloured noise n[k] = sum of noise_ar[i] * n[k-1-i] + white, of the same standard deviation.
    temperature_c : ndarray, shape (reference's samples,), optional
        Default: 25 °C, or from 15 to 45 °C where the sensor has a temperature effect.
    logger : Logger, optional
        Rates and losses of the two topics; default: all that the excitation has.
    spikes : tuple of float, optional
        Share of the values that are hit, and the size of the spikes [output units].

    Returns
    -------
    Record
    """
    logger = logger or Logger()
    effects = sensor.effects
    by_axis = [sensor.on_axis(axis)[1] for axis in AXES]
    t, reference_t = logger.sensor_times(excitation), logger.reference_times(excitation)
    if temperature_c is None:
        warms = any({"temperature_sensitivity", "thermal_offset"} & set(own) for own in by_axis)
        temperature_c = (np.linspace(15, 45, len(reference_t)) if warms
                         else np.full(len(reference_t), 25.0))
    phases = [0.0 if rng is None or "tone_interference" not in own else 2 * np.pi * rng.random()
              for own in by_axis]
    scatter = None
    if rng is not None and "sampling_jitter" in effects:
        scatter = rng.normal(size=len(t)) * effects["sampling_jitter"]["rms_s"]
    if rng is not None and "polled_readout" in effects:
        scatter = _age(rng, t, **effects["polled_readout"])
    clean, scattered = _output(sensor, excitation, t, np.interp(t, reference_t, temperature_c),
                               phases, scatter)

    noise_std = _noise_std(clean, rng, snr_db, noise_std)
    values = scattered.copy()
    if rng is not None:
        values += noise_std * _unit_noise(rng, len(t), noise_ar)
        for axis, own in enumerate(by_axis):
            if "interference_bursts" in own:
                values[:, axis] += _bursts(rng, len(t), **own["interference_bursts"])
        if spikes is not None:
            hit = rng.random(values.shape) < spikes[0]
            values += hit * spikes[1] * rng.choice([-1, 1], values.shape) * rng.uniform(
                0.5, 1.5, values.shape)
    for axis, own in enumerate(by_axis):
        if "clipping" in own:
            values[:, axis] = np.clip(values[:, axis], own["clipping"]["lower"],
                                      own["clipping"]["upper"])
        if "quantization" in own:
            step = own["quantization"]["step"]
            values[:, axis] = step * np.round(values[:, axis] / step)

    sensor_stamps_ns, kept = _logged(effects, unknown.stamps(effects, _stamps(t)), rng)
    stamps_ns, reference, recorded = _reference(effects, excitation, reference_t, logger, rng)
    return Record(stamps_ns, reference, sensor_stamps_ns, values[kept], clean[kept],
                  noise_std, temperature_c[recorded], sensor)


def _output(sensor, excitation, t, temperature_c, phases, scatter):
    """Values at the stamps t, shape (m, 3), without and with the scatter of the instants."""
    late = {cause: own["begins_s"] for cause, own in sensor.effects.items() if "begins_s" in own}
    everything = _from_the_start(sensor, excitation, t, temperature_c, phases, scatter)
    if not late:
        return everything
    before = dataclasses.replace(sensor, effects={
        cause: own for cause, own in sensor.effects.items() if cause not in late})
    without = _from_the_start(before, excitation, t, temperature_c, phases, scatter)
    begun = t[:, None] >= max(late.values())
    return tuple(np.where(begun, new, old) for new, old in zip(everything, without))


def _from_the_start(sensor, excitation, t, temperature_c, phases, scatter):
    turned = excitation
    if "misalignment" in sensor.effects:
        turn = rotation(**sensor.effects["misalignment"])
        turned = dataclasses.replace(excitation, acceleration=turn.T @ excitation.acceleration)
    grids = [_linear_output(sensor, axis, turned) for axis in AXES]
    clean = _sampled(sensor, grids, excitation, t, 0.0, temperature_c, phases)
    if scatter is None:
        return clean, clean
    return clean, _sampled(sensor, grids, excitation, t, scatter, temperature_c, phases)


def _sampled(sensor, grids, excitation, t, scatter, temperature_c, phases):
    """From the outputs on the grid to the values of all axes at the stamps t."""
    by_axis = [sensor.on_axis(axis)[1] for axis in AXES]

    def read(axis, effects, later_s=0.0):
        places = (_instants(effects, t) + scatter - later_s) / excitation.step_s
        return links.sample(grids[axis], places + excitation.start)

    plain = [read(axis, effects) for axis, effects in enumerate(by_axis)]
    values = np.empty((len(t), 3))
    for axis, effects in enumerate(by_axis):
        own = plain[axis]
        if "delayed_cross_talk" in effects:
            talk = effects["delayed_cross_talk"]
            other = read((axis + 1) % 3, effects, talk["delay_s"])
            own = own + talk["coefficient"] * (other - other.mean())
        values[:, axis] = (_gain(effects, t, temperature_c) * own
                           * unknown.gain(effects, t, plain[(axis + 1) % 3]))
    values = values @ _cross_axis(by_axis).T
    for axis, effects in enumerate(by_axis):
        values[:, axis] = _static(effects, unknown.values_behind(effects, values[:, axis], t),
                                  t, temperature_c, phases[axis])
    return values


def rotation(roll_deg, pitch_deg, yaw_deg):
    """Rz(yaw) Ry(pitch) Rx(roll), shape (3, 3): from the turned axes to the fixed ones."""
    (sx, cx), (sy, cy), (sz, cz) = (
        (np.sin(a), np.cos(a)) for a in np.radians([roll_deg, pitch_deg, yaw_deg]))
    return (np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
            @ np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
            @ np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]]))


def _linear_output(sensor, axis, excitation):
    """Output of mounting, core and conditioner on the grid."""
    core, effects = sensor.on_axis(axis)
    values = excitation.acceleration[AXES.index(axis)]
    if not values.any():
        return np.zeros_like(values)
    step_s = excitation.step_s
    values = unknown.felt_motion(effects, values, step_s, AXES.index(axis))
    if "mounting_resonance" in effects:
        values = links.mounting(values, step_s, **effects["mounting_resonance"])
    values = _core_output(core, effects, values, step_s, -excitation.start * step_s)
    if "backlash" in effects:
        values = play(values, effects["backlash"]["gap"])
    if "second_resonance" in effects:
        values = filters.second_resonance(values, step_s, **effects["second_resonance"])
    if "ac_coupling" in effects:
        values = links.high_pass(values, step_s, **effects["ac_coupling"])
    if "low_pass_lag" in effects:
        values = links.low_pass(values, step_s, **effects["low_pass_lag"])
    if "low_pass_filter" in effects:
        values = filters.low_pass_filter(values, step_s, **effects["low_pass_filter"])
    if "linear_phase_filter" in effects:
        values = filters.moving_average(values, step_s, **effects["linear_phase_filter"])
    return unknown.passed_on(effects, values, step_s)


# They act on a spring and a mass.
_OF_THE_OSCILLATOR = {
    "core_parameter_shift", "fractional_damping", "quadratic_stiffness", "cubic_stiffness",
    "hysteresis", "coulomb_friction", "stiffness_drift", "quadratic_damping", "impact_stop"}


def _core_output(core, effects, values, step_s, begin_s):
    if core["type"] == "oscillator":
        core = {**core, **effects.get("core_parameter_shift", {}),
                **effects.get("fractional_damping", {})}
        bouc_wen = effects.get("hysteresis", {"strength": 0.0, "beta": 0.0, "gamma": 0.0})
        return integrate(
            values, step_s, core["natural_frequency_hz"], core["damping_ratio"],
            core["damping_order"], core["sensitivity"],
            alpha2=effects.get("quadratic_stiffness", {"alpha2": 0.0})["alpha2"],
            alpha3=effects.get("cubic_stiffness", {"alpha3": 0.0})["alpha3"],
            coulomb_level=effects.get("coulomb_friction", {"level": 0.0})["level"],
            hysteresis=(bouc_wen["strength"], bouc_wen["beta"], bouc_wen["gamma"]),
            quadratic_damping=effects.get("quadratic_damping", {"coefficient": 0.0})["coefficient"],
            drift=(effects.get("stiffness_drift", {"rate_per_s": 0.0})["rate_per_s"], begin_s),
            **_stop(effects)).q
    if _OF_THE_OSCILLATOR & set(effects):
        raise ValueError(f"{sorted(_OF_THE_OSCILLATOR & set(effects))} need an oscillator")
    if core["type"] == "gain":
        return core["sensitivity"] * values
    if core["type"] == "arx":
        points = 1 / (core["sampling_rate_hz"] * step_s)
        if not np.isclose(points, round(points), rtol=1e-9):
            raise ValueError("the ARX core's sampling interval is not a multiple of the grid's")
        return links.difference_equation(values, round(points), core["numerator"],
                                         core["denominator"])
    return integrate_general(
        values, step_s,
        list(zip(core["denominator_coefficients"], core["denominator_orders"])),
        list(zip(core["numerator_coefficients"], core["numerator_orders"])))


def _stop(effects):
    if "impact_stop" not in effects:
        return {}
    gap, stiffness = effects["impact_stop"]["gap"], effects["impact_stop"]["stiffness"]
    return {"stop": (-np.inf, gap, stiffness) if gap > 0 else (gap, np.inf, stiffness)}


def _instants(effects, t):
    """Time at which the value stamped t was true."""
    skew_ppm = effects.get("clock_skew", {"skew_ppm": 0.0})["skew_ppm"]
    instants = t * (1 + 1e-6 * skew_ppm) - effects.get("time_delay", {"delay_s": 0.0})["delay_s"]
    if "time_step" in effects:
        instants = instants - effects["time_step"]["step_s"] * (t >= effects["time_step"]["at_s"])
    return unknown.instants(effects, t, instants)


def _gain(effects, t, temperature_c):
    drift = effects.get("gain_drift", {"rate_per_s": 0.0})["rate_per_s"]
    thermal = effects.get("temperature_sensitivity", {"coefficient_per_k": 0.0})
    gain = (effects.get("sensitivity_error", {"gain": 1.0})["gain"] * (1 + drift * t)
            * (1 + thermal["coefficient_per_k"] * (temperature_c - 25)))
    if "gain_step" in effects:
        gain = gain * np.where(t >= effects["gain_step"]["at_s"], effects["gain_step"]["ratio"], 1)
    return gain


def _cross_axis(by_axis):
    matrix = np.eye(3)
    for row, effects in enumerate(by_axis):
        for column, axis in enumerate(AXES):
            if row != column and "cross_axis_sensitivity" in effects:
                matrix[row, column] = effects["cross_axis_sensitivity"].get(axis, 0.0)
    return matrix


def _static(effects, values, t, temperature_c, phase):
    if "offset" in effects:
        values = values + effects["offset"]["offset"]
    if "thermal_offset" in effects:
        values = values + effects["thermal_offset"]["coefficient_per_k"] * (temperature_c - 25)
    if "offset_drift" in effects:
        values = values + effects["offset_drift"]["rate_per_s"] * t
    if "warm_up_drift" in effects:
        warm = effects["warm_up_drift"]
        values = values + warm["size"] * (1 - np.exp(-t / warm["time_constant_s"]))
    if "offset_step" in effects:
        values = values + effects["offset_step"]["step"] * (t >= effects["offset_step"]["at_s"])
    if "dead_zone" in effects:
        values = np.sign(values) * np.maximum(
            np.abs(values) - effects["dead_zone"]["half_width"], 0)
    if "tone_interference" in effects:
        tone = effects["tone_interference"]
        values = values + tone["amplitude"] * np.sin(2 * np.pi * tone["frequency_hz"] * t + phase)
    return values


def _age(rng, t, interval_s):
    """How much younger than on average a value is that another clock has read, whose oscillator
    wanders by some 1e-4 with a memory of ten seconds."""
    step_s = t[1] - t[0]
    keeps = np.exp(-step_s / 10)
    off = scipy.signal.lfilter([np.sqrt(1 - keeps**2)], [1, -keeps], rng.normal(size=len(t)))
    count = (t + 1e-4 * np.cumsum(off) * step_s) / interval_s + rng.random()
    return interval_s * (0.5 - count % 1)


def _bursts(rng, count, share, rms):
    """White noise for a share of the time, in stretches."""
    return rms * unknown.stretches(rng, count, share) * rng.normal(size=count)


def _stamps(t):
    return START_NS + np.round(t * 1e9).astype(np.int64)


def _reference(effects, excitation, t, logger, rng):
    """Stamps and values of the reference's messages, and which of its samples they are."""
    if logger.reference_rate_hz is None and not on_reference(effects):
        values = excitation.reference
    else:
        motion = recorded_motion(effects, excitation.acceleration, excitation.step_s)
        places = t / excitation.step_s + excitation.start
        values = np.stack([links.sample(axis, places) for axis in motion], axis=1)
    kept = np.ones(len(t), bool)
    if rng is not None:
        if "reference_noise" in effects:
            values = values + effects["reference_noise"]["std"] * rng.normal(size=values.shape)
        if logger.reference_lost:
            kept = rng.random(len(t)) >= logger.reference_lost
    return _stamps(t)[kept], values[kept], kept


def _noise_std(clean, rng, snr_db, noise_std):
    if rng is None:
        return np.zeros(3)
    if noise_std is not None:
        return np.broadcast_to(np.asarray(noise_std, float), 3).copy()
    std = clean.std(axis=0) * 10 ** (-snr_db / 20)
    return np.where(std > 0, std, std.max())


def _unit_noise(rng, n, ar):
    """Noise of unit standard deviation in the stationary state, shape (n, 3)."""
    warm_up = 1000 if len(ar) else 0
    denominator = np.append(1.0, -np.asarray(ar, float))
    noise = scipy.signal.lfilter([1.0], denominator, rng.normal(size=(n + warm_up, 3)), axis=0)
    impulse = scipy.signal.lfilter([1.0], denominator, np.eye(1, 10_000).ravel())
    return noise[warm_up:] / np.sqrt(np.sum(impulse ** 2))


def _logged(effects, stamps_ns, rng):
    """Stamps that the sensor's messages carry, and which messages there are."""
    kept = np.ones(len(stamps_ns), bool)
    if "timestamp_jitter" in effects:
        jitter = rng.normal(size=len(stamps_ns)) * effects["timestamp_jitter"]["rms_s"]
        stamps_ns = stamps_ns + np.round(jitter * 1e9).astype(np.int64)
    if "dropped_samples" in effects:
        kept = rng.random(len(stamps_ns)) >= effects["dropped_samples"]["fraction"]
    return stamps_ns[kept], kept
