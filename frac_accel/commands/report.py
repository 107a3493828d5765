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


def add_arguments(parser):
    """Options of the verb."""
    parser.add_argument("result", metavar="RESULT.json", help="what diagnose --json has written")
    parser.add_argument("-o", "--output", required=True, metavar="R.html", help="the page")


def run(arguments):
    """Do it."""
    require_report(arguments.output)
    data = _read(arguments.result)
    try:
        found = Diagnosis.from_dict(data)
    except FracAccelError as error:
        raise FracAccelError(f"{arguments.result}: {error}") from None
    diagnosis_page(found, data.get("provenance")).write(arguments.output)
    say(f"{arguments.output}: written")


def _read(path):
    try:
        return json.loads(read_text(path, _LARGEST))
    except OSError as error:
        raise FracAccelError(f"{path}: cannot read the result: {error.strerror}") from None
    except (ValueError, RecursionError) as error:
        raise FracAccelError(f"{path}: not valid JSON: {error}") from None
