"""What changes slowly along a record, along a course that follows no law."""

import dataclasses

import numpy as np

from ..budget.blocks import Blocks
from ..budget.modulated import Modulated
from ..model.effects import known_effects
from ..model.effects.course import KNOTS
from .finding import Finding
from .gain import certainty, gain

# Half waves over the record that a course may have; with four periods it is a modulation.
_HALF_WAVES = (1, 2, 3, 5, 7)
# Share of what is left without a course that it must take of data that it has not seen, and by how
# much more (power) others, such as a course of the timing, must leave.
_TAKES, _CLEARLY = 0.5, 2.0
# Share by which more half waves must be better.
_BETTER = 0.02
# Share of the residual's power that a description with a course may leave.
_LESS = 0.6
# Share of what is left that may still change with time, in the part of the budget that is its own.
_SAME_KIND = 0.3


def course_of(engine, best):
    """The cause, as {cause: effect}, whose course in time explains most of what a fit leaves.

    It is judged in blocks of the record that it has not seen, beside the other courses that could
    be meant: an offset, a gain, a delay. Empty where none takes much, or two take as much.

    Parameters
    ----------
    engine : Engine
    best : Fitted
        Of the engine, or of its part.
    """
    p = engine.problem
    if len(p.time) != len(p.record) or len(p.time) < 8 * KNOTS:
        return {}
    found = []
    for cause, cls in known_effects().items():
        if cls.column(np.zeros(1)) is None or cause in engine.search.base:
            continue
        kept = _without_the_like(engine, best.effects, cls)
        target = (p.measured - p.simulate(kept)) * p.used
        before = p.simulate({c: e for c, e in kept.items() if e.stage < cls.stage})
        own = cls.column(before)
        left, waves = _left(p, own, target)
        others = [_left(p, column, target)[0] for column in
                  (np.ones(len(own)), before - before[p.used].mean(), np.gradient(before))
                  if abs(np.corrcoef(column, own)[0, 1]) < 0.9 or not np.ptp(own) > 0]
        if not np.ptp(own) > 0:
            others = others[1:]
        if left < 1 - _TAKES and min(others) > _CLEARLY * left:
            found.append((left, cause, _effect(p, cls, own, target, waves)))
    return {cause: effect for _, cause, effect in sorted(found)[:1]}


def _without_the_like(engine, effects, cls):
    """Effects without those that a course stands for, too."""
    return {cause: effect for cause, effect in effects.items()
            if cause in engine.search.base or effect.stage != cls.stage
            or not effect.shows_with_time}


def _left(p, column, target):
    """Share of a target's power that a course leaves, of what a constant does, in blocks that it
    has not seen; and its half waves."""
    blocks = Blocks(np.unique(np.linspace(0, len(target), 41).astype(int)))
    courses = Modulated(lambda start, stop: column[start:stop, None], target, p.used, blocks)

    def power(waves):
        error = (target - courses.predict(range(waves + 1))) * p.used
        return float(error @ error)
    constant = power(0)
    least, chosen = constant, 0
    for waves in _HALF_WAVES:
        here = power(waves)
        if here < (1 - _BETTER) * least:
            least, chosen = here, waves
    return least / max(constant, 1e-300), chosen


def _effect(p, cls, column, target, waves):
    start, length = p.record.since_start_s, p.time[-1]

    def cosines(time):
        return np.cos(np.pi * np.outer(time / length, np.arange(waves + 1)))
    rows = p.used
    weights = np.linalg.lstsq(cosines(p.time[rows]) * column[rows, None], target[rows],
                              rcond=None)[0]
    knots = np.linspace(0.0, length, KNOTS)
    return cls.in_course(start + knots, cosines(knots) @ weights)


def is_worth_it(before, after):
    """Whether a fit beside a course leaves far less."""
    return after.cost < _LESS * before.cost


def findings(engine, fitted, stds):
    """Findings of the courses that a fit has, and those in doubt, in words by cause."""
    p, named, doubtful = engine.problem, [], {}
    shares = {part: share for share, part in engine.structure(fitted)}
    rows = engine.held_out_rows
    for cause, effect in engine.courses.items():
        effect = fitted.effects.get(cause, effect)
        without = p.simulate({c: e for c, e in fitted.effects.items() if c != cause})
        error = (p.measured - fitted.output)[rows]
        g = gain(error + (fitted.simulated - without)[rows], error)
        part = "slow" if np.ptp(effect.column(p.measured)) == 0 else "time_varying"
        if shares.get(part, 0.0) > _SAME_KIND:
            doubtful[cause] = f"{shares[part]:.0%} of what is left changes with time: the course " \
                              "in time is another one"
        elif g.is_relevant:
            values = np.array(effect.course) + effect.rate_per_s * np.array(effect.course_at_s)
            named.append(Finding(effect, stds.get(cause, {}), certainty(g), [], [
                f"a course from {values.min():.3g} to {values.max():.3g} along the record, judged "
                "in blocks that it was not fitted to", *_words(cause, g)], g))
    return named, doubtful


def _words(cause, g):
    from .words import gain_words
    return gain_words(cause, g, np.inf, [])
