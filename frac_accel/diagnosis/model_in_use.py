"""The model that a search begins with, and what it leaves open."""

import dataclasses

import numpy as np

from ..errors import IdentificationError
from ..identification.response.excitation import held_out_of, require_excitation
from ..model import AXES, SensorModel
from ..model.core import Gain, Oscillator
from ..model.effects import known_effects
from .flat import flat_instead
from .relation import related_in_fast_motion
from .stretches import MOST, strongest_part

# Samples below which nothing is said.
FEWEST = 512
# Coefficients of a classical core with its delay: what the excitation must at least be good for.
_COEFFICIENTS = 4
# Share of its power in which a sensor must follow the reference at some frequencies or other, for
# causes to be looked for where no classical sensor can be identified.
_FOLLOWS = 0.5
# Parameters of a classical core.
CORE = ("natural_frequency_hz", "damping_ratio", "sensitivity")


def classical(record, axis, used, limit):
    """Classical core (a gain where no resonance shows) identified from the record, what it knows
    of it (nothing, since any cause has bent it), the effects that it was identified with, and those
    that describe the record as well with a gain."""
    from ..identification import identify
    # all that is found here is fitted anew
    record, used = strongest_part(record, AXES.index(axis), used, MOST)
    stds = dict.fromkeys(CORE, np.inf)
    try:
        found = identify(dataclasses.replace(record, valid=used), axis, "classical")
    except IdentificationError:
        gain = _gain_of_related(record, AXES.index(axis), used)
        if gain is None:
            raise
        return SensorModel(Gain(gain)), stds, {}, None
    core, seed = SensorModel(found.model.core), found.fitted_effects

    def open_in(model):
        return {cause: entry.effect
                for cause, entry in left_free(model.axis(axis), stds, 0.0).items()}
    rival = None
    if isinstance(core.core, Oscillator):
        core, seed, rival = flat_instead(record, AXES.index(axis), used, core, open_in, seed, limit)
    return core, stds, seed, rival


def _gain_of_related(record, column, used):
    """Gain of fast motion where a sensor follows the reference through some filter, such as one
    that takes most of the motion away, though no classical sensor does; else None."""
    follows, share = related_in_fast_motion(record.sensor[:, column], record.reference[:, column],
                                            used)
    if not follows or share < _FOLLOWS:
        return None
    answer, moved = (np.diff(values[:, column])[used[1:] & used[:-1]]
                     for values in (record.sensor, record.reference))
    return float(moved @ answer / max(moved @ moved, 1e-300)) or None


def too_poor(record, column, used, model):
    """Words where a record holds too little to be judged, or, without a model, to identify one."""
    reference = record.reference[:, column]
    last = held_out_of(reference, used)
    for rows, part in ((used & ~last, "training"), (used & last, "held-out")):
        if rows.sum() < FEWEST // 4:
            return f"only {rows.sum()} {part} samples; {FEWEST // 4} needed"
    try:
        if model is None:
            require_excitation(reference, record.sampling_rate_hz, _COEFFICIENTS)
    except IdentificationError as error:
        return str(error)
    return None


def stated_of(model, axis):
    """Standard uncertainties that a model states of its core, delay and offset."""
    own = model.axis(axis)
    stated = model.metadata.get("uncertainties")
    if not isinstance(stated, dict) or not isinstance(own.core, (Oscillator, Gain)) \
            or getattr(own.core, "damping_order", 1) != 1 \
            or any(effect.restates_core for effect in own.effects):
        return {}
    return {name: entry["std"] for name, entry in stated.items()
            if isinstance(entry, dict) and isinstance(entry.get("std"), (int, float))
            and np.isfinite(entry["std"]) and entry["std"] > 0}


def left_free(own, stds, stamps_std_s):
    """Causes that stay free in every fit, since model and stamps leave them open."""
    effects = {cause: effect.left_open(own, stds, stamps_std_s)
               for cause, effect in known_effects().items()}
    return {cause: entry for cause, entry in effects.items() if entry is not None}


def in_every_fit(loose, shown):
    """Effects by cause: what the model in use leaves open, and faults of the reference."""
    return {**{cause: entry.effect for cause, entry in loose.items()},
            **{cause: effect for cause, effect in shown.items() if effect.of_reference}}


def candidates_for(core):
    """Causes that are fitted, of those that a sensor with a core can have."""
    return [cause for cause, effect in known_effects().items()
            if not effect.read_off and effect.acts_on(core)]
