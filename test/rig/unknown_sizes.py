"""Families of parameters of the kinds outside the catalogue, as `effect_sizes` has the others."""

import numpy as np

from .family import Family, excited_band


def outside(rng, kind, rate_hz, core, output, sign, catalogue):
    """Family of one kind of `UNCATALOGUED`; see `effect_sizes.draw_family`.

    sign : float
        -1 or 1, drawn.
    catalogue : dict of callable
        Families of the causes that a wrong model may have.
    """
    level, duration = output.std(), len(output) / rate_hz
    band_hz = excited_band(output, rate_hz)
    felt = level / core["sensitivity"]  # of the acceleration, about

    def seeded(name, smallest, largest, most=0.3, **more):
        seed = int(rng.integers(2 ** 31))
        return Family(smallest, largest, lambda size: {name: size, **more, "seed": seed}, most)

    def signed(name, largest, scale=1.0, **more):
        return Family(1e-6, largest, lambda size: {name: float(sign * scale * size), **more})

    def modulation(name, smallest, largest):
        # Several periods in the record: a slower one would be a drift.
        frequency = float(rng.uniform(4, 200) / duration)
        phase = float(rng.uniform(0, 2 * np.pi))
        return Family(smallest, largest, lambda size: {name: size, "frequency_hz": frequency,
                                                       "phase_rad": phase})

    def two_mounts():
        # One of them within what is excited, or both together would look like one.
        ratio, second = float(rng.uniform(0.03, 0.2)), float(rng.uniform(0.55, 0.85))
        return Family(1.0, 3.0, lambda size: {
            "first_hz": float(1.2 * band_hz[1] / size),
            "second_hz": float(second * 1.2 * band_hz[1] / size),
            "damping_ratio": ratio}, most=1.5)

    def duffing_mount():
        frequency, ratio = float(band_hz[1] * rng.uniform(0.8, 1.5)), float(rng.uniform(0.05, 0.3))
        return Family(0.02, 0.3, lambda size: {
            "frequency_hz": frequency, "damping_ratio": ratio, "cubic": float(size / felt ** 2)},
            most=1.5)

    def slew_limit():
        speed = np.abs(np.diff(output)) * rate_hz
        return Family(20 / len(output), 0.5, lambda size: {
            "most_per_s": float(np.quantile(speed, 1 - size))})

    def rectification_memory():
        corner = float(rate_hz * 10 ** rng.uniform(-2.7, -1.7))
        return signed("strength", 0.5, 1 / level, corner_hz=corner)

    def wrong_model():
        cause = str(rng.choice(["low_pass_lag", "ac_coupling", "mounting_resonance"]))
        family = catalogue[cause]()
        return Family(family.smallest, family.largest, lambda size: {
            "effect": {cause: family.parameters(size)}}, family.most)

    families = {
        "gain_modulation": lambda: modulation("depth", 1e-6, 0.3),
        "moving_delay": lambda: modulation("amplitude_s", 1e-5 / rate_hz, 2 / rate_hz),
        "two_mounts": two_mounts,
        "duffing_mount": duffing_mount,
        "lever_arm": lambda: seeded("rms", 1e-5 * felt, felt, low_hz=float(band_hz[0]),
                                    high_hz=float(band_hz[1])),
        "slew_limit": slew_limit,
        "rectification_memory": rectification_memory,
        "tanh_saturation": lambda: Family(1e-3, 2.0, lambda size: {"limit": float(level / size)}),
        "asymmetric_gain": lambda: Family(1e-6, 0.5, lambda size: {
            "ratio": float(1 + sign * size)}),
        "gain_by_axis": lambda: signed("depth", 0.3),
        "delayed_cross_talk": lambda: signed("coefficient", 0.5,
                                             delay_s=float(rng.uniform(2, 20) / rate_hz)),
        "multiplicative_noise": lambda: seeded("depth", 1e-6, 0.5),
        "loose_contact": lambda: _loose_contact(rng),
        "held_values": lambda: seeded("share", 20 / len(output), 0.3, most=0.5),
        "folded_tones": lambda: seeded("amplitude", 1e-6 * level, level, rates_hz=[
            float(rate) for rate in rate_hz * rng.uniform(0.55, 2.4, 3)]),
        "wandering_offset": lambda: seeded("rms", 1e-6 * level, level, most=1.0),
        "resampling_glitches": lambda: Family(0.01, 1.2, lambda size: {
            "rate_hz": float(rate_hz / size)}),
        "batched_stamps": lambda: Family(2.0, 16.0, lambda size: {"count": round(size)}, most=2.0),
        "wrong_model": wrong_model,
    }
    return families[kind]()


def _loose_contact(rng):
    share, seed = float(rng.uniform(0.01, 0.1)), int(rng.integers(2 ** 31))
    return Family(1e-4, 1.0, lambda size: {"share": share, "gain": float(1 - size), "seed": seed})
