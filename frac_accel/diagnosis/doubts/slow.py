"""What is slow, and courses in time."""

import math

import numpy as np
from scipy.ndimage import uniform_filter1d

from ...model.effects import IDENTIFIED
from ...model.effects.base import GAIN, OFFSET
from ..engine import WEIGHS
from .links import MOSTLY, RESEMBLES

# Parts of the record over whose length the mean shows what is slow, and share of what a cause
# adds (RMS) from which it is slow. Then it must take so many times what is left wanders by: the
# best step in noise with a long memory takes three to four times that.
_SLOW_PARTS, _SLOW_SHARE, _SLOW_TIMES = 20, 0.5, 6.0
# Share of a level within which the sensor shows it as it is, and share of it that a constant must
# have for that to be strange.
_UNCHANGED, _PART_OF_LEVEL = 0.02, 0.1
# Times the median size of what is left from which it stands out.
_OUTLYING = 10.0
# Octaves up to the Nyquist frequency in which no zero wanders.
_FAST_OCTAVES = 3
# Share of its strength by which the part of it that is not slow may be stronger or weaker.
_AS_STRONG = 0.1


def as_slow(engine, best, added, takes):
    """Slow causes beside which what is left wanders nearly as much: noise with a long memory; and
    any but what goes with other axes beside a high-pass of the reference that is turned back, which
    gives its noise one."""
    p, found = engine.problem, {}
    turned_back = [cause for cause, effect in best.effects.items() if np.any(effect.poles() == 0)]

    def slow(values):
        return engine.rms(_slow_part(p, values))
    wanders = slow(best.residual)
    for cause, change in added.items():
        if cause in turned_back or slow(change) <= _SLOW_SHARE * engine.rms(change):
            continue
        if takes[cause] < _SLOW_TIMES * wanders and not _is_as_strong_fast(p, best, change):
            found[cause] = f"what it explains is slow ({takes[cause]:.3g} RMS), and what is left " \
                           f"wanders by {wanders:.3g} RMS"
        elif turned_back and not best.effects[cause].mixes_axes:
            found[cause] = f"what it explains is slow ({takes[cause]:.3g} RMS), as the " \
                           f"reference's own noise is where {turned_back[0]} is turned back"
    return found


def of_level(engine, best, added):
    """What changes the gain, or the zero, along the record of a motion far from zero, as a pressure
    is: either does nearly what the other does, and only what goes with the motion about its level
    tells which."""
    p, found = engine.problem, {}
    for cause, change in added.items():
        effect = best.effects[cause]
        if effect.everyday or not effect.shows_with_time or effect.stage not in (GAIN, OFFSET):
            continue
        if effect.stage == OFFSET:
            motion = p.simulate({name: other for name, other in best.effects.items()
                                 if other.stage < OFFSET})
            other, course, gain = "gain", change, change * motion / (motion[p.used].mean() or 1.0)
        else:
            circumstances = p.simulator(p.axis).circumstances
            other, course, gain = "zero", effect.simulate(np.ones(len(change)), circumstances), \
                change
        zeros = np.stack([np.ones(p.count), course[p.used]], axis=1)
        own = np.zeros(len(change))
        own[p.used] = gain[p.used] - zeros @ np.linalg.lstsq(zeros, gain[p.used])[0]
        apart, rest = engine.rms(own), engine.rms(best.residual)
        if apart < min(MOSTLY * engine.rms(change), WEIGHS * rest) \
                and not _is_as_strong(p, own, best.residual):
            found[cause] = (f"a {other} with that course does the same but for {apart:.3g} RMS, "
                            f"and {rest:.3g} are left")
    return found


def of_unchanged_level(engine, best):
    """A constant, and a gain beside it, that together leave a level as it is: what changes the gain
    of the motion, and not that of gravity, does the same."""
    p, constant = engine.problem, IDENTIFIED["offset"].cause
    if constant not in best.effects:
        return {}
    level = float(np.mean(p.record.reference[p.used, p.axis]))
    off = float(np.mean(p.measured[p.used])) - level
    size = abs(best.effects[constant].offset)
    if not abs(off) < _UNCHANGED * abs(level) or size < _PART_OF_LEVEL * abs(level):
        return {}
    return dict.fromkeys(
        [constant, *(cause for cause, effect in best.effects.items()
                     if effect.everyday and effect.is_constant and cause != constant)],
        f"the mean is that of the reference to within {abs(off / level):.1%}: what changes the "
        "gain of the motion, and not that of its mean, does the same")


def _slow_part(problem, values):
    """Running mean over a part of the record."""
    return uniform_filter1d(values, max(problem.count // _SLOW_PARTS, 1))


def _is_as_strong_fast(problem, best, change):
    """Whether the part of what a cause adds that is not slow is there as well, as strong: of that,
    noise with a long memory has little, and what has none of it is only slow.
    """
    return _is_as_strong(problem, *(values - _slow_part(problem, values)
                                    for values in (change, best.residual)))


def _is_as_strong(problem, change, left):
    """Whether a part of what a cause adds is there as strong as the cause says, beside what is
    left.

    The uncertainty of its strength is by parts of the record (cluster-robust); what stands far out
    of the rest counts as if it only just did.
    """
    most = _OUTLYING * np.median(np.abs(left[problem.used]))
    left = np.clip(left, -most, most)
    parts = np.array_split(np.flatnonzero(problem.used), _SLOW_PARTS)
    energy = np.array([change[rows] @ change[rows] for rows in parts])
    more = np.array([change[rows] @ left[rows] for rows in parts])
    if not energy.sum() > 0:
        return False
    off = more.sum() / energy.sum()
    std = np.linalg.norm(more - off * energy) / energy.sum()
    return bool(_SLOW_TIMES * std < 1 + off and abs(off) < _AS_STRONG)


def _low_lines(in_octaves):
    """Share of the tones that a zero which wanders may make."""
    power = np.maximum(in_octaves, 0.0)
    return float(power[:-_FAST_OCTAVES].sum() / max(power.sum(), np.finfo(float).tiny))


def elsewhen(engine, best, takes, left):
    """Causes that grow with time beside which what is left still changes with it."""
    shares, found = {part: share for share, part in engine.structure(best)}, {}
    if "lines" in shares:
        shares["lines"] *= _low_lines(engine.budget(best).in_bands["lines"])
    takes = {cause: rms for cause, rms in takes.items()
             if not engine.stands_alone(best, cause, rms)}
    for cause, taken in takes.items():
        effect = best.effects[cause]
        # an offset that wanders shows as slow, or as lines of low frequency
        parts = ("slow", "lines") if effect.stage == OFFSET else ("time_varying",)
        share = sum(shares.get(part, 0.0) for part in parts)
        if effect.shows_with_time and not effect.everyday \
                and taken < RESEMBLES * math.sqrt(share) * left.rms:
            found[cause] = f"{share:.0%} of what is left changes with time: the course in time " \
                           "is another one"
    courses = [cause for cause in takes if best.effects[cause].shows_with_time
               and not best.effects[cause].everyday]
    # what coarse rounding leaves is of no course
    rest = engine.rms_beside_rounding(best)
    # a sweep's frequency and level change with time, too: several follow any course of the motion,
    # as several offsets do of the mean
    for kind in (False, True):
        alike = [cause for cause in courses if (best.effects[cause].stage == OFFSET) == kind]
        for cause in alike if len(alike) > 1 else ():
            if takes[cause] < WEIGHS * rest:
                found.setdefault(cause, f"{', '.join(alike)} together follow any course in time, "
                                        f"and it takes {takes[cause]:.3g} RMS only beside "
                                        f"{rest:.3g} that are left")
    return found
