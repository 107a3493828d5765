"""From an excitation and a sensor to the record that a logger would keep."""

import dataclasses

import numpy as np
import scipy.signal

from . import links
from .general_equation import integrate_general
from .oscillator import integrate
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
        Base acceleration [m/s²].
    sensor_stamps_ns : ndarray of int64, shape (m,)
        Stamps of the sensor: those of the reference, but for jitter and lost messages.
    sensor : ndarray, shape (m, 3)
        Sensor's output.
    clean : ndarray, shape (m, 3)
        The same without noise, clipping and quantisation.
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
                    temperature_c=None):
    """Record of a sensor on a moving base.

    Parameters
    ----------
    sensor : Sensor
    excitation : Excitation
    rng : numpy.random.Generator, optional
        For noise, jitter, losses and the tone's phase; without it there is no noise.
    snr_db : float
        Level of each axis's signal over its noise; axes without signal get the largest noise.
    noise_std : float or sequence of three, optional
        Noise [output units] instead of `snr_db`.
    noise_ar : sequence of float
        Coloured noise n[k] = sum of noise_ar[i] * n[k-1-i] + white, of the same standard deviation.
    temperature_c : ndarray, shape (samples,), optional
        Default: 25 °C, or from 15 to 45 °C where the sensor has a temperature effect.

    Returns
    -------
    Record
    """
    t = np.arange(excitation.samples) / excitation.rate_hz
    by_axis = [sensor.on_axis(axis)[1] for axis in AXES]
    if temperature_c is None:
        warms = any("temperature_sensitivity" in effects for effects in by_axis)
        temperature_c = np.linspace(15, 45, len(t)) if warms else np.full(len(t), 25.0)
    clean = np.stack([
        _gain(effects, t, temperature_c)
        * links.sample(_linear_output(sensor, axis, excitation),
                       _instants(effects, t) / excitation.step_s + excitation.start)
        for axis, effects in zip(AXES, by_axis)], axis=1)
    clean = clean @ _cross_axis(by_axis).T
    for axis, effects in enumerate(by_axis):
        clean[:, axis] = _static(effects, clean[:, axis], t, rng)

    noise_std = _noise_std(clean, rng, snr_db, noise_std)
    values = clean.copy()
    if rng is not None:
        values += noise_std * _unit_noise(rng, len(t), noise_ar)
    for axis, effects in enumerate(by_axis):
        if "clipping" in effects:
            values[:, axis] = np.clip(values[:, axis], effects["clipping"]["lower"],
                                      effects["clipping"]["upper"])
        if "quantization" in effects:
            step = effects["quantization"]["step"]
            values[:, axis] = step * np.round(values[:, axis] / step)

    stamps_ns = START_NS + np.round(t * 1e9).astype(np.int64)
    sensor_stamps_ns, kept = _logged(sensor.effects, stamps_ns, rng)
    return Record(stamps_ns, excitation.reference, sensor_stamps_ns, values[kept], clean[kept],
                  noise_std, temperature_c, sensor)


def _linear_output(sensor, axis, excitation):
    """Output of mounting, core and conditioner on the grid."""
    core, effects = sensor.on_axis(axis)
    values = excitation.acceleration[AXES.index(axis)]
    if not values.any():
        return np.zeros_like(values)
    step_s = excitation.step_s
    if "mounting_resonance" in effects:
        values = links.mounting(values, step_s, **effects["mounting_resonance"])
    values = _core_output(core, effects, values, step_s)
    if "ac_coupling" in effects:
        values = links.high_pass(values, step_s, **effects["ac_coupling"])
    if "low_pass_lag" in effects:
        values = links.low_pass(values, step_s, **effects["low_pass_lag"])
    return values


def _core_output(core, effects, values, step_s):
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
            **_stop(effects)).q
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
    stop = effects["impact_stop"]
    return {"stop": (stop.get("lower", -np.inf), stop.get("upper", np.inf), stop["stiffness"])}


def _instants(effects, t):
    """Time at which the value stamped t was true."""
    skew_ppm = effects.get("clock_skew", {"skew_ppm": 0.0})["skew_ppm"]
    instants = t * (1 + 1e-6 * skew_ppm) - effects.get("time_delay", {"delay_s": 0.0})["delay_s"]
    if "moving_delay" in effects:
        moving = effects["moving_delay"]
        instants = instants - moving["amplitude_s"] * _sine(moving, t)
    return instants


def _sine(effect, t):
    return np.sin(2 * np.pi * effect["frequency_hz"] * t + effect["phase_rad"])


def _gain(effects, t, temperature_c):
    drift = effects.get("gain_drift", {"rate_per_s": 0.0})["rate_per_s"]
    thermal = effects.get("temperature_sensitivity", {"coefficient_per_k": 0.0})
    gain = (effects.get("sensitivity_error", {"gain": 1.0})["gain"] * (1 + drift * t)
            * (1 + thermal["coefficient_per_k"] * (temperature_c - 25)))
    if "gain_modulation" in effects:
        modulation = effects["gain_modulation"]
        gain = gain * (1 + modulation["depth"] * _sine(modulation, t))
    return gain


def _cross_axis(by_axis):
    matrix = np.eye(3)
    for row, effects in enumerate(by_axis):
        for column, axis in enumerate(AXES):
            if row != column and "cross_axis_sensitivity" in effects:
                matrix[row, column] = effects["cross_axis_sensitivity"].get(axis, 0.0)
    return matrix


def _static(effects, values, t, rng):
    if "offset" in effects:
        values = values + effects["offset"]["offset"]
    if "dead_zone" in effects:
        values = np.sign(values) * np.maximum(
            np.abs(values) - effects["dead_zone"]["half_width"], 0)
    if "tone_interference" in effects:
        tone = effects["tone_interference"]
        phase = 2 * np.pi * (0.0 if rng is None else rng.random())
        values = values + tone["amplitude"] * np.sin(2 * np.pi * tone["frequency_hz"] * t + phase)
    return values


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
