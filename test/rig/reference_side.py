"""What is recorded of the motion: the reference has faults of its own.

The sensor feels the motion as it is; only what stands in the record changes.
"""

import numpy as np

from . import filters, links


def recorded_motion(effects, acceleration, step_s):
    """Motion on the grid as the reference passes it on, shape (3, points), without its noise."""
    result = np.array(acceleration)
    for axis, values in enumerate(acceleration):
        if not values.any():
            continue
        if "reference_ac_coupling" in effects:
            values = links.high_pass(values, step_s, **effects["reference_ac_coupling"])
        if "reference_low_pass" in effects:
            values = links.low_pass(values, step_s, **effects["reference_low_pass"])
        if "reference_smoothing" in effects:
            values = _smoothed(values, step_s, **effects["reference_smoothing"])
        if "reference_delay" in effects:
            values = links.delayed(values, effects["reference_delay"]["delay_s"] / step_s)
        result[axis] = values
    return result


def on_reference(effects):
    """Whether some fault of the reference changes more than its noise."""
    return any(name in effects for name in
               ("reference_ac_coupling", "reference_low_pass", "reference_smoothing",
                "reference_delay"))


def _smoothed(values, step_s, length_s, order):
    """Moving averages that lie as much after each instant as before it; the last value holds on."""
    ahead = order * length_s / 2 / step_s
    whole = int(np.ceil(ahead))
    late = filters.moving_average(np.pad(values, (0, whole), mode="edge"), step_s, length_s, order)
    return links.delayed(late, whole - ahead)[whole:]
