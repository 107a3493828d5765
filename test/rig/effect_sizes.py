"""Each cause as a family of parameters that one size moves from nothing to the physically possible.

All but the size is drawn at random once; the size is then set for an effect of a wanted strength.
"""

import numpy as np

from .family import Family
from .second_set_sizes import second_set
from .sensor import UNCATALOGUED
from .unknown_sizes import outside


def draw_family(rng, cause, rate_hz, core, output):
    """Family of one cause.

    Parameters
    ----------
    core : dict
        The classical core that the effect is added to.
    output : ndarray, shape (n,)
        Output without any effect: what levels, limits and steps are measured by.
    """
    level, duration = output.std(), len(output) / rate_hz
    sign = rng.choice([-1.0, 1.0])

    def quantile(share):
        return float(np.quantile(output, share))

    def single(name, smallest, largest, scale=1.0, most=0.3):
        return Family(smallest, largest, lambda size: {name: float(scale * size)}, most)

    def mounting_resonance():
        ratio = float(rng.uniform(0.03, 0.2))
        return Family(1.0, 5.0, lambda size: {"frequency_hz": 0.5 * rate_hz / size,
                                              "damping_ratio": ratio}, most=1.0)

    def core_parameter_shift():
        angle = np.radians(rng.uniform(20, 70))
        frequency, ratio = np.cos(angle) * sign, np.sin(angle) * rng.choice([-1.0, 1.0])
        return Family(1e-5, 0.35, lambda size: {
            "natural_frequency_hz": float(core["natural_frequency_hz"] * np.exp(frequency * size)),
            "damping_ratio": float(core["damping_ratio"] * np.exp(2 * ratio * size))})

    def fractional_damping():
        slope = rng.uniform(-0.5, 0.5)
        return Family(1e-4, 1.0, lambda size: {
            "damping_order": float(1 + 0.6 * sign * size),
            "damping_ratio": float(core["damping_ratio"] * np.exp(slope * size))})

    def hysteresis():
        beta = float(rng.uniform(0.5, 2.0) / level)
        gamma = float(sign * rng.uniform(0.1, 0.4) / level)
        return Family(1e-6, 1.0, lambda size: {"strength": size, "beta": beta, "gamma": gamma})

    def cross_axis_sensitivity():
        angle = rng.uniform(0, 2 * np.pi)
        return Family(1e-6, 0.3, lambda size: {"y": float(size * np.cos(angle)),
                                               "z": float(size * np.sin(angle))})

    def clipping():
        # Both limits are reached, by a few samples at least.
        below = rng.uniform(0.3, 1.0)
        return Family(20 / len(output), 0.3, lambda size: {"lower": quantile(below * size),
                                                           "upper": quantile(1 - size)})

    def tone_interference():
        frequency = float(rate_hz * rng.uniform(0.05, 0.4))
        return Family(1e-6 * level, level, lambda size: {"frequency_hz": frequency,
                                                         "amplitude": size})

    def low_pass_lag():
        return Family(1.0, 20.0, lambda size: {"corner_hz": rate_hz / size})

    families = {
        "mounting_resonance": mounting_resonance,
        "core_parameter_shift": core_parameter_shift,
        "fractional_damping": fractional_damping,
        "quadratic_stiffness": lambda: single("alpha2", 1e-7 / level, 0.3 / level, sign),
        "cubic_stiffness": lambda: single("alpha3", 1e-7 / level ** 2, 0.3 / level ** 2, sign),
        "hysteresis": hysteresis,
        "coulomb_friction": lambda: single("level", 1e-6 * level, 0.3 * level),
        "ac_coupling": lambda: single("corner_hz", 1e-6 * rate_hz, 0.02 * rate_hz),
        "low_pass_lag": low_pass_lag,
        "time_delay": lambda: single("delay_s", 1e-5 / rate_hz, 3 / rate_hz, most=1.4),
        "clock_skew": lambda: single("skew_ppm", 1e-3, 500.0, sign),
        "sensitivity_error": lambda: Family(1e-6, 0.3, lambda size: {
            "gain": float(1 + sign * size)}),
        "gain_drift": lambda: single("rate_per_s", 1e-6 / duration, 0.5 / duration, sign),
        "temperature_sensitivity": lambda: single("coefficient_per_k", 1e-7, 0.01, sign),
        "cross_axis_sensitivity": cross_axis_sensitivity,
        "offset": lambda: single("offset", 1e-6 * level, level, sign, most=1.0),
        "dead_zone": lambda: single("half_width", 1e-6 * level, level),
        "tone_interference": tone_interference,
        "clipping": clipping,
        "quantization": lambda: single("step", 1e-5 * level, level),
        # Stamps stay in order: half an interval is more than four times the scatter.
        "timestamp_jitter": lambda: single("rms_s", 2e-8, 0.12 / rate_hz),
        "dropped_samples": lambda: single("fraction", 0.002, 0.05),
    }
    if cause in families:
        return families[cause]()
    if cause in UNCATALOGUED:
        return outside(rng, cause, rate_hz, core, output, sign, families)
    return second_set(rng, cause, rate_hz, core, output, sign)
