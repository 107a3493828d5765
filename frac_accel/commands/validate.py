"""Judge a model on a measured pair: its simulation, and the correction that it gives.

Where no correction can be designed, the simulation is judged alone, and a warning says why.
"""

import math
import sys

from ..errors import DesignError, FracAccelError
from ._common import (
    add_bag,
    add_filter,
    add_json,
    add_model,
    add_report,
    add_temperature,
    add_topics,
    filter_wishes,
    one_line,
    open_bag,
    provenance,
    read_temperature_at,
    require_report,
    write_json,
    write_page,
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
    if result.no_correction:
        print(f"warning: there is no correction: {_why(result)}", file=sys.stderr)
    for words in result.words:
        print(f"data: {words}")
    if arguments.report:
        write_page(_page(result, model, arguments), arguments.report)
    write_json(arguments.json, result.as_dict())


def _page(result, model, arguments):
    from ..report.correction import BeforeAfter, correction_page, filter_words
    from ..report.quantity import percent
    from ..report.signals import sentence
    axis, seen, filters = arguments.axis, result.comparison, result.filters
    simulated = ("the simulated output differs from the measured one by "
                 f"{percent(result.simulation.total.nrmse)}.")
    metrics = {"simulated against measured output": result.simulation}
    if seen is None:
        drawn, summary = [], [sentence(simulated), f"There is no correction: {_why(result)}."]
    else:
        drawn = [BeforeAfter(axis, filters["sampling_rate_hz"], seen.stamps_ns, seen.before,
                             seen.after, seen.std, filters["axes"][axis]["band_hz"],
                             seen.reference)]
        summary = [f"NRMSE {percent(seen.scaled.total.nrmse)} before and "
                   f"{percent(seen.corrected.total.nrmse)} after correction; {simulated}",
                   filter_words(axis, filters)]
        metrics |= {"raw / sensitivity against reference": seen.scaled,
                    "corrected against reference": seen.corrected}
    source = provenance(arguments.bag, f"frac_accel validate {arguments.bag} --model "
                        f"{arguments.model} --reference {arguments.reference} --sensor "
                        f"{arguments.sensor} --axis {axis}")
    return correction_page(f"Validation, axis {axis}", drawn, summary, source, model, metrics)


def _why(result):
    """Why there is no correction, in the command's words."""
    return one_line(DesignError(result.no_correction))


def table(result, axis):
    """Metrics as text."""
    from ..report.quantity import fixed, short
    signals = [("simulated against measured output"
                + (", turned into the reference's axes" if result.turned else ""),
                result.simulation)]
    if result.comparison:
        signals += [("raw / sensitivity against reference", result.comparison.scaled),
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
        lines.append(f"  median relative error {fixed(metrics.median_relative_error_percent)} %")
        if metrics is result.simulation:
            where = f"up to {result.whole_hz:.4g} Hz" if result.whole_hz else "at all frequencies"
            lines.append(f"  {where}: NRMSE {fixed(100 * result.whole_nrmse)} %")
        if any(not math.isfinite(band.nrmse) for band in metrics.bands):
            lines.append("  -: the record is too short to tell, or the reference too quiet there")
    if not result.comparison:
        return "\n".join(lines)
    filters, design = result.filters, result.filters["axes"][axis]
    low, high = design["band_hz"]
    delay, own = (short(filters[name], "s") for name in ("filter_delay_s", "sensor_delay_s"))
    lines.append(f"filter: {low:.4g} to {high:.4g} Hz, delay {delay} (and the sensor's own {own}, "
                 f"taken out of the stamps), worst error {design['worst_amplitude_error']:.2%} and "
                 f"{design['worst_phase_error_deg']:.3f} deg, "
                 f"noise gain {design['noise_gain']:.3g}")
    return "\n".join(lines)
