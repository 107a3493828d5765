"""Identify a sensor model from a measured pair, with standard uncertainties.

Of several bags of one sensor, each gets a model that is judged on all others; the result is their
mean, and whether they agree is said.
"""

from pathlib import Path

from ..errors import FracAccelError, naming
from ..io.outputs import say
from ._common import (
    BAG_HELP,
    STRUCTURES,
    add_json,
    add_report,
    add_topics,
    open_bag,
    printable,
    provenance,
    require_report,
    share_done,
    write_json,
    write_page,
)

EXAMPLES = """
frac_accel identify bench.mcap -o sensor.yaml
frac_accel identify monday.mcap tuesday.mcap -o sensor.yaml --report sensor.html
frac_accel identify bench.mcap --axis z --reference /shaker/imu --sensor /seat/imu -o seat.yaml
"""


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
    from ..identification import identify
    from ..record import Record
    bags = arguments.bags
    require_report(arguments.report)
    for bag in bags:
        open_bag(bag)
    pairs = []
    for bag in bags:
        with naming(bag):
            pairs.append(Record.load(bag, arguments.reference, arguments.sensor, arguments.axis))
    command = (f"frac_accel identify {' '.join(bags)} --structure {arguments.structure} "
               f"--reference {arguments.reference} --sensor {arguments.sensor} "
               f"--axis {arguments.axis}")
    source = _provenance(bags, command)
    with share_done() as show:
        result = identify(pairs, arguments.axis, arguments.structure, source, show,
                          [printable(bag) for bag in _told_apart(bags)])
    result.model.save(arguments.output)
    _print(result, pairs, bags)
    say(f"{arguments.output}: written")
    if arguments.report:
        from ..report.identification import identification_page
        page = identification_page(result, source)
        write_page(page, arguments.report)
        source = page.provenance
    write_json(arguments.json, {**result.as_dict(), "provenance": source})


def _told_apart(bags):
    """Names of the bags, with their folders where two are alike."""
    names = [Path(bag).name for bag in bags]
    return names if len(set(names)) == len(names) else bags


def _print(result, pairs, bags):
    from ..report.quantity import held_out_words, left_open_by, written
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
            else written(entry["value"], entry["std"], entry["unit"])
        print(f"  {name:21} {words}")
    print(f"  residual {result.nrmse:.3%} of the output, {held_out_words(result.held_out_nrmse)}")
    if result.validation.records:
        print(_table(result.validation.records))
    for line in result.validation.verdict:
        print(f"verdict: {line}")
    for note in result.notes:
        print(f"note: {note}")


def _provenance(bags, command):
    """Where the first bag comes from, as for one; the others' names and hashes beside it."""
    first, *others = [provenance(bag, command) for bag in bags]
    seen = {}
    for bag, entry in zip(bags, [first, *others]):
        if entry["sha256"] in seen:
            raise FracAccelError(f"{bag}: holds the same record as {seen[entry['sha256']]}, which "
                                 "would count twice; name it once")
        seen[entry["sha256"]] = bag
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
