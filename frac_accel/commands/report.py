"""Draw the page of a result again, without the bag."""

import json

from ..diagnosis import Diagnosis
from ..errors import FracAccelError
from ..io.outputs import say
from ..io.regular_file import read_text
from ..report.diagnosis import diagnosis_page
from ._common import require_report

_LARGEST = 64 * 2**20
"""Bytes of a result."""
_NOT_A_RESULT = LookupError, TypeError, ValueError, AttributeError, ArithmeticError, RecursionError
"""What drawing a page of anything else ends in."""


def add_arguments(parser):
    """Options of the verb."""
    parser.add_argument("result", metavar="RESULT.json", help="what diagnose --json has written")
    parser.add_argument("-o", "--output", required=True, metavar="R.html", help="the page")


def run(arguments):
    """Do it."""
    require_report(arguments.output)
    data = _read(arguments.result)
    try:
        diagnosis_page(_diagnosis(arguments.result, data), data.get("provenance")).write(
            arguments.output)
    except FracAccelError:
        raise
    except _NOT_A_RESULT as error:
        raise FracAccelError(
            f"{arguments.result}: no complete result of a diagnosis, expected what frac_accel "
            f"diagnose --json writes ({type(error).__name__})") from None
    say(f"{arguments.output}: written")


def _diagnosis(path, data):
    try:
        return Diagnosis.from_dict(data)
    except FracAccelError as error:
        raise FracAccelError(f"{path}: {error}") from None


def _read(path):
    try:
        return json.loads(read_text(path, _LARGEST))
    except OSError as error:
        raise FracAccelError(f"{path}: cannot read the result: {error.strerror}") from None
    except (ValueError, RecursionError) as error:
        raise FracAccelError(f"{path}: not valid JSON: {error}") from None
