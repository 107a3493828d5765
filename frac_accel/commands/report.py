"""Draw the page of a result again, without the bag."""

import json

from ..errors import FracAccelError
from ..io.outputs import say
from ..io.regular_file import read_text
from ._common import require_report

_LARGEST = 64 * 2**20
"""Bytes of a result."""
_NOT_A_RESULT = LookupError, TypeError, ValueError, AttributeError, ArithmeticError, RecursionError
"""What drawing a page of anything else ends in."""

EXAMPLES = """
frac_accel report found.json -o found.html
"""


def add_arguments(parser):
    """Options of the verb."""
    parser.add_argument("result", metavar="RESULT.json",
                        help="what diagnose or identify --json has written")
    parser.add_argument("-o", "--output", required=True, metavar="R.html", help="the page")


def run(arguments):
    """Do it."""
    require_report(arguments.output)
    data = _read(arguments.result)
    try:
        _page(arguments.result, data).write(arguments.output)
    except FracAccelError:
        raise
    except _NOT_A_RESULT as error:
        raise FracAccelError(f"{arguments.result}: no complete result, expected what frac_accel "
                             "diagnose or identify --json writes "
                             f"({type(error).__name__})") from None
    say(f"{arguments.output}: written")


def _page(path, data):
    try:
        if not isinstance(data, dict) or not {"verdict", "structure"} & data.keys():
            raise FracAccelError("no result of a diagnosis or an identification, expected what "
                                 "frac_accel diagnose or identify --json writes")
        return page_of(data)
    except FracAccelError as error:
        raise FracAccelError(f"{path}: {error}") from None


def page_of(data):
    """Page of a result of diagnose or identify, from what --json writes of it."""
    if "verdict" in data:
        from ..diagnosis import Diagnosis
        from ..report.diagnosis import diagnosis_page
        return diagnosis_page(Diagnosis.from_dict(data), data.get("provenance"))
    from ..identification import Identification
    from ..report.identification import identification_page
    return identification_page(Identification.from_dict(data), data.get("provenance"))


def _read(path):
    try:
        return json.loads(read_text(path, _LARGEST))
    except OSError as error:
        raise FracAccelError(f"{path}: cannot read the result: {error.strerror}") from None
    except (ValueError, RecursionError) as error:
        raise FracAccelError(f"{path}: not valid JSON: {error}") from None
