"""Judge a model on a measured pair: its simulation, and the correction that it gives."""

from ..errors import FracAccelError
from ..io.outputs import say
from ._common import (
    add_bag,
    add_filter,
    add_json,
    add_model,
    add_report,
    add_temperature,
    add_topics,
    filter_wishes,
    open_bag,
    provenance,
    read_temperature_at,
    require_report,
    write_json,
)

_HEADING = "           band [Hz]   NRMSE [%]  amplitude [%]  phase [deg]   peak [%]"

EXAMPLES = """
frac_accel validate other_day.mcap --model sensor.yaml
frac_accel validate other_day.mcap --model sensor.yaml --axis z --report validated.html
"""


def add_arguments(parser):
    """Options of the verb."""
    add_bag(parser)
    add_model(parser)
    add_topics(parser)
    add_temperature(parser)
    add_filter(parser)
    add_report(parser)
    add_json(parser)


def run(arguments):
    """Do it."""
    from ..io.bag import read_bag
    from ..model import SensorModel
    from ..validation import validate
    require_report(arguments.report)
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
    if arguments.report:
        _page(result, model, arguments).write(arguments.report)
        say(f"{arguments.report}: written")
    write_json(arguments.json, result.as_dict())


def _page(result, model, arguments):
    from ..report.correction import BeforeAfter, correction_page, filter_words
    from ..report.quantity import percent
    axis, seen, filters = arguments.axis, result.comparison, result.filters
    drawn = BeforeAfter(axis, filters["sampling_rate_hz"], seen.stamps_ns, seen.before, seen.after,
                        seen.std, filters["axes"][axis]["band_hz"], seen.reference)
    summary = [f"NRMSE {percent(seen.scaled.total.nrmse)} before and "
               f"{percent(seen.corrected.total.nrmse)} after correction; the simulated output "
               f"differs from the measured one by {percent(result.simulation.total.nrmse)}.",
               filter_words(axis, filters)]
    source = provenance(arguments.bag, f"frac_accel validate {arguments.bag} --model "
                        f"{arguments.model} --reference {arguments.reference} --sensor "
                        f"{arguments.sensor} --axis {axis}")
    return correction_page(
        f"Validation, axis {axis}", [drawn], summary, source, model,
        {"simulated against measured output": result.simulation,
         "raw / sensitivity against reference": seen.scaled,
         "corrected against reference": seen.corrected})


def table(result, axis):
    """Metrics as text."""
    from ..report.quantity import fixed, short
    signals = [("simulated against measured output"
                + (", turned into the reference's axes" if result.turned else ""),
                result.simulation),
               ("raw / sensitivity against reference", result.comparison.scaled),
               ("corrected against reference", result.comparison.corrected)]
    lines = []
    for title, metrics in signals:
        lines.append(f"{title}, axis {axis}")
        lines.append(_HEADING)
        for band in (*metrics.bands, metrics.total):
            low, high = band.band_hz
            lines.append(f"  {low:8.4g} .. {high:<8.4g} {fixed(100 * band.nrmse):>9} "
                         f"{fixed(100 * band.amplitude_error):>14} "
                         f"{fixed(band.phase_error_deg):>12} {fixed(100 * band.peak_error):>10}")
        lines.append(f"  median relative error {metrics.median_relative_error_percent:.3f} %")
        if metrics is result.simulation:
            lines.append(f"  at all frequencies: NRMSE {100 * result.whole_nrmse:.3f} %")
    filters, design = result.filters, result.filters["axes"][axis]
    low, high = design["band_hz"]
    delay, own = (short(filters[name], "s") for name in ("filter_delay_s", "sensor_delay_s"))
    lines.append(f"filter: {low:.4g} to {high:.4g} Hz, delay {delay} (and the sensor's own {own}, "
                 f"taken out of the stamps), worst error {design['worst_amplitude_error']:.2%} and "
                 f"{design['worst_phase_error_deg']:.3f} deg, "
                 f"noise gain {design['noise_gain']:.3g}")
    return "\n".join(lines)
