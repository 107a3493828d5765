"""Judge a model on a measured pair: its simulation, and the correction that it gives."""

from ..errors import FracAccelError
from ..io.bag import read_bag
from ..model import SensorModel
from ..validation import validate
from ._common import (
    add_bag,
    add_filter,
    add_json,
    add_model,
    add_temperature,
    add_topics,
    filter_wishes,
    open_bag,
    read_temperature_at,
    write_json,
)

_HEADING = "           band [Hz]   NRMSE [%]  amplitude [%]  phase [deg]   peak [%]"


def add_arguments(parser):
    """Options of the verb."""
    add_bag(parser)
    add_model(parser)
    add_topics(parser)
    add_temperature(parser)
    add_filter(parser)
    add_json(parser)


def run(arguments):
    """Do it."""
    model = SensorModel.load(arguments.model)
    reader = open_bag(arguments.bag)
    temperature = None
    if model.needs_temperature:
        temperature = read_temperature_at(reader, arguments.temperature)
    topics = read_bag(arguments.bag, [arguments.reference, arguments.sensor])
    try:
        result = validate((topics[arguments.reference], topics[arguments.sensor]), model,
                          arguments.axis, temperature_at=temperature, **filter_wishes(arguments))
    except FracAccelError as error:
        raise type(error)(f"{arguments.bag}: {error}") from None
    print(table(result, arguments.axis))
    for words in result.words:
        print(f"data: {words}")
    write_json(arguments.json, result.as_dict())


def table(result, axis):
    """Metrics as text."""
    signals = [("simulated against measured output", result.simulation),
               ("raw / sensitivity against reference", result.comparison.scaled),
               ("corrected against reference", result.comparison.corrected)]
    lines = []
    for title, metrics in signals:
        lines.append(f"{title}, axis {axis}")
        lines.append(_HEADING)
        for band in (*metrics.bands, metrics.total):
            low, high = band.band_hz
            lines.append(f"  {low:8.4g} .. {high:<8.4g} {100 * band.nrmse:9.3f} "
                         f"{100 * band.amplitude_error:14.3f} {band.phase_error_deg:12.3f} "
                         f"{100 * band.peak_error:10.3f}")
        lines.append(f"  median relative error {metrics.median_relative_error_percent:.3f} %")
    filters, design = result.filters, result.filters["axes"][axis]
    low, high = design["band_hz"]
    lines.append(f"filter: {low:.4g} to {high:.4g} Hz, delay {filters['filter_delay_s']:.4g} s "
                 f"(and the sensor's own {filters['sensor_delay_s']:.4g} s, taken out of the "
                 f"stamps), worst error {design['worst_amplitude_error']:.2%} and "
                 f"{design['worst_phase_error_deg']:.3f} deg, "
                 f"noise gain {design['noise_gain']:.3g}")
    return "\n".join(lines)
