"""Filters that act beyond what the record shows."""

import numpy as np

from ...model import is_link
from ...model.core import Oscillator
from ..late_reference import is_reference_late
from ..problem import follows_path
from .links import (
    RINGS,
    core_is_identified,
    end_of_band_hz,
    filters_of,
    highest_hz,
    highest_seen_hz,
    largest_damping,
    power_of,
)

# Share of the motion's power beyond whose frequencies none is seen, and times the highest of these
# from which a resonance is out of sight.
_ALL_MOTION, _OUT_OF_SIGHT = 0.9999, 1.2
# Share of a motion's size below which a reference shows none of it, and of what a cause takes
# (power) that lies there.
_UNSHOWN, _THERE = 0.1, 0.9
# Times the end of what is compared up to which an average's corner is looked for, and frequencies.
_FAR_BEYOND, _CORNERS = 8.0, 2049
# Times as low as the model in use has it that a core's resonance is another one's, which nothing
# shows.
_FAR_MOVED = 2.0


def beyond_the_motion(engine, best):
    """Links of the sensor that resonate above all of the motion, where other filters do the same:
    those that make fast motion larger beside a late reference, which may have been smoothed, any
    beside a core that does so, too, and that nobody has stated, and several beside a stated one."""
    p, found = engine.problem, {}
    highest = 2 * np.pi * highest_hz(engine, best)
    seen = 2 * np.pi * min(highest_hz(engine, best, _ALL_MOTION), highest_seen_hz(engine, best))
    core = np.abs(p.axis_model(best.effects).effective_core.poles()) \
        if core_is_identified(engine) else []
    for cause, effect in filters_of(engine, best).items():
        if not is_link(effect) or effect.of_reference or not len(effect.poles()):
            continue
        lowest = np.abs(effect.poles()).min()
        if lowest > highest \
                and abs(effect.transfer_function(np.array([1j * highest]))[0]) > 1 \
                and is_reference_late(p, best.effects):
            found[cause] = "it resonates above the motion, which ends at " \
                           f"{highest / 2 / np.pi:.3g} Hz: to a reference that is late and was " \
                           "smoothed, fast motion looks as much too large"
        elif len(core) and min(lowest, np.min(core)) > _OUT_OF_SIGHT * seen:
            found[cause] = f"it and the core resonate above the motion, which shows up to " \
                           f"{seen / 2 / np.pi:.3g} Hz: there many filters do the same"
    found |= _another_core(engine, best)
    unseen = [cause for cause, effect in best.effects.items() if cause not in engine.search.base
              and _lowest_pole(engine, best, effect) > _OUT_OF_SIGHT * seen]
    if len(unseen) > 1:
        found |= {cause: f"{' and '.join(sorted(unseen))} act above the motion, which shows up to "
                         f"{seen / 2 / np.pi:.3g} Hz: there many filters do the same"
                  for cause in unseen if cause not in found}
    return found


def _another_core(engine, best):
    """Causes that move the stated core far, to where it resonates beyond all that is compared."""
    p, edge = engine.problem, end_of_band_hz(engine.problem)
    stated, core = p.baseline.axis(p.axis).core, p.axis_model(best.effects).effective_core
    if core_is_identified(engine) or not isinstance(core, Oscillator) \
            or not edge < core.natural_frequency_hz < stated.natural_frequency_hz / _FAR_MOVED:
        return {}
    return {cause: f"it would resonate at {core.natural_frequency_hz:.3g} Hz, beyond all that is "
                   f"compared ({edge:.3g} Hz) and far from the model's "
                   f"{stated.natural_frequency_hz:.3g} Hz: many filters do the same"
            for cause, effect in best.effects.items() if effect.restates_core}


def _lowest_pole(engine, best, effect):
    """Size [rad/s] of the lowest pole that an odd effect of the sensor brings, or changes in its
    core; 0 of any other effect."""
    if effect.everyday or effect.of_reference or not (is_link(effect) or effect.restates_core):
        return 0.0
    own = effect if is_link(effect) else engine.problem.axis_model(best.effects).effective_core
    return np.abs(own.poles()).min() if len(own.poles()) else 0.0


def out_of_sight(engine, best):
    """Filters without a peak, of the sensor or of the reference, whose corners lie beyond all that
    is compared, beside a model that nobody has stated: its core may be another one there."""
    edge, found = end_of_band_hz(engine.problem), {}
    if all(entry.is_known for entry in engine.loose.values()):
        return {}
    for cause, effect in filters_of(engine, best).items():
        corner = _corner_hz(effect, edge) if is_link(effect) and not follows_path(effect) else 0.0
        if corner > edge:
            found[cause] = f"its corner, {corner:.3g} Hz, lies beyond what is compared " \
                           f"({edge:.3g} Hz): there many filters, and cores, do the same"
    return found


def unseen_by_reference(engine, best, takes):
    """Causes that take what they do where the reference has next to nothing of the motion: there
    the sensor shows what no model can know."""
    p = engine.problem
    frequency = np.fft.rfftfreq(len(p.used), 1 / p.rate)
    shown = {cause: effect.shows(frequency) for cause, effect in best.effects.items()}
    unseen = np.any([share < _UNSHOWN for share in shown.values()], axis=0)
    if not np.any(unseen):
        return {}
    left, found = power_of(p, best.residual), {}
    for cause in takes:
        if np.any(shown[cause] != 1):
            continue
        gained = power_of(p, engine.best_without(best, cause).residual) - left
        if gained[unseen].sum() > _THERE * abs(gained.sum()):
            found[cause] = "what it explains lies where the reference has next to nothing of the " \
                           "motion"
    return found


def _corner_hz(effect, edge_hz):
    """Lowest corner [Hz] of a link without a peak; of an average of the reference that has no
    poles, where half the power is left; 0 of other links."""
    turns = np.abs(np.r_[effect.poles(), effect.zeros()]) / (2 * np.pi)
    if len(turns):
        return 0.0 if 0 < largest_damping(effect) <= RINGS else float(turns.min())
    if not effect.of_reference:
        return 0.0
    frequency = np.linspace(0, _FAR_BEYOND * edge_hz, _CORNERS)
    size = np.abs(np.log(np.abs(effect.transfer_function(2j * np.pi * frequency)))) > np.log(2) / 2
    return float(frequency[np.argmax(size)]) if size.any() else np.inf
