"""Write a layout for Foxglove or PlotJuggler: raw, reference, corrected with its ± 2u, health.

The band is computed by the program itself from the covariance of the corrected messages.
"""

import re

from ..errors import FracAccelError
from ..io.outputs import say, write_text
from ..report.layouts import Topics, foxglove, plotjuggler

EXAMPLES = """
frac_accel layout foxglove -o layout.json
frac_accel layout plotjuggler --namespace axle/front -o front.xml
frac_accel layout foxglove --namespace axle/front --node /corrector --sensor front -o front.json
"""
_PROGRAMS = {"foxglove": foxglove, "plotjuggler": plotjuggler}
_NAME = re.compile(r"/?([A-Za-z_]\w*)(/[A-Za-z_]\w*)*/?")


def add_arguments(parser):
    """Options of the verb."""
    # a list: completion takes a mapping for commands of their own
    parser.add_argument("program", choices=list(_PROGRAMS))
    parser.add_argument("-o", "--output", required=True, metavar="FILE", help="layout to write")
    parser.add_argument("--namespace", default="", metavar="NS",
                        help="where the sensor's topics are (default: the root)")
    parser.add_argument("--node", default="", metavar="NODE",
                        help="full name of the corrector (default: corrector in the namespace)")
    parser.add_argument("--sensor", default="", metavar="NAME",
                        help="its name in a node of many, whose metrics_topics is true")


def run(arguments):
    """Do it."""
    names = {name: getattr(arguments, name) for name in ("namespace", "node", "sensor")}
    for option, name in names.items():
        if name not in ("", "/") and not _NAME.fullmatch(name):
            raise FracAccelError(f"--{option}: {name!r} given, expected a name such as axle/front")
    try:
        write_text(arguments.output, _PROGRAMS[arguments.program](Topics(**names)))
    except OSError as error:
        raise FracAccelError(f"{arguments.output}: cannot write the layout: {error.strerror}") \
            from None
    say(f"{arguments.output}: written")
