"""What changes slowly along a record, along a course that follows no law."""

import numpy as np

from ..budget.blocks import Blocks
from ..budget.modulated import Modulated
from ..model.effects import known_effects
from ..model.effects.course import KNOTS
from .finding import Finding
from .gain import certainty, gain
from .words import gain_words

# Share of what is left without a course that it must take of data that it has not seen, and by how
# much more (power) others, such as a course of the timing, must leave.
_TAKES, _CLEARLY = 0.5, 2.0
# Share by which more half waves must be better.
_BETTER = 0.02
# Share of the residual's power that a description with a course may leave; and where that had other
# causes that change with time, which a course stands for.
_LESS, _AS_GOOD = 0.6, 1.05
# Share of what a cause adds (power) that a course must describe for it to be one.
_SLOW = 0.8
# Square of a course's correlation with the motion's own from which it may be that.
_ALIKE = 0.6
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
    found, own_power = [], p.cost(best.effects)
    for cause, cls in known_effects().items():
        if not cls.half_waves or cause in engine.search.base:
            continue
        kept = _without_the_like(engine, best, cls)
        target = (p.measured - p.simulate(kept)) * p.used
        before = p.simulate({c: e for c, e in kept.items() if e.stage < cls.stage})
        own = cls.column(before)
        left, waves, power = _left(p, own, target, cls.half_waves)
        others = [_left(p, column, target, cls.half_waves)[0] for column in
                  (np.ones(len(own)), before, np.gradient(before))
                  if not np.array_equal(column, own)]
        if left > 1 - _TAKES or min(others) < _CLEARLY * left \
                or (len(kept) < len(best.effects) and power > _AS_GOOD * own_power):
            continue
        time = np.linspace(0.0, p.time[-1], KNOTS)
        values = _curve(p, own, target, waves, time)
        if not _follows(values, _measures(before, p.used)):
            found.append((left, cause, cls.in_course(p.record.since_start_s + time, values)))
    return {cause: effect for _, cause, effect in sorted(found, key=lambda each: each[:2])[:1]}


def _without_the_like(engine, best, cls):
    """Effects of a fit without those that a course stands for, too: of its stage, and with an
    offset's, which adds what is slow, those that do so otherwise."""
    slow = not np.ptp(cls.column(np.arange(2.0)))
    return {cause: effect for cause, effect in best.effects.items()
            if cause in engine.search.base or not effect.shows_with_time | effect.acts_on_slow_motion
            or not (effect.stage == cls.stage
                    or slow and (effect.acts_on_slow_motion or _is_slow(engine, best, cause, cls)))}


def _is_slow(engine, best, cause, cls):
    """Whether what an effect adds is a course that this cause may have."""
    p = engine.problem
    added = (p.simulate(best.effects) - p.simulate(
        {c: e for c, e in best.effects.items() if c != cause}))[p.used]
    place = p.time[p.used] / p.time[-1]
    added = added - added.mean()
    basis, _ = np.linalg.qr(_cosines(place, cls.half_waves[-1]))
    taken = basis.T @ added
    return taken @ taken > _SLOW * (added @ added)


def _left(p, column, target, half_waves):
    """Share of a target's power that a course leaves, of what a constant does, in blocks that it
    has not seen; its half waves, and that power."""
    blocks = Blocks(np.unique(np.linspace(0, len(target), 41).astype(int)))
    courses = Modulated(lambda start, stop: column[start:stop, None], target, p.used, blocks)

    def power(waves):
        error = (target - courses.predict(range(waves + 1))) * p.used
        return float(error @ error)
    constant = power(0)
    least, chosen = constant, 0
    for waves in half_waves:
        here = power(waves)
        if here < (1 - _BETTER) * least:
            least, chosen = here, waves
    return least / max(constant, 1e-300), chosen, least


def _cosines(place, waves):
    """Columns of a course, shape (n, waves + 1), at places from 0 to 1 along the record."""
    return np.cos(np.pi * np.outer(place, np.arange(waves + 1)))


def _curve(p, column, target, waves, time):
    """The course that describes a target best, at certain times [s] since its start."""
    rows, length = p.used, p.time[-1]
    weights = np.linalg.lstsq(_cosines(p.time[rows] / length, waves) * column[rows, None],
                              target[rows], rcond=None)[0]
    return _cosines(time / length, waves) @ weights


def _measures(motion, used):
    """What of the motion is slow, too: itself, how it changes and adds up, its level and power;
    each of shape (KNOTS,)."""
    edges = np.linspace(0, len(motion), KNOTS + 1).astype(int)[:-1]
    count = np.maximum(np.add.reduceat(used.astype(float), edges), 1.0)

    def mean(values):
        return np.add.reduceat(values * used, edges) / count
    slow = mean(motion)
    power = mean((motion - motion[used].mean())**2)
    return [slow, np.gradient(slow), np.cumsum(slow - slow.mean()), np.sqrt(power), power]


def _follows(course, measures):
    """Whether a course may be the motion's own: what is lost of slow motion, or comes with its
    level."""
    course = course - course.mean()
    moving = [each - each.mean() for each in measures if np.ptp(each)]
    return any((course @ each)**2 > _ALIKE * (course @ course) * (each @ each) for each in moving)


def is_worth_it(before, after):
    """Whether a fit beside a course leaves far less, or as much without what a course stands for."""
    fewer = any(effect.shows_with_time and not effect.everyday and cause not in after.effects
                for cause, effect in before.effects.items())
    return after.cost < (_AS_GOOD if fewer else _LESS) * before.cost


def findings(engine, fitted, stds):
    """Findings of the courses that a fit has, and those in doubt, in words by cause."""
    p, named, doubtful = engine.problem, [], {}
    shares = {part: share for share, part in engine.structure(fitted)}
    rows = engine.held_out_rows
    for cause, effect in engine.search.courses.items():
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
                "in blocks that it was not fitted to", *gain_words(cause, g, np.inf, [])], g))
    return named, doubtful
