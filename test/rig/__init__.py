"""Independent simulator of accelerometers, the judge of frac_accel.

It shares no line with the package, integrates the equation of motion by time steps at 64 times the
record's rate, and has its own fractional derivative; `test_rig_accuracy.py` measures its error.
"""

from .exact_response import exact_output, transfer_function
from .excitation import (
    Excitation,
    band_noise,
    multisine,
    noise_bursts,
    shock,
    sines,
    stepped_sine,
    swept_sine,
)
from .record import Record, simulate_record
from .sensor import CAUSES, SECOND_SET, UNCATALOGUED, Sensor, draw_effect, draw_sensor

__all__ = [
    "CAUSES", "SECOND_SET", "UNCATALOGUED", "Excitation", "Record", "Sensor", "band_noise",
    "draw_effect", "draw_sensor", "exact_output", "multisine", "noise_bursts", "shock",
    "simulate_record", "sines", "stepped_sine", "swept_sine", "transfer_function",
]
