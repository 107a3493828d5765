"""The record as it is searched: in the reference's axes, and which of its samples count."""

import dataclasses

import numpy as np

from ..errors import FracAccelError, IdentificationError
from ..identification.checks.clipped import clipped_before_resampling, clipped_sensor
from ..identification.checks.record_checks import moving_samples, unclipped_reference
from ..model import AXES
from ..model.core import Gain, Oscillator
from ..model.effects import known_effects
from ..record import Record
from ..record.clipping import at_limits
from ..record.orientation import Orientation
from ..simulation import AxisSimulator
from .spikes import spikes
from .stretches import MOST, strongest_part

# Share of the record in which the reference may be clipped: what is found is judged, and what it
# leaves there shows.
_CLIPPED_REFERENCE = 0.02


def with_motion(record, column):
    """The record without the instants at which the reference is clipped; the others, less those at
    which one topic stands still while the other moves; and words."""
    moving, notes = moving_samples(record, column)
    unclipped, more = unclipped_reference(record, column, moving, _CLIPPED_REFERENCE)
    # what moved there nobody knows: no budget parts it either
    record = dataclasses.replace(record, valid=record.valid & (unclipped | ~moving))
    return record, unclipped, [*notes, *more]


def with_limits(found, record, column, used):
    """`Integrity` with limits at which too few samples pile up to be certain by themselves, where
    a classical sensor, identified without them, goes beyond."""
    if "sensor" in record.resampled:
        measured = record.topics[1].values[:, column]
        clipping = clipped_before_resampling(record, column, used, (found.lower, found.upper))
    elif record.resampled:
        return found
    else:
        measured = record.sensor[:, column]
        certain = (measured == found.lower) | (measured == found.upper)
        clipping = clipped_sensor(record.reference[:, column], measured, used & ~certain,
                                  found.step, record.sampling_rate_hz, record.lag_s)
    if not clipping.samples.any():
        return found
    lower = clipping.lower if found.lower is None else found.lower
    upper = clipping.upper if found.upper is None else found.upper
    return dataclasses.replace(
        found, lower=lower, upper=upper,
        words=found.words + at_limits(measured[clipping.samples], clipping.lower, clipping.upper))


def in_axes_of_reference(record, source, axis, temperature, model):
    """The record of a sensor whose axis follows another one, turned; its topics, `Orientation`
    (None where it was not turned), and words."""
    orientation = _orientation(record, model)
    if orientation is None or orientation.is_against_constants(record):
        return record, source, None, []
    opposes = orientation.opposes(axis, -1 if model and _inverts(model.axis(axis)) else 1)
    if model and opposes and not orientation.upside_down:
        return record, source, None, [
            f"the sensor's {axis} axis points the other way than the model says, or its polarity "
            "is reversed: a gain below zero says that"]
    if not (orientation.astray(axis) or (opposes and orientation.upside_down and (
            model or _reversed_as_identified(record, axis)))):
        return record, source, None, []
    try:
        source = source[0], orientation.turn(source[1])
        turned = Record.of(*source, axis, temperature)
    except FracAccelError:
        return record, source, None, []  # the refusal says which axis it follows
    return turned, source, orientation, [
        f"the sensor lies turned: {orientation.words}; what follows holds for its signal turned "
        "into the reference's axes"]


def _reversed_as_identified(record, axis):
    """Whether a classical sensor of a record has a gain below zero: above a resonance all axes look
    reversed, and are not."""
    from ..identification import identify
    try:
        part, _ = strongest_part(record, AXES.index(axis), record.valid, MOST)
        return _inverts(identify(part, axis, "classical").model.axis(axis))
    except IdentificationError:
        return True  # nothing speaks against the turn


def _orientation(record, model):
    """Orientation of a record's sensor; where it does not lie as its reference does, and there is a
    model, against what that makes of the reference if that explains more: a resonance may have
    most of the power, and above it all axes look reversed."""
    found = Orientation.of(record)
    if model is None or found is None or (any(map(found.followed, AXES)) and not found.words):
        return found
    try:
        # as the reference, a sensor that inverts has its own sign
        answer = [AxisSimulator(record.reference[:, i], record.sampling_rate_hz,
                                record.temperature_c).simulate(own) * (-1 if _inverts(own) else 1)
                  for i, own in enumerate(map(model.axis, AXES))]
    except FracAccelError:
        return found
    answered = Orientation.of(dataclasses.replace(record, reference=np.stack(answer, axis=1)))
    return max((one for one in (answered, found) if one is not None),
               key=lambda one: np.nansum(one.explained))


def _inverts(own):
    """Whether a model turns slow motion round."""
    return own.core.sensitivity < 0 if isinstance(own.core, (Gain, Oscillator)) else False


def shown_by_record(found, record, column, used):
    """Causes that the record shows by itself; the samples that count with these; its spikes; and
    those that say nothing of other causes."""
    measured = record.sensor[:, column]
    effects = by_record(found, measured)
    stray = used & spikes(measured, record.reference[:, column], found.step)
    silent = np.zeros(len(used), bool)
    for effect in effects.values():
        silent |= record.instants_of(effect.spoiled, column)
    return effects, used & ~stray & ~silent, stray, silent


def by_record(found, measured):
    """Causes that the record shows by itself, as effects by cause."""
    effects = {cause: effect.of_record(found, measured)
               for cause, effect in known_effects().items()}
    return {cause: effect for cause, effect in effects.items() if effect is not None}


def with_noise(found, noise):
    """`Integrity` with the reference's noise, where that is enough to bend a fit."""
    if noise is None or not noise.bends:
        return found
    return dataclasses.replace(found, reference_noise=noise, words=[*found.words, noise.words])


def stated_noise(samples, column):
    """Standard deviation [m/s²] that the messages of a topic state, or NaN."""
    stated = samples.variance[:, column]
    return np.sqrt(np.nanmean(stated)) if np.isfinite(stated).any() else np.nan
