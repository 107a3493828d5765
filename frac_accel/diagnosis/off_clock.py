"""Samples that are lost although the stamps count on, and clocks that are off."""

import numpy as np

from ..model.effects import known_effects
from ..signals.convolution import at_positions

# Samples of a record up to which it is worth a look.
_LONGEST = 80_000
# Samples [intervals] by which the record may be late or ahead anywhere, and most losses that are
# sought: each is simulated by itself.
_REACH, _MOST = 24, 24
# Decimals of an instant [s]: it lies halfway between two samples.
_DIGITS = 6
# Samples of a stretch that a first look takes for one shift.
_STRETCH = 64
# Variances of what is left that a loss must take; passes in which that settles.
_FOR_A_LOSS, _PASSES = 30.0, 4
# Share of the residual's power that the path may leave of what one shift does, to be worth a look;
# and that a fit with the losses may leave of what is common, or one clock that is off or jumps.
_WORTH_A_LOOK, _LESS = 0.8, 0.5
# Share of the output's power that is left where a clock may have bent the identified model.
_BENT = 1e-3
# Intervals by which what is left between two losses may be late (RMS, by the power of its slope).
_WHOLE = 0.1


def slips_of(engine, output=None):
    """The cause, as {cause: effect}, of samples that may be lost while the stamps count on; empty
    where there are none, or one loss, which a clock that jumps says as well, is all.

    The shift, in whole sampling intervals that only grow, is the path of least error (A. J.
    Viterbi, *IEEE Trans. Inf. Theory* 13 (1967) 260-269).

    Parameters
    ----------
    engine : Engine
    output : ndarray, shape (n,), optional
        What the model says if nothing is lost; by default as fitted to the record as it is.
    """
    p, record = engine.problem, engine.problem.record
    interval_s = 1 / (record.topics[1].clock.rate_hz if record.topics else p.rate)
    place, step = np.arange(len(record), dtype=float), interval_s * p.rate
    if len(p.time) != len(record) or not 4 * _REACH < len(record) < _LONGEST \
            or p.limit.ends_search():
        return {}
    output = engine.everyday().output if output is None else output

    def ahead(count):
        # what follows a lost sample is what the model says later
        later = np.clip(place + count * step, 0, place[-1])
        return output[later.astype(int)] if step == 1 else at_positions(output, later)
    errors = np.array([np.square((p.measured - ahead(count)) * p.used)
                       for count in range(-_REACH, _REACH + 1)], np.float32)
    one = errors.sum(axis=1).min()
    # no path errs less than whatever shift is best in each of some stretches
    stretches = np.add.reduceat(errors, np.arange(0, len(record), _STRETCH), axis=1)
    if stretches.min(axis=0).sum() > _WORTH_A_LOOK * one:
        return {}
    path = _path(errors)
    steps = np.flatnonzero(np.diff(path)) + 1
    least = errors[path, np.arange(len(path))].sum()
    if not 2 <= len(steps) <= _MOST or least > _WORTH_A_LOOK * one:
        return {}
    at_s = np.round(record.since_start_s + p.time[steps] - 0.5 / p.rate, _DIGITS)
    found = [cls.of_slips(at_s, np.diff(path)[steps - 1], interval_s, len(record))
             for cls in known_effects().values()]
    return {effect.cause: effect for effect in found if effect is not None}


def clock_of(engine):
    """The cause, as {cause: effect}, of a clock that is off, or jumps once, where that takes most
    of what is left, and what all then leaves; empty, and what is left, where none does."""
    p, bare = engine.problem, engine.everyday()
    power = np.sum((p.measured - p.measured[p.used].mean())[p.used]**2)
    if len(p.time) >= _LONGEST or bare.cost < _BENT * power or p.limit.ends_search():
        return {}, bare.cost
    fits = [fit for fit in _clocks(engine, bare) if fit.cost < _LESS * bare.cost]
    if not fits:
        return {}, bare.cost
    fit = min(fits, key=lambda fit: fit.cost)
    return {cause: effect for cause, effect in fit.effects.items()
            if cause not in bare.effects and is_clock(effect)}, fit.cost


def put_back(samples, clock):
    """`Samples` with the stamps that they would have without some causes of the clock."""
    after_s = 1e-9 * (samples.stamps_ns - samples.stamps_ns[0])
    moved_s = np.zeros(len(after_s))
    for effect in clock.values():
        moved_s += (effect.clock_ratio() - 1) * after_s
        for at_s, step_s in effect.time_steps():
            moved_s -= np.where(after_s >= at_s, step_s, 0.0)
    return samples._replace(
        stamps_ns=samples.stamps_ns + np.round(1e9 * moved_s).astype(np.int64))


def are_lost(engine, slips):
    """Whether the samples of `slips_of` are lost, beside what an engine's model says: no clock that
    is off or jumps once does nearly as much, and no lag is left that moves between two losses."""
    p, bare = engine.problem, engine.everyday()
    fit = engine.search.fit({**bare.effects, **slips})
    least = min([bare.cost, *(other.cost for other in _clocks(engine, bare))])
    (effect, *_), start_s = slips.values(), p.record.since_start_s
    edges = np.searchsorted(p.time, [at_s - start_s for at_s, _ in effect.time_steps()])
    halves = np.unique(np.r_[edges, (np.r_[0, edges] + np.r_[edges, len(p.time)]) // 2])
    return fit.cost < _LESS * least and _are_whole(fit, np.split(np.arange(len(p.time)), halves))


def _clocks(engine, bare):
    """Fits with one clock that is off, or jumps once."""
    search = engine.search
    return search.fit_all([search.begun(bare, cause, begin)
                           for _, cause, begin in search.screen(bare)
                           if is_clock(begin)])


def is_clock(effect):
    """Whether an effect, or its class, is of the sensor's clock."""
    return effect.common_to_axes and effect.shows_with_time


def _path(errors):
    """Place of each sample's shift, shape (n,), in errors of all shifts, shape (2 reach + 1, n)."""
    count = errors.shape[1]
    price, path = _FOR_A_LOSS * errors.sum(axis=1).min() / count, None
    for _ in range(_PASSES):
        before, path = path, _least(errors, price)
        if before is not None and np.array_equal(before, path):
            break
        price = _FOR_A_LOSS * errors[path, np.arange(count)].sum() / count
    return path


def _least(errors, price):
    """Place of each sample on the path that never falls and pays for each rise."""
    shifts, count = errors.shape
    came, cost = np.empty((count, shifts), np.int8), errors[:, 0].astype(float)
    places = np.arange(shifts)
    for sample in range(1, count):
        least = np.minimum.accumulate(cost)
        first = np.maximum.accumulate(np.where(cost == least, places, 0))
        # from below, if that pays
        below, source = np.r_[np.inf, least[:-1]] + price, np.r_[0, first[:-1]]
        rises = below < cost
        came[sample] = np.where(rises, source, places)
        cost = np.where(rises, below, cost) + errors[:, sample]
    path = np.empty(count, int)
    path[-1] = np.argmin(cost)
    for sample in range(count - 1, 0, -1):
        path[sample - 1] = came[sample, path[sample]]
    return path


def _are_whole(fit, parts):
    """Whether what a fit leaves between the losses is late by the same everywhere."""
    left, slope = fit.residual, np.gradient(fit.output)
    power = np.array([slope[part] @ slope[part] for part in parts])
    late = np.array([left[part] @ slope[part] for part in parts]) / np.maximum(power, 1e-300)
    mean = np.average(late, weights=power)
    return np.average((late - mean)**2, weights=power) < _WHOLE**2
