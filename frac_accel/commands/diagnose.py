"""Show what the simulation gets wrong, name the cause, extend the model, measure the gain."""

import sys

from ..errors import naming
from ..io.outputs import say
from ..io.topics import TEMPERATURE_TOPIC
from ._common import (
    add_bag,
    add_json,
    add_report,
    add_topics,
    open_bag,
    positive,
    provenance,
    read_temperature_at,
    require_report,
    share_done,
    write_json,
    write_page,
)

# Share of what is left from which a part of the error budget is told.
_SHOWN = 0.01
# Times what the model in use or the extended one leaves of held-out data, and share of the output,
# from which an extended model is not written that leaves more of the whole record.
_WORSE, _MUCH = 2.0, 0.2

EXAMPLES = """
frac_accel diagnose drive.mcap --model sensor.yaml --report found.html
frac_accel diagnose drive.mcap --model sensor.yaml --extended-model better.yaml --json found.json
"""


def add_arguments(parser):
    """Options of the verb."""
    add_bag(parser)
    parser.add_argument("--model", metavar="M.yaml",
                        help="model in use (default: a classical one is identified first)")
    add_topics(parser)
    parser.add_argument("--temperature", default=TEMPERATURE_TOPIC, metavar="TOPIC",
                        help="topic of the temperature, where there is one (default: %(default)s)")
    parser.add_argument("--extended-model", metavar="E.yaml",
                        help="write the model with what was found")
    parser.add_argument("--noise-std", type=positive, metavar="STD",
                        help="standard deviation of the sensor's noise, where it is known "
                             "[output units]")
    parser.add_argument("--time-limit", type=positive, default=60.0, metavar="SECONDS",
                        help="processor time after which the search ends and says what it left "
                             "out (default: %(default)g)")
    parser.add_argument("--screened", action="store_true",
                        help="also say in the JSON what each cause would be on its own, to first "
                             "order, with its uncertainty: what fleet pools over many bags")
    add_report(parser)
    add_json(parser)


def run(arguments):
    """Do it."""
    from ..diagnosis import diagnose
    from ..model import SensorModel
    require_report(arguments.report)
    model = SensorModel.load(arguments.model) if arguments.model else None
    reader = open_bag(arguments.bag)
    if arguments.temperature not in (*reader.topics, TEMPERATURE_TOPIC):
        print(f"warning: {arguments.bag}: no topic {arguments.temperature}: what depends on "
              "temperature cannot be found", file=sys.stderr)
    with share_done() as show, naming(arguments.bag):
        found = diagnose(arguments.bag, model, arguments.axis, arguments.temperature,
                         arguments.reference, arguments.sensor, show, arguments.noise_std,
                         arguments.time_limit, screening=arguments.screened)
    print(table(found, arguments.axis))
    command = f"frac_accel diagnose {arguments.bag} --axis {arguments.axis}" + (
        f" --model {arguments.model}" if arguments.model else "")
    source = provenance(arguments.bag, command)
    result = found.as_dict(arguments.extended_model)
    if arguments.extended_model and found.model is not None:
        found.model.metadata["provenance"] = source
        _write_extended(found, arguments, reader, result["extended"])
    if arguments.report:
        from ..report.diagnosis import diagnosis_page
        page = diagnosis_page(found, source)
        write_page(page, arguments.report)
        source = page.provenance
    write_json(arguments.json, {**result, "provenance": source})


def _write_extended(found, arguments, reader, told):
    """Write the extended model unless it does worse than is claimed, and tell what `validate` finds
    of it."""
    file, model = arguments.extended_model, found.model
    validated = told["validated_nrmse"] = _validated(model, arguments, reader)
    most = max(found.baseline["nrmse"], found.extended["nrmse"])
    if validated is not None and validated > max(_WORSE * most, _MUCH):
        say(f"{file}: not written: validate finds that the extended model leaves {validated:.3%} "
            f"of the whole record's output; the model in use leaves {found.baseline['nrmse']:.3%} "
            "of what is held out")
        told["model"] = None
        return
    model.save(file)
    say(f"{file}: written" + (
        f"; validate finds that it leaves {validated:.3%} of the whole record's output"
        if validated is not None else ""))
    if model.of_one_record:
        say(f"{file}: {model.of_one_record}")


def _validated(model, arguments, reader):
    """NRMSE of the whole record that `validate` gives of a model as its file has it; None where it
    gives none."""
    from ..errors import FracAccelError
    from ..io.bag import read_bag
    from ..model import SensorModel
    from ..validation import whole_nrmse
    model = SensorModel.from_dict(model.to_dict())
    topics = read_bag(arguments.bag, [arguments.reference, arguments.sensor])
    try:
        return whole_nrmse(
            (topics[arguments.reference], topics[arguments.sensor]), model, arguments.axis,
            read_temperature_at(reader, arguments.temperature) if model.needs_temperature else None)
    except FracAccelError:
        return None  # validate says why


def table(found, axis):
    """The diagnosis as text."""
    from ..report.quantity import written
    lines = [f"axis {axis}: {found.verdict}: {found.reason}"]
    lines += [f"data: {words}" for words in found.integrity.words]
    if found.verdict == "insufficient_data":
        return "\n".join(lines)
    if not found.evidence.has_temperature:
        lines.append("data: no temperature was recorded: what depends on it cannot be found")
    nrmse = found.baseline["nrmse"]
    of_output = f"{nrmse:.3%} of" if nrmse < 1 else f"{nrmse:.3g} times"
    lines.append(f"the model in use leaves {found.baseline['rmse']:.4g} "
                 f"({of_output} the output) on held-out data; "
                 f"{found.noise_words}")
    lines += _parted(found, "baseline", "of what it leaves")
    for finding in found.findings:
        lines.append(f"{finding.cause}: {finding.effect.explanation}")
        for name, entry in finding.as_dict()["parameters"].items():
            lines.append(f"  {name:21} {written(entry['value'], entry['std'], entry['unit'])}")
        lines += [f"  {words}" for words in finding.evidence]
    for suspect in found.suspects:
        lines += [f"suspected: {' or '.join(suspect['causes'])}: {suspect['reason']}",
                  f"  {suspect['experiment']}"]
    if found.cut_off:
        lines.append(found.cut_off)
    if found.is_extended:
        lines.append(f"the extended model leaves {found.extended['rmse']:.4g} "
                     f"({found.extended['nrmse']:.3%})" + (
                         f"; {found.unexplained_fraction:.1%} of the error's power above the noise "
                         "is unexplained" if found.findings else ""))
        lines += _parted(found, "extended", "of what that leaves")
    return "\n".join(lines)


def _parted(found, of, words):
    """The error budget of one model as a line; none where there is no budget."""
    shares = sorted(found.shares(of).items(), key=lambda entry: -entry[1])
    listed = ", ".join(f"{share:.0%} {part}" for part, share in shares if share >= _SHOWN)
    return [f"{words}: {listed} (docs/budget.md)"] if listed else []
