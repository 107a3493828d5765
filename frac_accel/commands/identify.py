"""Identify a sensor model from a measured pair, with standard uncertainties."""

from ..identification import STRUCTURES, identify
from ..pair import load_pair
from ..report.identification import identification_page
from ._common import (
    add_bag,
    add_json,
    add_report,
    add_topics,
    open_bag,
    progress,
    provenance,
    require_output,
    require_report,
    step,
    write_json,
)


def add_arguments(parser):
    """Options of the verb."""
    add_bag(parser)
    parser.add_argument("--structure", choices=STRUCTURES, default="auto",
                        help="form of the model; auto chooses on held-out data "
                             "(default: %(default)s)")
    parser.add_argument("-o", "--output", required=True, metavar="M.yaml", help="model to write")
    add_report(parser)
    add_topics(parser)
    add_json(parser)


def run(arguments):
    """Do it."""
    require_output(arguments.output, arguments.bag)
    require_report(arguments.report, arguments.bag)
    open_bag(arguments.bag)
    pair = load_pair(arguments.bag, arguments.reference, arguments.sensor, arguments.axis)
    command = (f"frac_accel identify {arguments.bag} --structure {arguments.structure} --reference "
               f"{arguments.reference} --sensor {arguments.sensor} --axis {arguments.axis}")
    source = provenance(arguments.bag, command)
    with progress(None, unit="step") as bar:
        result = identify(pair, arguments.axis, arguments.structure, source,
                          lambda words: step(bar, words))
    result.model.save(arguments.output)
    print(f"{len(pair)} samples at {pair.sampling_rate_hz:.6g} Hz")
    print(result.excitation["words"])
    if result.excitation["kind"] == "multisine" and result.points and result.points.distortion:
        print(result.points.distortion["words"])
    print(result.excitation_check.words)
    print(f"{result.structure}: {result.reason}")
    for name, entry in result.parameters.items():
        print(f"  {name:21} {entry['value']:12.6g} +- {entry['std']:.2g} {entry['unit']}")
    print(f"  residual {result.nrmse:.3%} of the output, {result.held_out_nrmse:.3%} on held-out "
          "data")
    for note in result.notes:
        print(f"note: {note}")
    print(f"{arguments.output}: written")
    if arguments.report:
        identification_page(result, pair, arguments.axis, source).write(arguments.report)
        print(f"{arguments.report}: written")
    write_json(arguments.json, result.as_dict())
