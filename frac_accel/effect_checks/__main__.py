"""``python -m frac_accel.effect_checks CAUSE``: the row for docs/effects.md, and what is broken."""

import sys

from ..errors import ModelError
from ..model.effects import effect_names, effect_of
from . import check_effect
from .declaration import row

try:
    cause, = sys.argv[1:] or [""]
    if cause not in effect_names():
        raise ModelError(f"cause: {cause!r} given, expected one of {', '.join(effect_names())}")
    print(row(effect_of(cause)))
    check_effect(effect_of(cause))
except ModelError as error:
    sys.exit(str(error))
print("keeps the contract")
