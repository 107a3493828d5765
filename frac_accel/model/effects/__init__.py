"""Effects around the core of a sensor model: one cause, one file, one class.

Third parties add theirs through the entry-point group ``frac_accel.effects``: the entry's name is
the cause, its value a subclass of `Effect`. It is loaded when a model or a diagnosis asks for it.
"""

import functools
import importlib
import pkgutil
from importlib.metadata import entry_points

from ...errors import ModelError
from ..parameters import parameter_fields
from .base import Circumstances, Effect

__all__ = ["IDENTIFIED", "Circumstances", "Effect", "broken_extensions", "effect_names",
           "effect_of", "fault_of_reference", "forget_extensions", "identified_effect",
           "known_effects"]


@functools.cache
def _own():
    """Effects of this folder by cause."""
    for module in pkgutil.iter_modules(__path__):
        importlib.import_module(f"{__name__}.{module.name}")
    return {effect.cause: effect for effect in Effect.__subclasses__()
            if effect.__module__.startswith(f"{__name__}.")}


@functools.cache
def _extensions():
    """Entry points of installed extensions by cause; ours come first."""
    return {entry.name: entry for entry in entry_points(group="frac_accel.effects")
            if entry.name not in _own()}


def effect_names():
    """All causes, those of installed extensions included, without loading these."""
    return sorted({**_own(), **_extensions()})


@functools.cache
def effect_of(cause):
    """Class of the effects of a cause.

    Raises
    ------
    KeyError
        If there is no such cause.
    ModelError
        If it is that of an installed extension which cannot be loaded.
    """
    if cause in _own():
        return _own()[cause]
    entry = _extensions()[cause]
    where = f"the installed extension {entry.name} ({entry.value})"
    try:
        effect = entry.load()
    except Exception as error:
        raise ModelError(f"{where} cannot be loaded: {type(error).__name__}: {error}") from None
    if not (isinstance(effect, type) and issubclass(effect, Effect)):
        raise ModelError(f"{where} is no subclass of frac_accel.Effect")
    if getattr(effect, "cause", None) != entry.name:
        raise ModelError(f"{where} declares the cause {getattr(effect, 'cause', None)!r}, expected "
                         "the name of its entry point")
    return effect


def known_effects():
    """Mapping of cause to effect class: ours, and those of the extensions that can be loaded."""
    broken = broken_extensions()
    return {cause: effect_of(cause) for cause in effect_names() if cause not in broken}


@functools.cache
def broken_extensions():
    """Mapping of cause to what is wrong, for installed extensions that cannot be loaded."""
    broken = {}
    for cause in _extensions():
        try:
            effect_of(cause)
        except ModelError as error:
            broken[cause] = str(error)
    return broken


def forget_extensions():
    """Look for installed extensions again when next asked."""
    for remembered in (_extensions, effect_of, broken_extensions):
        remembered.cache_clear()


# Effects that state what `identify` finds beside a core, by its name there.
IDENTIFIED = {effect.identified_as: effect for effect in _own().values() if effect.identified_as}


def identified_effect(parameter, value):
    """Effect that states what ``identify`` found beside a core, such as ``delay_s``."""
    return IDENTIFIED[parameter](value)


def longest_identified(parameter):
    """Largest value that a model may hold of what ``identify`` finds beside a core."""
    return parameter_fields(IDENTIFIED[parameter])[0].metadata["maximum"]


def fault_of_reference(effect):
    """The reference's fault that a record cannot tell from what no sensor can do, or None."""
    return next((fault.mirrored(effect) for fault in _own().values()
                 if fault.of_reference and fault.mirrors == effect.cause), None)
