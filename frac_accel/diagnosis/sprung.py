"""Whether what a gain leaves, which is bent, is the spring of an oscillator that it hides."""

import dataclasses

from ..errors import IdentificationError
from ..model import AXES, SensorModel
from ..model.core import Gain
from ..model.effects import known_effects
from .stretches import MOST, strongest_part

# Share of what is left that must be even or odd, relative uncertainty up to which a natural
# frequency is known, and share of the residual power that an oscillator with its causes may leave.
_BENT, _KNOWN, _LESS = 0.5, 0.1, 0.5
_PARTS = ("even", "odd")


def is_bent(engine, best):
    """Whether a gain leaves what is mainly nonlinear, for which it has no cause."""
    core = engine.problem.baseline.axis(engine.problem.axis).core
    searched = engine.part or engine
    return isinstance(core, Gain) and sum(
        share for share, part in searched.structure(best) if part in _PARTS) > _BENT


def oscillator_of(record, axis, used):
    """Oscillator that a record determines although a gain, with a delay, describes it as well:
    `SensorModel` and the effects that it was identified with; or None.

    Far below its resonance a sensor is linear as a gain is, but its spring is bent all the same.
    """
    from ..identification import identify
    record, used = strongest_part(record, AXES.index(axis), used, MOST)
    try:
        found = identify(dataclasses.replace(record, valid=used), axis, "oscillator")
    except IdentificationError:
        return None
    resonance = found.parameters["natural_frequency_hz"]
    if not resonance["std"] < _KNOWN * resonance["value"]:
        return None
    return SensorModel(found.model.core), found.fitted_effects


def beside_spring(engine, best):
    """Causes that are tried with the oscillator: those that a gain cannot have, and what was found
    with it or is common. All else has been tried beside the gain, in vain."""
    core = engine.problem.baseline.axis(engine.problem.axis).core
    return [cause for cause, effect in known_effects().items()
            if not effect.read_off and (not effect.acts_on(core) or effect.everyday
                                        or cause in best.effects)]


def is_better(best, other):
    """Whether a fit with an oscillator leaves far less than one with a gain."""
    return other.cost < _LESS * best.cost
