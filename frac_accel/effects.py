"""What plug-ins import: the effects, by a name that stays (docs/own_cause.md)."""

import sys

from .model import effects
from .model.effects import base, fit_starts

# the same modules, so that a class is the same by either name
sys.modules[__name__] = effects
sys.modules[f"{__name__}.base"] = base
sys.modules[f"{__name__}.fit_starts"] = fit_starts
