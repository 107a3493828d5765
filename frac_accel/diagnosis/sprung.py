"""Whether a gain hides an oscillator: by what it leaves, or by what it takes to imitate one."""

import dataclasses

import numpy as np

from ..errors import IdentificationError
from ..model import AXES, SensorModel, is_link
from ..model.core import Gain
from ..model.effects import known_effects
from .stretches import MOST, strongest_part

# Share of what is left that must be even or odd, relative uncertainty up to which a natural
# frequency is known, and share of the residual power that an oscillator with its causes may leave.
_BENT, _KNOWN, _LESS = 0.5, 0.2, 0.5
_PARTS = ("even", "odd")
# Variances of the noise by which an oscillator must be better than a link that is one by another
# name, and standard uncertainty of its damping ratio from which nothing else tells them apart.
_CLEARLY, _ANY_DAMPING = 10.0, 0.02
_SAME = ("it answers as an oscillator does, and the sensor may be one: without a model of it "
         "nothing tells which it is (damping ratio {:.2g} ± {:.1g})")


def may_hide_one(engine, best):
    """Whether a gain leaves what is mainly nonlinear, for which it has no cause, or its filters do
    not suffice: they leave what is linear, lie at the ends of what was searched, or are an
    oscillator by another name."""
    core = engine.problem.baseline.axis(engine.problem.axis).core
    if not isinstance(core, Gain):
        return False
    if by_another_name(engine, best):
        return True
    searched = engine.part or engine
    structure = searched.structure(best)
    if sum(share for share, part in structure if part in _PARTS) > _BENT:
        return True
    return not searched.noise_only(best) and any(map(is_link, best.effects.values())) and (
        any(part == "linear" for _, part in structure) or searched.hollow(best))


def by_another_name(engine, best):
    """Causes of a set that answer as an oscillator does: two poles that are no lags, no zero."""
    return {cause for cause in best.causes - engine.search.base.keys()
            if len(poles := best.effects[cause].poles()) == 2 and np.all(poles.imag)
            and not len(best.effects[cause].zeros())}


def oscillator_of(record, axis, used):
    """Oscillator that a record determines although a gain, with a delay, describes it as well:
    `SensorModel`, the effects that it was identified with, and its damping ratio with the standard
    uncertainty; or None.

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
    damping = found.parameters["damping_ratio"]
    return (SensorModel(found.model.core), found.fitted_effects,
            (damping["value"], damping["std"]))


def beside_spring(engine, best):
    """Causes that are tried with the oscillator: those that a gain cannot have or has without a
    mass, and what was found with it or is common. All else has been tried beside the gain, in
    vain."""
    core = engine.problem.baseline.axis(engine.problem.axis).core
    return [cause for cause, effect in known_effects().items()
            if not effect.read_off and (not effect.acts_on(core) or effect.bends_at_once
                                        or effect.everyday or cause in best.effects)]


def is_better(engine, best, other, leaves_noise):
    """Whether a fit with an oscillator leaves far less than one with a gain; or less with no more
    parameters, and nothing but noise."""
    if by_another_name(engine, best):
        return other.cost < best.cost * (1 - _CLEARLY / engine.problem.count)
    enough = 1.0 if leaves_noise and other.size <= best.size else _LESS
    return other.cost < enough * best.cost


def as_the_sensor(engine, best, other, damping):
    """Why causes that answer as an oscillator does are not named, in words by cause: a fit with
    one, whose damping ratio with its uncertainty may be any, leaves as little."""
    if damping[1] < _ANY_DAMPING or other.cost > best.cost * (1 + _CLEARLY / engine.problem.count):
        return {}
    return dict.fromkeys(by_another_name(engine, best), _SAME.format(*damping))
