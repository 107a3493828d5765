"""Resonances: what is left around them, and whether they ring."""

import dataclasses
import math

import numpy as np

from ...errors import FracAccelError
from ...model import is_link
from ...model.parameters import parameter_fields
from .links import (
    CLEAR_PEAK,
    MOSTLY,
    RINGS,
    end_of_band_hz,
    filters_of,
    largest_damping,
    power_of,
)

# Damping ratio below which a link has a peak, and times what is left within half an octave of it
# (RMS) that it must then take.
_PEAKED, _AT_PEAK = 0.1, 10.0
# Times as dense as in the octaves beside its resonance that what is left must be there to be of it.
_DENSER = 10.0
# Share of what is left around a mode's resonance without it from which it explains nothing there.
_NO_LESS = 0.9
# Share of the highest frequency that is compared from which a peak lies at its end.
_EDGE = 0.95
# Of a further resonance, times the frequency at which it raises the end of what is compared as
# much as a filter of the reference.
_FURTHER = (0.95, 1.0, 1.05)


def rings_otherwise(engine, best, takes, noise):
    """Lightly damped links at whose resonance most of what is left lies: no noise, but another way
    of ringing, such as a frequency that falls with the amplitude."""
    found, rest = {}, engine.rms(best.residual)
    for cause, taken in takes.items() if noise.rms is None else ():
        share, denser = _share_at_its_peak(engine, best, best.effects[cause])
        if share is not None and share > MOSTLY and denser > _DENSER \
                and taken < _AT_PEAK * math.sqrt(share) * rest:
            found[cause] = f"{share:.0%} of what is left lies at its resonance ({rest:.3g} RMS " \
                           f"beside {taken:.3g} that it takes): what rings there is not linear"
    return found


def nothing_at_its_peak(engine, best):
    """Modes beside the sensor's own, with an antiresonance, around which as much is left as without
    them: what they take lies elsewhere, where their share alone shows, as that of many filters."""
    p, found = engine.problem, {}
    for cause, effect in filters_of(engine, best).items():
        if not is_link(effect) or not 0 < len(effect.zeros()) == len(effect.poles()) \
                or not 0 < largest_damping(effect) <= RINGS:
            continue
        near = np.abs(_octaves_from_its_resonance(p, effect)) < 0.5
        with_it, without = (float(np.sum(power_of(p, fit.residual)[near]))
                            for fit in (best, engine.best_without(best, cause)))
        if with_it > _NO_LESS * without:
            found[cause] = "around its resonance as much is left as without it: what it takes " \
                           "lies elsewhere, where many filters do the same"
    return found


def stands_out_at_its_peak(engine, best, cause, taken):
    """Whether a lightly damped link takes far more than all that is left around its resonance:
    whatever filter is missing elsewhere, this peak is there."""
    there = _share_at_its_peak(engine, best, best.effects[cause])[0]
    return there is not None and taken > _AT_PEAK * math.sqrt(there) * engine.rms(best.residual)


def _share_at_its_peak(engine, best, effect):
    """Share of what is left (power) within half an octave of a lightly damped link's resonance, and
    how many times as dense it is as in the octaves on either side; None of another effect."""
    if not is_link(effect) or not 0 < largest_damping(effect) <= _PEAKED:
        return None, 0.0
    p = engine.problem
    apart = _octaves_from_its_resonance(p, effect)
    power = power_of(p, best.residual)
    near = np.abs(apart) < 0.5
    beside = [power[(side * apart > 0.5) & (side * apart < 1.5)] for side in (-1, 1)]
    denser = power[near].mean() / max(part.mean() for part in beside) \
        if near.any() and all(map(len, beside)) else 0.0
    return power[near].sum() / max(power.sum(), 1e-300), denser


def _octaves_from_its_resonance(problem, effect):
    """Of each line of a residual's spectrum."""
    frequency = np.fft.rfftfreq(len(problem.used), 1 / problem.rate)
    return np.log2(np.maximum(frequency, 1e-300) * 2 * np.pi / np.abs(effect.poles()).min())


def hardly_rings(engine, best):
    """Modes beside the sensor's own, with an antiresonance, that hardly ring."""
    return {cause: f"it hardly rings (damping ratio {damping:.2g}): a part that swings by itself "
                   "rings longer, and filters do the same"
            for cause, effect in filters_of(engine, best).items()
            if is_link(effect) and np.size(effect.zeros()) == np.size(effect.poles()) > 1
            and (damping := largest_damping(effect)) > RINGS}


def at_the_edge(engine, best):
    """Links that ring at the end of what is compared: what one of the two has lost there, or was
    put on other instants with, looks the same."""
    p, found = engine.problem, {}
    edge = end_of_band_hz(p)
    for cause, effect in filters_of(engine, best).items():
        poles = np.atleast_1d(effect.poles()) if is_link(effect) else np.zeros(0)
        ringing = poles[(poles.imag != 0) & (-poles.real < _PEAKED * np.abs(poles))]
        peaks = np.abs(ringing) / (2 * np.pi)
        if np.any((peaks > _EDGE * edge) & (peaks < edge / _EDGE)):
            found[cause] = f"it rings at {peaks.max():.3g} Hz, at the end of what is compared " \
                           f"({edge:.3g} Hz): what one of the two has lost there looks the same"
    return found


def of_a_further_mode(engine, best):
    """Filters of the reference that raise the response beside one of the sensor that rings, where a
    further resonance like that, beyond all that is compared, does the same."""
    p, found, filters = engine.problem, {}, filters_of(engine, best)
    edge = end_of_band_hz(p)
    ringing = [effect for effect in filters.values() if is_link(effect)
               and np.size(effect.zeros()) < np.size(effect.poles())
               and 0 < largest_damping(effect) < CLEAR_PEAK]
    for cause, effect in filters.items() if ringing else ():
        raised = abs(effect.transfer_function(2j * np.pi * edge)) \
            if is_link(effect) and effect.of_reference else 0.0
        if raised <= 1 or p.limit.ends_judging(
                "no further resonance was tried in the place of the reference's filter"):
            continue
        # where it would raise the response as much at the end of what is compared
        beyond_hz = edge / np.sqrt(1 - 1 / raised)
        rest = {name: other for name, other in best.effects.items() if name != cause}
        try:
            costs = [p.fit({**rest, "further": _at_frequency(ringing[0], share * beyond_hz)}).cost
                     for share in _FURTHER]
        except FracAccelError:
            continue
        # the least of a parabola through them, as far as they have one between them
        bend, slope = (costs[2] - 2 * costs[1] + costs[0]) / 2, (costs[2] - costs[0]) / 2
        least = costs[1] - slope**2 / (4 * bend) if abs(slope) < 2 * bend else min(costs)
        if least - best.cost < engine.threshold(best):
            found[cause] = (f"a further resonance near {beyond_hz:.3g} Hz, beyond what is "
                            "compared, does the same")
    return found


def _at_frequency(link, frequency_hz):
    """A ringing link with its resonance elsewhere."""
    return dataclasses.replace(link, **{
        field.name: float(frequency_hz) for field in parameter_fields(type(link))
        if field.metadata["unit"] == "Hz"})
