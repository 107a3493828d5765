"""Effects around the core of a sensor model: one cause, one file, one class.

Third parties add theirs through the entry-point group ``frac_accel.effects``; each entry is a
subclass of `Effect`.
"""

import functools
import importlib
import pkgutil
from importlib.metadata import entry_points

from ..errors import FracAccelError
from .base import Circumstances, Effect

__all__ = ["Circumstances", "Effect", "known_effects"]


@functools.cache
def known_effects():
    """Mapping of cause to effect class: those of this folder and of installed extensions."""
    for module in pkgutil.iter_modules(__path__):
        importlib.import_module(f"{__name__}.{module.name}")
    ours = {effect.cause: effect for effect in Effect.__subclasses__()
            if effect.__module__.startswith(f"{__name__}.")}
    extensions = [_load(entry) for entry in entry_points(group="frac_accel.effects")]
    return {**{effect.cause: effect for effect in extensions}, **ours}


def _load(entry):
    try:
        return entry.load()
    except Exception as error:
        raise FracAccelError(f"the installed extension {entry.name} ({entry.value}) cannot be "
                             f"loaded: {error}") from error
