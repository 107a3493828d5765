"""Part what a model leaves of the sensor's signal by kind, in seconds, without naming anything."""

import sys

from ..errors import FracAccelError
from ._common import (
    add_bag,
    add_json,
    add_temperature,
    add_topics,
    open_bag,
    positive,
    read_temperature_at,
    write_json,
)

EXAMPLES = """
frac_accel budget drive.mcap
frac_accel budget drive.mcap --model sensor.yaml --json budget.json
"""


def add_arguments(parser):
    """Options of the verb."""
    add_bag(parser)
    parser.add_argument("--model", metavar="M.yaml",
                        help="model in use (default: the best static gain and offset, with a delay "
                             "of whole samples)")
    add_topics(parser)
    parser.add_argument("--second-sensor", metavar="TOPIC",
                        help="another sensor on the same body: what both share is the reference's "
                             "or the fixture's")
    parser.add_argument("--noise-std", type=positive, metavar="STD",
                        help="the sensor's noise, where it is known [output units]")
    add_temperature(parser)
    add_json(parser)


def run(arguments):
    """Do it."""
    from ..budget import left_by
    from ..io.bag import read_bag
    from ..model import SensorModel
    model = SensorModel.load(arguments.model) if arguments.model else None
    reader = open_bag(arguments.bag)
    wanted = [arguments.reference, arguments.sensor]
    if arguments.second_sensor:
        wanted.append(arguments.second_sensor)
    topics = read_bag(arguments.bag, wanted)
    temperature_at = read_temperature_at(reader, arguments.temperature) \
        if model is not None and arguments.temperature in reader.topics else None
    try:
        left = left_by(topics[arguments.reference], topics[arguments.sensor], model,
                       arguments.axis, arguments.noise_std,
                       topics.get(arguments.second_sensor), temperature_at)
    except FracAccelError as error:
        raise type(error)(f"{arguments.bag}: {error}") from None
    for words in (*left.words, *left.noise.words):
        print(f"note: {words}", file=sys.stderr)
    print(table(left, arguments.axis))
    write_json(arguments.json, {"axis": arguments.axis, **left.as_dict()})


def table(left, axis):
    """The budget as text, the largest part first."""
    from ..budget import WORDS
    budget = left.budget
    whole = budget.rms / max(budget.output_rms, 1e-300)
    lines = [f"axis {axis}: {left.model}, leaves {budget.rms:.4g} RMS: {whole:.3g} of the "
             f"output's {budget.output_rms:.4g}" if whole > 1 else
             f"axis {axis}: {left.model}, leaves {budget.rms:.4g} RMS, {whole:.2%} of the output"]
    if budget.parts:
        lines.append(f"{'part':13}{'of what is left':>16}{'95 % interval':>18}"
                     f"{'of the output':>15}")
    known, words = left.noise.rms, dict(WORDS)
    if known is not None:
        words["noise"] += f"; {known / max(budget.output_rms, 1e-300):.2%} of the output is noise"
    for entry in sorted(budget.parts, key=lambda entry: -entry["share"]):
        low, high = entry["ci95"]
        lines.append(f"{entry['part']:13}{entry['share']:>16.1%}"
                     f"{f'{low:.1%} to {high:.1%}':>18}{entry['of_output']:>15.2%}"
                     f"   {words[entry['part']]}")
    lines.append(left.unaccounted["words"])
    return "\n".join(lines)
