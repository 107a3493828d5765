"""Why a fitted cause is not named: the rules that look at the record beside the fit."""

import math

import numpy as np

from ...model.effects.base import OFFSET
from ..courses import with_level
from ..engine import WEIGHS
from ..gradual import gradual
from ..in_bands import otherwise_in_bands
from ..names import cancelling, undetermined
from ..words import AS_NOISE
from .delays import acausal, may_be_the_sensor, undoes_the_core
from .forces import beside_a_strong_force, by_sign, other_laws, parts_of_a_law, within_steps
from .imitations import (
    another_alone,
    corrections,
    hardly_more,
    imitators,
    of_the_model,
    on_both_sides,
    one_filter,
)
from .of_motion import at_standstill, of_motion, other_axes
from .out_of_sight import beyond_the_motion, out_of_sight, unseen_by_reference
from .peaks import (
    at_the_edge,
    hardly_rings,
    nothing_at_its_peak,
    of_a_further_mode,
    rings_otherwise,
)
from .slow import as_slow, elsewhen, of_level, of_unchanged_level

# Share of the output (RMS) above which what is left says that little of the sensor is understood.
_MOST_OF = 0.5
# Scatter of what a constant adds, over it: a dead zone, or samples that do not count, make some.
_CONSTANT = 0.1
# Share of what a cause takes (RMS) that it must change the output by: else its free motion does
# that.
_BY_ITSELF = 0.5
# Share of what is left (RMS) below which an odd cause is too small where nothing shows that this is
# noise: pairing, resampling and the reference's own errors come to as much.
_LITTLE = 0.25


def doubts_about(engine, best, gains, stds, left, noise):
    """Why fitted causes are not named, in words by cause: of several reasons the first."""
    takes = {cause: g.taken for cause, g in gains.items()}
    added = {cause: engine.added(best, cause) for cause in gains}
    doubts = {}
    for found in (
            left_open(engine, best, stds, gains), engine.as_the_sensor,
            dict.fromkeys(engine.uncontested, "the time limit left no time for its rivals"),
            _too_little(engine, best, takes, added, noise), _not_apart(engine, best, takes, left),
            dict.fromkeys(gains, words) if (words := most_is_left(engine, left, noise)) else {},
            gradual(engine, best, gains), otherwise_in_bands(engine, best, added),
            with_level(engine, best, added), of_level(engine, best, added),
            of_unchanged_level(engine, best),
            as_slow(engine, best, added, takes), of_the_model(engine, best),
            acausal(engine, best, stds), by_what_is_left(engine, best, takes, left),
            _cancelled(engine, best, added), corrections(engine, best, takes),
            by_sign(engine, best, added), nothing_at_its_peak(engine, best),
            rings_otherwise(engine, best, takes, noise), may_be_the_sensor(engine, best),
            undoes_the_core(engine, best), out_of_sight(engine, best),
            unseen_by_reference(engine, best, takes), hardly_rings(engine, best),
            at_the_edge(engine, best), of_a_further_mode(engine, best),
            of_motion(engine, best, added), beyond_the_motion(engine, best),
            hardly_more(engine, best, left), within_steps(engine, best, takes, added),
            beside_a_strong_force(engine, best, takes, left, noise),
            parts_of_a_law(best, takes, added, left),
            engine.unstable(best) if gains and (
                left.share > 0 or not engine.is_accounted(best, noise)) else {}):
        doubts = {**found, **doubts}
    return {cause: words for cause, words in doubts.items() if cause in gains}


def _too_little(engine, best, takes, added, noise):
    """Causes that take too little: of the output itself, beside what is left, or beside what the
    reference's own noise makes."""
    found = {}
    own, rest = engine.by_reference(best), engine.rms_beside_rounding(best)
    for cause, taken in takes.items():
        effect, rms = best.effects[cause], min(taken, engine.rms(added[cause]))
        # where it was judged: what comes and goes may do less elsewhere
        there = float(np.sqrt(np.mean(added[cause][engine.held_out_rows]**2)))
        # of the whole record: what was learnt may go astray where it is held out
        gained = min(taken, engine.takes(best, cause, beside_a_constant=True))
        # what is added behind all dynamics sets nothing in motion
        if max(rms, there) < _BY_ITSELF * gained and effect.stage < OFFSET:
            found[cause] = (f"it changes the output by {there:.3g} RMS only: the rest of what it "
                            f"explains ({gained:.3g} RMS) is a free motion of its own")
        elif rms < _LITTLE * rest and noise.rms is None and not effect.everyday:
            found[cause] = (f"it takes {rms:.3g} RMS only beside {rest:.3g} that are left, which "
                            "nothing shows to be noise")
        # noise makes nothing that changes with time, or that goes with other axes
        elif rms < AS_NOISE * own and not effect.shows_with_time and not effect.mixes_axes:
            found[cause] = (f"what it explains ({rms:.3g} RMS) is no more than what the "
                            f"reference's own noise makes ({own:.3g} RMS)")
    return found


def _not_apart(engine, best, takes, left):
    """Causes that do not stand out of what is left and is neither noise nor of their own kind."""
    if min(takes.values(), default=np.inf) >= WEIGHS * left.rms:
        return {}
    unexplained, found = engine.unexplained(best), {}
    for cause, rms in takes.items():
        like = best.effects[cause].kindred(best.residual, engine.problem.time)
        strange = math.sqrt(max(unexplained**2 - like**2, 0.0))
        if rms < WEIGHS * strange and not engine.stands_among_slow(best, cause, rms) \
                and not engine.stands_in_its_kind(best, cause, rms):
            found[cause] = (f"what it explains ({rms:.3g} RMS) does not stand out of what is left "
                            f"unexplained ({strange:.3g} RMS)")
    return found


def _cancelled(engine, best, added):
    """Causes of pairs that nearly cancel."""
    used, found = engine.problem.used, {}
    for pair in cancelling(added):
        # what begins or settles does so from a constant, which may be that of its start or its end,
        # and of a turned axis gravity comes with the motion across
        of_used = [added[cause][used] for cause in pair]
        if any(best.effects[cause].counts_from_start or best.effects[cause].mixes_axes
               for cause in pair) \
                and any(np.std(values) < _CONSTANT * abs(np.mean(values)) for values in of_used):
            continue
        for cause, other in (pair, pair[::-1]):
            found.setdefault(cause, f"it nearly cancels {other}: together they may stand for "
                                    "one cause that is not known")
    return found


def most_is_left(engine, left, noise):
    """Why nothing has a name that a fit alone shows, where most of the output is left; or ""."""
    share = left.rms / np.std(engine.problem.measured[engine.problem.used])
    if noise.rms is not None or share < _MOST_OF:
        return ""
    return f"{share:.0%} of the output is left, and nothing shows that it is noise"


def by_what_is_left(engine, fitted, takes, left):
    """Causes beside which what is left is still of their kind, in words by cause.

    Parameters
    ----------
    engine : Engine
    fitted : Fitted
    takes : dict of str to float
        RMS that each cause takes [output units].
    left : Leftover
    """
    return {**other_laws(engine, fitted, takes, left), **elsewhen(engine, fitted, takes, left),
            **imitators(engine, fitted, takes, left), **at_standstill(engine, fitted, takes),
            **on_both_sides(engine, fitted, takes),
            **one_filter(engine, fitted), **another_alone(engine, fitted),
            **other_axes(engine, fitted, takes, left)}


def left_open(engine, fitted, stds, causes):
    """Why the record leaves causes open, in words by cause."""
    p = engine.problem
    core, found = p.baseline.axis(p.axis).core, {}
    for cause in causes:
        places = [(u, place) for u, place in zip(fitted.unknowns, fitted.theta) if u.cause == cause]
        if not places:
            continue  # read off the record
        words = undetermined(fitted.effects[cause], *zip(*places), stds[cause], core, p.time[-1])
        if words:
            found[cause] = words
    return found
