"""Identify a sensor model from a measured pair, with standard uncertainties.

Of several bags of one sensor, each gets a model that is judged on all others; the result is their
mean, and whether they agree is said.
"""

from pathlib import Path

from ..identification import STRUCTURES, identify
from ..io.outputs import say
from ..record import Record
from ..report.identification import identification_page
from ..report.quantity import left_open_by
from ._common import (
    BAG_HELP,
    add_json,
    add_report,
    add_topics,
    open_bag,
    printable,
    progress,
    provenance,
    require_report,
    step,
    write_json,
)


def add_arguments(parser):
    """Options of the verb."""
    parser.add_argument("bags", metavar="BAG", nargs="+", help=BAG_HELP)
    parser.add_argument("--structure", choices=STRUCTURES, default="auto",
                        help="form of the model; auto chooses on held-out data "
                             "(default: %(default)s)")
    parser.add_argument("-o", "--output", required=True, metavar="M.yaml", help="model to write")
    add_report(parser)
    add_topics(parser)
    add_json(parser)


def run(arguments):
    """Do it."""
    bags = arguments.bags
    require_report(arguments.report)
    for bag in bags:
        open_bag(bag)
    pairs = [Record.load(bag, arguments.reference, arguments.sensor, arguments.axis)
             for bag in bags]
    command = (f"frac_accel identify {' '.join(bags)} --structure {arguments.structure} "
               f"--reference {arguments.reference} --sensor {arguments.sensor} "
               f"--axis {arguments.axis}")
    source = _provenance(bags, command)
    with progress(None, unit="step") as bar:
        result = identify(pairs, arguments.axis, arguments.structure, source,
                          lambda words: step(bar, words),
                          [printable(Path(bag).name) for bag in bags])
    result.model.save(arguments.output)
    _print(result, pairs, bags)
    say(f"{arguments.output}: written")
    if arguments.report:
        page = identification_page(result, source)
        page.write(arguments.report)
        source = page.provenance
        say(f"{arguments.report}: written")
    write_json(arguments.json, {**result.as_dict(), "provenance": source})


def _print(result, pairs, bags):
    for bag, pair in zip(bags, pairs):
        name = f"{Path(bag).name}: " if len(bags) > 1 else ""
        print(f"{name}{len(pair)} samples at {pair.sampling_rate_hz:.6g} Hz")
    print(result.excitation.words)
    if result.excitation.kind == "multisine" and result.points and result.points.distortion:
        print(result.points.distortion["words"])
    print(f"structure: {result.structure} ({result.reason})")
    left_open = left_open_by(result.parameters, result.model.core)
    for name, entry in result.parameters.items():
        words = "open: these data do not determine it" if name in left_open \
            else f"{entry['value']:12.6g} +- {entry['std']:.2g} {entry['unit']}"
        print(f"  {name:21} {words}")
    print(f"  residual {result.nrmse:.3%} of the output, {result.held_out_nrmse:.3%} on held-out "
          "data")
    if result.validation.records:
        print(_table(result.validation.records))
    for line in result.validation.verdict:
        print(f"verdict: {line}")
    for note in result.notes:
        print(f"note: {note}")


def _provenance(bags, command):
    """Where the first bag comes from, as for one; the others' names and hashes beside it."""
    first, *others = [provenance(bag, command) for bag in bags]
    if others:
        first["further_bags"] = [{key: other[key] for key in ("bag", "sha256")}
                                 for other in others]
    return first


def _table(records):
    """Each record's model on each record, as text."""
    head = "model of, judged on"
    width = max(map(len, (*records.records, head)))
    rows = [*zip(records.records, records.nrmse), ("all together", records.combined_nrmse)]
    lines = [[f"{head:{width}}", *(f"{name:>{width}}" for name in records.records)]]
    lines += [[f"{name:{width}}", *(f"{value:{width}.3%}" for value in row)] for name, row in rows]
    return "\n".join("  ".join(["", *line]) for line in lines)
