"""What plug-ins import to declare parameters, by a name that stays (docs/own_cause.md)."""

import sys

from .model import parameters

sys.modules[__name__] = parameters
