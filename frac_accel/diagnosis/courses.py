"""What changes slowly along a record, along a course that follows no law."""

import numpy as np
from scipy.signal import lfilter

from ..budget.blocks import Blocks
from ..budget.modulated import Modulated, cosines
from ..errors import FracAccelError
from ..model.effects import known_effects
from ..model.effects.base import OFFSET
from ..model.effects.course import KNOTS
from .empirical import EmpiricalFit
from .finding import Finding
from .gain import certainty, gain
from .words import gain_words

# Samples of a record for which it is worth a look before all else.
_SHORT = 80_000
# Share of what is left without a course that it must take of data that it has not seen, and by how
# much more (power) others, such as a course of the timing, must leave.
_TAKES, _CLEARLY = 0.5, 2.0
# The same of a motion about a level so many times its size: of courses of its gain and its zero the
# wrong one leaves hardly more, which is no other cause's, since either takes all of the other's.
_LEVEL, _CLEARLY_OF_LEVEL = 3.0, 1.2
# Share by which more half waves must be better.
_BETTER = 0.02
# Share of the residual's power that a description with a course may leave; and where that had other
# causes that change with time, which a course stands for.
_LESS, _AS_GOOD = 0.6, 1.05
# Share of what a cause adds (power) that a course must describe for it to be one.
_SLOW = 0.8
# Square of a course's correlation with the motion's own, or with what its level brings, from which
# it may be that.
_ALIKE = 0.9
# Share of a level's mean that its scatter must be to bring anything.
_VARIES = 0.1
# Share of what the record knows of a course, everywhere, with which it is held at none.
_HELD = 1e-4
# Shares of a heat, a charge or a level that stay from one instant of a course to the next.
_KEEPS = (0.0, 0.5, 0.75, 0.9, 0.95)
# Instants of a course at whose mean level that began; one alone would make a course by chance.
_BEFORE = 4
# Shares of a record in which a level fades that a gain or a zero follows at each sample.
_FADES = (0.003, 0.01, 0.03, 0.1)
# Share of a level's mean below which its logarithm is not followed.
_LEVEL_FLOOR = 1e-3
# Share of what is left that may still change with time, in the part of the budget that is its own.
_SAME_KIND = 0.3


def begun_with(engine):
    """As `course_of`, beside the common causes alone, where no other cause promises half as much,
    and no law in time does: what is so large would hide all else, and make the search for it long.
    """
    p = engine.problem
    if len(p.time) > _SHORT or p.limit.ends_search():
        return {}
    bare = engine.everyday()
    found = course_of(engine, bare)
    if not found:
        return {}
    promised = min((cost for cost, *_ in engine.search.screen(bare)), default=np.inf)
    (cause, effect), = found.items()
    kept = _without_the_like(engine, bare, type(effect))
    enough = _CLEARLY * p.cost({**kept, cause: effect})
    return found if enough < min(promised, _least_of_a_law(engine, effect)) else {}


def _least_of_a_law(engine, effect):
    """Least cost of a law in time of a course's kind beside all common causes, and of two such
    laws, of which the other may be of any kind."""
    search = engine.search
    fit = _with_a_law(engine, search.everyday(search.baseline), effect)
    if fit is None:
        return np.inf
    both = search.fit_all([search.begun(fit, cause, begin) for _, cause, begin in search.screen(fit)
                           if known_effects()[cause].shows_with_time])
    return min(each.cost for each in (fit, *both))


def is_a_law(engine, best, courses):
    """Whether a law in time in the place of a course, beside all else that a set has, leaves less.
    """
    (cause, effect), = courses.items()
    fit = _with_a_law(engine, {c: e for c, e in best.effects.items() if c != cause}, effect)
    return fit is not None and fit.cost < best.cost


def _with_a_law(engine, effects, effect):
    """The best fit with a law in time of a course's kind, beside some effects; or None."""
    search = engine.search
    common = search.fit({**search.base, **effects})
    of_kind = set(search.candidates) - set(beside({effect.cause: effect}, search.candidates))
    fits = search.fit_all([search.begun(common, cause, begin) for _, cause, begin in
                           search.screen(common) if cause in of_kind])
    return min(fits, key=lambda fit: fit.cost, default=None)


def course_of(engine, best):
    """The cause, as {cause: effect}, whose course in time explains most of what a fit leaves.

    It is judged in blocks of the record that it has not seen, beside the other courses that could
    be meant: an offset, a gain, a delay. Empty where none takes much, two take as much, it may be
    the motion's own, or a law that the fit has describes it.

    Parameters
    ----------
    engine : Engine
    best : Fitted
        Of the engine, or of its part.
    """
    p = engine.problem
    if engine.search.courses or len(p.time) != len(p.record) or len(p.time) < 8 * KNOTS:
        return {}
    found, own_power = [], p.cost(best.effects)
    for cause, cls in known_effects().items():
        if not cls.half_waves or cause in engine.search.base:
            continue
        try:
            kept = _without_the_like(engine, best, cls)
            target, before = _to_be_described(p, kept, cls)
        except FracAccelError:
            continue  # without the like of it, the motion has no bound
        own = _beside_a_gain(cls.column(before), before, target, cls.half_waves, p)
        left, waves, power = _left(cls.column(before), own, cls.half_waves, p.used)
        if left > 1 - _TAKES or power > _allowed(best.effects, kept) * own_power:
            continue
        columns = np.ones(len(before)), before, np.gradient(before)
        others = [_left(column, _beside_a_gain(column, before, target, cls.half_waves, p),
                        cls.half_waves, p.used)[2] for column in columns
                  if not np.array_equal(column, cls.column(before))]
        if min(others) < (_CLEARLY_OF_LEVEL if _is_level(before[p.used]) else _CLEARLY) * power:
            continue
        effect = _through(p, cls, before, own, waves, p.used)
        values, weight = _values(effect), _mean(cls.column(before)**2, p.used)
        if _as_level(values, weight, before, p.used, waves) < _ALIKE \
                and not (_adds(cls) and _as_motion(values, weight, before, p.used)) \
                and _left_by_level(cls.column(before), own, before, p.used) > power:
            found.append((left, cause, effect))
    return {cause: effect for _, cause, effect in sorted(found, key=lambda each: each[:2])[:1]}


def beside(courses, candidates):
    """Of some causes those that are looked for beside courses: a law of the same kind would only
    mend what a course lacks."""
    stages = {effect.stage for effect in courses.values()}
    return [cause for cause in candidates for effect in [known_effects()[cause]]
            if effect.stage not in stages or not effect.shows_with_time or effect.everyday]


def _allowed(before, after):
    """Share of the residual's power that a course may leave, as `_LESS` and `_AS_GOOD`: one law
    is more than a course, several together follow any."""
    laws = [cause for cause, effect in before.items() if cause not in after
            and effect.shows_with_time and not effect.everyday]
    return _AS_GOOD if len(laws) > 1 else _LESS


def _adds(cls):
    """Whether a course is added to the output, whatever that is."""
    return not np.ptp(cls.column(np.arange(2.0)))


def _without_the_like(engine, best, cls):
    """Effects of a fit without those that a course stands for, too: of its stage, and with an
    offset's, which adds what is slow, those that do so otherwise."""
    slow = _adds(cls)

    def is_alike(cause, effect):
        if effect.stage == cls.stage:
            return effect.shows_with_time
        return slow and (effect.acts_on_slow_motion
                         or effect.shows_with_time and _is_slow(engine, best, cause, cls))
    return {cause: effect for cause, effect in best.effects.items()
            if cause in engine.search.base or not is_alike(cause, effect)}


def _is_slow(engine, best, cause, cls):
    """Whether what an effect adds is a course that this cause may have."""
    p = engine.problem
    added = (p.simulate(best.effects) - p.simulate(
        {c: e for c, e in best.effects.items() if c != cause}))[p.used]
    place = p.time[p.used] / p.time[-1]
    added = added - added.mean()
    basis, _ = np.linalg.qr(_columns(place, range(cls.half_waves[-1] + 1)))
    taken = basis.T @ added
    return taken @ taken > _SLOW * (added @ added)


def fit_empirical_zero(p, output, rest):
    """Course of the zero that describes what an output leaves (`EmpiricalFit`; its `order` is the
    number of half waves), learnt on all but the rows that are held out."""
    cls, = (cls for cls in known_effects().values() if cls.half_waves and _adds(cls))
    learn, target = p.used & ~rest, p.measured - output
    _, waves, _ = _left(np.ones(len(output)), target, cls.half_waves, learn)
    effect = _through(p, cls, output, target, waves, learn)
    course = np.interp(p.record.since_start_s + p.time, effect.course_at_s, _values(effect))
    return EmpiricalFit(effect, waves, None, gain(target[rest], (target - course)[rest]))


def _left(column, target, half_waves, used):
    """Share of a target's power that a course leaves, of what a constant does, in blocks that it
    has not seen; its half waves, and that power."""
    blocks = Blocks(np.unique(np.linspace(0, len(target), 41).astype(int)))
    courses = Modulated(lambda start, stop: column[start:stop, None], target, used, blocks)

    def power(waves):
        error = (target - courses.predict(range(waves + 1), _columns)) * used
        return float(error @ error)
    constant = power(0)
    least, chosen = constant, 0
    for waves in half_waves:
        here = power(waves)
        if here < (1 - _BETTER) * least:
            least, chosen = here, waves
    return least / max(constant, 1e-300), chosen, least


def _is_level(values):
    return abs(np.mean(values)) > _LEVEL * np.std(values)


def _beside_a_gain(column, before, target, half_waves, p):
    """A target without what another gain of the motion about its level takes beside a course: that
    gain was found without the course, and of a level a course of the gain makes as much as one of
    the zero."""
    used = p.used
    moving = before - before[used].mean()
    every = np.c_[_columns(p.time / p.time[-1], range(half_waves[-1] + 1)) * column[:, None],
                  moving][used]
    size = np.maximum(np.linalg.norm(every, axis=0), 1e-300)
    found = np.linalg.lstsq(every / size, target[used], rcond=1e-9)[0] / size
    return (target - found[-1] * moving) * used


def _columns(place, orders):
    """Columns of a course, shape (n, m), at places from 0 to 1 along the record: cosines of some
    orders, and what has a slope at its ends, too, which these have not."""
    columns = cosines(place, orders)
    return columns if len(orders) == 1 else np.c_[columns, place, place**2]


def refined(engine, effects):
    """The courses of an engine, found once more beside its fit of some effects."""
    p, result = engine.problem, {}
    fit = engine.search.fit({**effects, **engine.search.base})
    for cause, effect in engine.search.courses.items():
        cls = type(effect)
        kept = {name: other for name, other in fit.effects.items() if name != cause}
        target, before = _to_be_described(p, kept, cls)
        _, waves, _ = _left(cls.column(before), target, cls.half_waves, p.used)
        result[cause] = _through(p, cls, before, target, waves, p.used)
    return result


def about_zero(courses):
    """Courses of which such as are added lack a mean that is larger than all that they change by:
    that is a constant, which has its own name."""
    def moved(effect):
        values = _values(effect)
        mean = values.mean() if _adds(type(effect)) else 0.0
        return effect if abs(mean) <= np.ptp(values) \
            else effect.in_course(np.array(effect.course_at_s), values - mean)
    return {cause: moved(effect) for cause, effect in courses.items()}


def _to_be_described(p, kept, cls):
    """What a simulation with some effects leaves to a course, and its output where that acts."""
    return ((p.measured - p.simulate(kept)) * p.used,
            p.simulate({c: e for c, e in kept.items() if e.stage < cls.stage}))


def _through(p, cls, before, target, waves, rows):
    """Effect with the course of so many half waves that describes a target best."""
    orders, length = range(waves + 1), p.time[-1]
    columns = _columns(p.time[rows] / length, orders) * cls.column(before)[rows, None]
    place = np.linspace(0.0, 1.0, KNOTS)
    at_knots = _columns(place, orders)
    # without motion nothing says what the gain is: it stays near what it is
    little = np.sqrt(_HELD * np.mean(np.square(cls.column(before)[rows])) * rows.sum() / KNOTS)
    weights = np.linalg.lstsq(np.r_[columns, little * at_knots],
                              np.r_[target[rows], np.zeros(KNOTS)], rcond=None)[0]
    return cls.in_course(p.record.since_start_s + length * place, at_knots @ weights)


def _values(effect):
    """Values of a course at its instants."""
    return np.array(effect.course) + effect.rate_per_s * np.array(effect.course_at_s)


def _as_motion(course, weight, motion, used):
    """Whether a course that is added may be what is lost of slow motion: itself, how it changes and
    adds up."""
    slow = _mean(motion, used)
    return any(_alike(course, weight, each) > _ALIKE
               for each in (slow, np.gradient(slow), np.cumsum(slow - slow.mean())))


def _as_level(course, weight, motion, used, waves=None):
    """Square of a course's largest correlation with what the motion's level may bring.

    That is the mean, the logarithm or the square root of its size or power, or of its slope's, at
    once or as it warms and charges something: what vibration is rectified to, a gain that falls
    with it, a sensor that it heats. A course of few half waves can only follow what they show
    of it.
    """
    def shown(values):
        if waves is None:
            return values
        columns, root = _columns(np.linspace(0, 1, KNOTS), range(waves + 1)), np.sqrt(weight)
        return columns @ np.linalg.lstsq(columns * root[:, None], values * root, rcond=None)[0]
    found = 0.0
    for size in _sizes(motion, used):
        level = _mean(size, used)
        for keeps in _KEEPS:
            after = _fading(level, keeps, _BEFORE)
            if np.std(after) > _VARIES * np.mean(after):
                found = max(found, *(_alike(course, weight, shown(each)) for each in _laws(after)))
    return found


def _left_by_level(column, target, motion, used):
    """Power of a target that a column leaves whose share follows the motion's level at each sample
    (`_as_level`): an automatic gain is faster than a course can be."""
    taken, target, column = 0.0, target[used], column[used]
    for size in _sizes(motion, used):
        for share in _FADES:
            fades = max(share * len(size), 1.0)
            for level in _laws(_fading(size, np.exp(-1 / fades), int(fades))):
                basis, _ = np.linalg.qr(np.c_[column, column * level[used]])
                taken = max(taken, float(np.sum((basis.T @ target)**2)))
    return float(target @ target) - taken


def _sizes(motion, used):
    """Size and power of a motion, and of its slope, at each sample."""
    swing = motion - motion[used].mean()
    return [size**power for size in (abs(swing), abs(np.gradient(swing))) for power in (1, 2)]


def _fading(level, keeps, before):
    """A level of which a share stays from one value to the next; it began as the mean of the first.
    """
    return lfilter([1 - keeps], [1, -keeps], level, zi=[keeps * level[:before].mean()])[0]


def _laws(level):
    """What a level may bring: itself, its root, its logarithm."""
    return level, np.sqrt(level), np.log(level + _LEVEL_FLOOR * level.mean())


def _mean(values, used):
    """Means of samples that count around a course's instants, shape (KNOTS,)."""
    edges = np.linspace(0, len(values), KNOTS + 1).astype(int)[:-1]
    count = np.maximum(np.add.reduceat(used.astype(float), edges), 1.0)
    return np.add.reduceat(values * used, edges) / count


def _alike(course, weight, measure):
    """Square of the correlation of a course with a measure; it counts by the weight that it is
    known with."""
    def moving(values):
        return np.sqrt(weight) * (values - np.average(values, weights=weight))
    course, measure = moving(course), moving(measure)
    size = (course @ course) * (measure @ measure)
    return (course @ measure)**2 / size if size > 0 else 0.0


def with_level(engine, best, added):
    """Causes that change with time, or once, as the motion's level does, in words by cause: what
    follows the motion and what follows time are the same there, unless a law in time describes
    the record clearly better."""
    p, found = engine.problem, {}
    for cause, change in added.items():
        effect = best.effects[cause]
        if not effect.shows_with_time or effect.everyday or effect.needs_temperature:
            continue
        before = best.simulated - change
        column = np.ones(len(change)) if effect.stage == OFFSET \
            else before - before[p.used].mean()
        weight = _mean(column**2, p.used)
        course = _mean(change * column, p.used) / np.maximum(weight, 1e-300)
        told = np.interp(np.arange(len(change)), np.linspace(0, len(change), KNOTS), course)
        if np.sum((change - told * column)[p.used]**2) > (1 - _SLOW) * np.sum(change[p.used]**2):
            continue
        alike = _as_level(course, weight, before, p.used)
        if alike <= _ALIKE:
            continue
        whole = course + _mean(best.residual * column, p.used) / np.maximum(weight, 1e-300)
        if cause in engine.search.courses or 1 - _as_level(whole, weight, before, p.used) \
                < _CLEARLY * (1 - _alike(whole, weight, course)):
            found[cause] = f"the motion's level changes in the same way (correlation " \
                           f"{np.sqrt(alike):.2f}): it may follow the motion, not time"
    return found


def is_worth_it(before, after, courses):
    """Whether a fit beside courses leaves far less, or as much without several laws in time."""
    laws = after.effects.keys() - courses.keys()
    return after.cost < _allowed(before.effects, laws) * before.cost


def of_another_kind(findings, structure):
    """Causes of findings of courses beside which much of what is left, by its structure, still
    changes in their way, with words."""
    shares = {part: share for share, part in structure}
    return {f.cause: _another_words(f.effect, shares) for f in findings
            if _is_another(f.effect, shares)}


def _is_another(effect, shares):
    return shares.get(_own_part(effect), 0.0) > _SAME_KIND


def _own_part(effect):
    """Part of a budget in which a course of another form would be left."""
    return "slow" if _adds(type(effect)) else "time_varying"


def _another_words(effect, shares):
    return f"{shares[_own_part(effect)]:.0%} of what is left changes with time: the course " \
           "in time is another one"


def findings(engine, fitted, stds):
    """Findings of the courses that a fit has, and those in doubt, in words by cause."""
    p, named, doubtful = engine.problem, [], {}
    shares = {part: share for share, part in engine.structure(fitted)}
    rows = engine.held_out_rows
    for cause in engine.search.courses:
        effect = fitted.effects[cause]
        without = p.simulate({c: e for c, e in fitted.effects.items() if c != cause})
        error = (p.measured - fitted.output)[rows]
        g = gain(error + (fitted.simulated - without)[rows], error)
        if _is_another(effect, shares):
            doubtful[cause] = _another_words(effect, shares)
        elif g.is_relevant:
            values = _values(effect)
            named.append(Finding(effect, stds.get(cause, {}), certainty(g), [], [
                f"a course from {values.min():.3g} to {values.max():.3g} along the record, judged "
                "in blocks that it was not fitted to", *gain_words(cause, g, np.inf, [])], g))
    return named, doubtful
