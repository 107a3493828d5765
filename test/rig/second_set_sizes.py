"""Families of parameters of the second set, as `effect_sizes` has those of the first."""

import numpy as np

from .family import Family, excited_band


def second_set(rng, cause, rate_hz, core, output, sign):
    """Family of one cause of `SECOND_SET` or `VARIANTS`; see `effect_sizes.draw_family`.

    sign : float
        -1 or 1, drawn.
    """
    level, duration = output.std(), len(output) / rate_hz

    def single(name, smallest, largest, scale=1.0, most=0.3):
        return Family(smallest, largest, lambda size: {name: float(scale * size)}, most)

    def linear_phase_filter():
        order = int(rng.integers(1, 5))
        return Family(0.3, 20.0, lambda size: {"length_s": size / rate_hz, "order": order}, 1.4)

    def low_pass_filter():
        order, family = int(rng.integers(2, 9)), str(rng.choice(["butterworth", "bessel"]))
        return Family(0.5, 20.0, lambda size: {"corner_hz": rate_hz / size, "order": order,
                                               "family": family}, 1.4)

    def second_resonance():
        low, high = excited_band(output, rate_hz)
        frequency = float(low + (high - low) * rng.uniform(0.2, 0.9))
        ratio = float(np.exp(rng.uniform(np.log(0.01), np.log(0.1))))
        return Family(1e-5, 0.5, lambda size: {"frequency_hz": frequency, "damping_ratio": ratio,
                                               "share": float(sign * size)})

    def misalignment():
        direction = rng.normal(size=3)
        direction /= np.linalg.norm(direction)
        return Family(1e-3, 40.0, lambda size: dict(zip(
            ("roll_deg", "pitch_deg", "yaw_deg"), map(float, size * direction))))

    def turned_axes():
        # exchanged axes and reversed polarity, as x sees them
        name, angle = [("yaw_deg", 90.0), ("yaw_deg", -90.0), ("yaw_deg", 180.0),
                       ("pitch_deg", 90.0), ("pitch_deg", -90.0)][rng.integers(5)]
        angles = {"roll_deg": 0.0, "pitch_deg": 0.0, "yaw_deg": 0.0, name: angle}
        return Family(1.0, 1.0, lambda size: angles, most=2.0)

    def hardening_hysteresis():
        # beta + gamma < 0: the branches bend upwards, which bounded motion survives
        beta = float(rng.uniform(0.2, 0.6) / level)
        gamma = float(-beta * rng.uniform(1.2, 1.5))
        return Family(1e-6, 1.0, lambda size: {"strength": size, "beta": beta, "gamma": gamma})

    def impact_stop():
        stiffness = float(10 ** rng.uniform(1.3, 2.3))
        return Family(20 / len(output), 0.3, lambda size: {
            "gap": float(np.quantile(output, 1 - size if sign > 0 else size)),
            "stiffness": stiffness})

    def step_of(name, smallest, largest, neutral=0.0, most=1.0):
        at_s = float(duration * rng.uniform(0.2, 0.8))
        return Family(smallest, largest, lambda size: {
            "at_s": at_s, name: float(neutral + sign * size)}, most)

    def interference_bursts():
        share = float(np.exp(rng.uniform(np.log(0.005), np.log(0.1))))
        return Family(1e-6 * level, 10 * level, lambda size: {"share": share, "rms": size})

    def warm_up():
        time_constant_s = float(duration * np.exp(rng.uniform(np.log(0.03), np.log(0.5))))
        return Family(1e-6 * level, 3 * level, lambda size: {
            "size": float(sign * size), "time_constant_s": time_constant_s})

    def reference_low_pass():
        return Family(0.5, 20.0, lambda size: {"corner_hz": rate_hz / size}, most=1.0)

    def reference_smoothing():
        order = int(rng.integers(1, 5))
        return Family(0.3, 20.0, lambda size: {"length_s": size / rate_hz, "order": order}, 1.0)

    families = {
        "linear_phase_filter": linear_phase_filter,
        "low_pass_filter": low_pass_filter,
        "second_resonance": second_resonance,
        "misalignment": misalignment,
        "turned_axes": turned_axes,
        "late_stamps": lambda: Family(0.02, 0.3, lambda size: {"delay_s": size}, most=2.0),
        "hardening_hysteresis": hardening_hysteresis,
        "thermal_offset": lambda: single("coefficient_per_k", 1e-7 * level, level, sign, 1.0),
        "offset_drift": lambda: single("rate_per_s", 1e-6 * level / duration,
                                       5 * level / duration, sign, 1.0),
        "warm_up_drift": warm_up,
        "gain_step": lambda: step_of("ratio", 1e-6, 0.5, neutral=1.0, most=0.3),
        "offset_step": lambda: step_of("step", 1e-6 * level, 3 * level),
        "time_step": lambda: step_of("step_s", 1e-5 / rate_hz, 5 / rate_hz),
        "stiffness_drift": lambda: single("rate_per_s", 1e-6 / duration, 0.4 / duration, sign),
        "sampling_jitter": lambda: single("rms_s", 2e-8, 0.3 / rate_hz),
        # slower than the logger, it would be a sensor whose values are held
        "polled_readout": lambda: single("interval_s", 2e-8, 0.9 / rate_hz),
        "quadratic_damping": lambda: single("coefficient", 1e-7 / level, 10 / level),
        "impact_stop": impact_stop,
        "backlash": lambda: single("gap", 1e-6 * level, level),
        "interference_bursts": interference_bursts,
        "reference_ac_coupling": lambda: single("corner_hz", 1e-6 * rate_hz, 0.02 * rate_hz),
        "reference_low_pass": reference_low_pass,
        "reference_smoothing": reference_smoothing,
        "reference_delay": lambda: single("delay_s", 1e-5 / rate_hz, 3 / rate_hz, most=1.4),
        # down to 20 dB below the motion
        "reference_noise": lambda: single("std", 1e-6, 0.1, level / core["sensitivity"]),
    }
    return families[cause]()
