"""The truth about a simulated sensor, and random sensors."""

import copy
import dataclasses

import numpy as np

from .exact_response import transfer_function

AXES = "xyz"

# Causes in the order in which the signal meets them (design: signal order).
CAUSES = (
    "mounting_resonance",
    "core_parameter_shift", "fractional_damping", "quadratic_stiffness", "cubic_stiffness",
    "hysteresis", "coulomb_friction",
    "ac_coupling", "low_pass_lag",
    "time_delay", "clock_skew",
    "sensitivity_error", "gain_drift", "temperature_sensitivity",
    "cross_axis_sensitivity", "offset", "dead_zone", "tone_interference",
    "clipping", "quantization",
    "timestamp_jitter", "dropped_samples",
)

# Causes of measured records (design: second set), in the same order.
#   impact_stop   acts where q is beyond `gap`: above it where it is positive, below it where it is
#                 negative
#   backlash      `gap` is the whole width of the play
#   misalignment  the sensor's axes seen from the reference's: R = Rz(yaw) Ry(pitch) Rx(roll) turns
#                 a vector in the sensor's axes into the reference's
#   reference_smoothing  `order` moving averages, each centred on its instant
#   interference_bursts  `rms` is that within a burst
SECOND_SET = (
    "misalignment",
    "stiffness_drift", "quadratic_damping", "impact_stop", "backlash", "second_resonance",
    "low_pass_filter", "linear_phase_filter",
    "time_step", "sampling_jitter", "polled_readout",
    "gain_step", "thermal_offset", "offset_drift", "offset_step", "warm_up_drift",
    "interference_bursts",
    "reference_ac_coupling", "reference_low_pass", "reference_smoothing", "reference_delay",
    "reference_noise",
)

# They change what was recorded of the motion, and not what the sensor feels.
ON_REFERENCE = ("reference_ac_coupling", "reference_low_pass", "reference_smoothing",
                "reference_delay", "reference_noise")

# Physics that no cause of the package describes: a diagnosis may not give it one of the names
# above. A sensor model cannot say it either, so `to_model` leaves it out. What each one is and its
# parameters stand in `unknown.py`; besides, each may have `begins_s` [s], before which it is not
# there.
UNCATALOGUED = (
    "gain_modulation", "moving_delay",
    "two_mounts", "duffing_mount", "lever_arm",
    "slew_limit", "rectification_memory", "tanh_saturation", "asymmetric_gain",
    "gain_by_axis", "delayed_cross_talk", "multiplicative_noise", "loose_contact", "held_values",
    "folded_tones", "wandering_offset", "resampling_glitches", "batched_stamps", "wrong_model",
)


@dataclasses.dataclass(frozen=True)
class Sensor:
    """A core and its effects, in the words of the sensor-model file.

    Attributes
    ----------
    core : dict
        As in the file, with its `type`; `gain` is flat, with its `sensitivity`.
    effects : dict of str to dict
        Cause -> parameters; their order does not matter, the signal's order is fixed.
    axes : dict of str to dict
        Axis -> {"core": ..., "effects": ...}; what is given there replaces the above.
    """

    core: dict
    effects: dict = dataclasses.field(default_factory=dict)
    axes: dict = dataclasses.field(default_factory=dict)

    def __post_init__(self):
        for effects in (self.effects, *(a.get("effects", {}) for a in self.axes.values())):
            unknown = set(effects) - {*CAUSES, *SECOND_SET, *UNCATALOGUED}
            if unknown:
                raise ValueError(f"unknown causes {sorted(unknown)}")

    def on_axis(self, axis):
        """Core and effects that hold for one axis."""
        own = self.axes.get(axis, {})
        return own.get("core", self.core), own.get("effects", self.effects)

    def to_model(self):
        """Content of the sensor-model file that says the same, but for the reference's faults."""
        model = {"schema": "frac_accel/sensor_model/1", "core": self.core,
                 "effects": _as_list(self.effects)}
        if self.axes:
            model["axes"] = {
                axis: {key: _as_list(value) if key == "effects" else value
                       for key, value in own.items()}
                for axis, own in self.axes.items()}
        return copy.deepcopy(model)


def _as_list(effects):
    """In the order of the lists; what is the reference's is not the sensor's."""
    return [{"cause": cause, **effects[cause]} for cause in (*CAUSES, *SECOND_SET)
            if cause in effects and cause not in ON_REFERENCE]


def draw_sensor(rng, rate_hz, kind="classical", effects=(), level=1.0,
                natural_frequency=(0.03, 0.3), damping_ratio=(0.02, 1.0),
                damping_order=(0.4, 1.6)):
    """Random sensor, the same on all three axes.

    Parameters
    ----------
    kind : str
        classical, fractional, arx or fractional_transfer_function.
    effects : sequence of str
        Causes to draw.
    level : float
        RMS of the base acceleration [m/s²] for which amplitude-dependent effects are scaled.
    natural_frequency : tuple of float
        Range as a fraction of the sampling rate.
    """
    natural_hz = rate_hz * _log_uniform(rng, *natural_frequency)
    ratio = _log_uniform(rng, *damping_ratio)
    sensitivity = _log_uniform(rng, 0.2, 5.0)
    order = _away_from(rng, 1.0, *damping_order, gap=0.1)
    if kind in ("classical", "fractional"):
        core = {"type": "oscillator", "natural_frequency_hz": natural_hz, "damping_ratio": ratio,
                "damping_order": order if kind == "fractional" else 1.0,
                "sensitivity": sensitivity}
    elif kind == "arx":
        core = _draw_arx(rng, rate_hz, natural_hz, ratio, sensitivity)
    elif kind == "fractional_transfer_function":
        core = _draw_general(rng, natural_hz, ratio, sensitivity)
    else:
        raise ValueError(f"kind {kind!r}")
    return Sensor(core, {cause: draw_effect(rng, cause, rate_hz, core,
                                            level * _noise_gain(core, rate_hz))
                         for cause in effects})


def _noise_gain(core, rate_hz):
    """RMS of the output for noise of unit RMS up to 0.3 times the sampling rate."""
    s = 2j * np.pi * rate_hz * np.linspace(1e-4, 0.3, 20_000)
    return np.sqrt(np.mean(np.abs(transfer_function(Sensor(core), "x", s)) ** 2))


def _draw_arx(rng, rate_hz, natural_hz, ratio, sensitivity):
    """Poles of a sampled oscillator and two zeros inside the unit circle."""
    ratio = min(ratio, 0.95)
    pole = np.exp(2 * np.pi * natural_hz / rate_hz * (-ratio + 1j * np.sqrt(1 - ratio ** 2)))
    denominator = np.poly([pole, pole.conjugate()]).real
    numerator = np.poly(rng.uniform(-0.6, 0.6, 2))
    numerator *= sensitivity * denominator.sum() / numerator.sum()
    return {"type": "arx", "numerator": numerator.tolist(), "denominator": denominator.tolist(),
            "sampling_rate_hz": rate_hz}


def _draw_general(rng, natural_hz, ratio, sensitivity):
    """Stable, because all coefficients are positive and no order exceeds 2."""
    natural = 2 * np.pi * natural_hz
    highest, middle, slope = rng.uniform(1.8, 2.0), rng.uniform(0.3, 1.2), rng.uniform(0.3, 1.0)
    return {"type": "fractional_transfer_function",
            "denominator_coefficients": [natural ** -highest, 2 * ratio * natural ** -middle, 1.0],
            "denominator_orders": [highest, middle, 0.0],
            "numerator_coefficients": [sensitivity * rng.uniform(0.02, 0.2) * natural ** -slope,
                                       sensitivity],
            "numerator_orders": [slope, 0.0]}


def draw_effect(rng, cause, rate_hz, core, level):
    """Random parameters of one cause; `level` is the RMS of the sensor's output."""
    def signed(low, high):
        return rng.choice([-1, 1]) * rng.uniform(low, high)

    def between(low, high):
        return rng.uniform(low, high)

    draws = {
        "mounting_resonance": lambda: {"frequency_hz": rate_hz * between(0.2, 0.45),
                                       "damping_ratio": between(0.03, 0.2)},
        "core_parameter_shift": lambda: {
            "natural_frequency_hz": core["natural_frequency_hz"] * (1 + signed(0.05, 0.2)),
            "damping_ratio": core["damping_ratio"] * (1 + signed(0.1, 0.4))},
        "fractional_damping": lambda: {"damping_order": _away_from(rng, 1.0, 0.4, 1.6, gap=0.15),
                                       "damping_ratio": _log_uniform(rng, 0.05, 0.7)},
        "quadratic_stiffness": lambda: {"alpha2": signed(0.005, 0.03) / level},
        "cubic_stiffness": lambda: {"alpha3": between(0.003, 0.03) / level ** 2},
        "hysteresis": lambda: {"strength": between(0.05, 0.3), "beta": between(0.5, 2) / level,
                               "gamma": signed(0.1, 0.4) / level},
        "coulomb_friction": lambda: {"level": between(0.02, 0.1) * level},
        "ac_coupling": lambda: {"corner_hz": rate_hz * _log_uniform(rng, 5e-4, 1e-2)},
        "low_pass_lag": lambda: {"corner_hz": rate_hz * _log_uniform(rng, 0.1, 0.5)},
        "time_delay": lambda: {"delay_s": between(0.2, 3.0) / rate_hz},
        "clock_skew": lambda: {"skew_ppm": signed(20, 200)},
        "sensitivity_error": lambda: {"gain": 1 + signed(0.02, 0.1)},
        "gain_drift": lambda: {"rate_per_s": signed(0.003, 0.02)},
        "temperature_sensitivity": lambda: {"coefficient_per_k": signed(5e-4, 3e-3)},
        "cross_axis_sensitivity": lambda: {axis: signed(0.01, 0.05) for axis in AXES},
        "offset": lambda: {"offset": signed(0.05, 0.5) * level},
        "dead_zone": lambda: {"half_width": between(0.02, 0.1) * level},
        "tone_interference": lambda: {"frequency_hz": rate_hz * between(0.05, 0.4),
                                      "amplitude": between(0.05, 0.2) * level},
        "clipping": lambda: {"lower": -between(1.5, 2.5) * level,
                             "upper": between(1.5, 2.5) * level},
        "quantization": lambda: {"step": between(0.02, 0.1) * level},
        "timestamp_jitter": lambda: {"rms_s": between(0.02, 0.1) / rate_hz},
        "dropped_samples": lambda: {"fraction": between(0.002, 0.02)},
    }
    return {name: float(value) for name, value in draws[cause]().items()}


def _log_uniform(rng, low, high):
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _away_from(rng, centre, low, high, gap):
    """Uniform between low and high, at least `gap` away from the centre."""
    while True:
        value = float(rng.uniform(low, high))
        if abs(value - centre) >= gap:
            return value
