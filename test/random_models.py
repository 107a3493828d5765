"""Random linear sensors over honest ranges, for the tests that sweep them."""

import rig

from frac_accel.model import SensorModel

KINDS = ("classical", "fractional", "arx", "fractional_transfer_function")
LINKS = ("mounting_resonance", "ac_coupling", "low_pass_lag", "time_delay", "sensitivity_error")
SAMPLE_EFFECTS = ("offset", "cross_axis_sensitivity")
RANGES = {"natural_frequency": (0.005, 0.3), "damping_ratio": (0.01, 1.5),
          "damping_order": (0.3, 1.7)}


def draw_sensor(rng, rate_hz, kinds=KINDS, links=LINKS, share=0.35, own_axes=0.0, **ranges):
    """`rig.Sensor` of a random kind, with each of the effects in a `share` of the draws.

    own_axes : chance that some axes get a core and effects of their own.
    """
    ranges = {**RANGES, **ranges}

    def draw():
        kind = kinds[rng.integers(len(kinds))]
        effects = [cause for cause in (*links, *SAMPLE_EFFECTS) if rng.random() < share]
        if kind == "classical" and rng.random() < share / 2:
            effects.append("fractional_damping")
        return rig.draw_sensor(rng, rate_hz, kind, effects, **ranges)

    sensor = draw()
    axes = {}
    if rng.random() < own_axes:
        for axis in "xyz":
            if rng.random() < 0.5:
                own = draw()
                axes[axis] = {"core": own.core, "effects": own.effects}
    return rig.Sensor(sensor.core, sensor.effects, axes)


def model_of(sensor):
    """The package's model of a `rig.Sensor`."""
    return SensorModel.from_dict(sensor.to_model())
