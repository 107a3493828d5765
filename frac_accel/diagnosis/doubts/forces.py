"""Forces and other laws that are not linear, and what is small beside them."""

import math

import numpy as np

from ...model import is_link
from ..engine import WEIGHS
from ..problem import WRONG_BY_STEPS, acts_on_spring
from ..search import acts_as_filter
from .links import filters_of

# Times the odd (even) part of what is left, in RMS, that an odd (even) cause must take; and beside
# a slower reference, which does not show all of what a law bends.
_LIKE_LAW, _LIKE_LAW_BELOW = 30.0, 15.0
# Correlation from which a shift of the core does what a law of force does, and times what is left,
# in RMS, that the law must then take to be told from others.
_ALIKE, _TELLS_LAW = 0.8, 5.0
# Share of the output (RMS) from which a force is strong.
_STRONG = 0.3
# Share of the motion on either side of zero that tells its gains apart, part of what is left (RMS)
# that must go with its size, and of a gain's change from which that is one of one side.
_EACH_SIDE, _SIDED, _OF_GAIN = 0.1, 0.5, 0.3


def beside_a_strong_force(engine, best, takes, left, noise):
    """Links that take little beside a force as large as the spring's own: how that motion depends
    on its start, which is not known, leaves more that looks like noise."""
    strong = _STRONG * float(np.std(engine.problem.measured[engine.problem.used]))
    if noise.rms is not None or not any(acts_on_spring(best.effects[cause]) and taken > strong
                                        for cause, taken in takes.items()):
        return {}
    return {cause: f"it takes {taken:.3g} RMS beside a strong force, where {left.rms:.3g} are left "
                   "that nothing shows to be noise" for cause, taken in takes.items()
            if is_link(best.effects[cause]) and taken < WEIGHS * left.rms}


def within_steps(engine, best, takes, added):
    """Filters that take no more than the steps of the integration of a force may be wrong by."""
    wrong = WRONG_BY_STEPS * math.hypot(*(
        engine.rms(added[cause]) for cause in takes if acts_on_spring(best.effects[cause])))
    return {cause: f"it takes {taken:.3g} RMS, which the simulation of so strong a force may be "
                   "wrong by" for cause, taken in takes.items()
            if taken < wrong and acts_as_filter(best.effects[cause])}


def other_laws(engine, best, takes, left):
    """Nonlinear causes beside which what is left is still nonlinear in the same way."""
    parts = {part: math.sqrt(share) * left.rms for share, part in engine.structure(best)
             if part in ("odd", "even")}
    found, filters = {}, filters_of(engine, best)
    alike = _LIKE_LAW_BELOW if engine.record.is_on_other_instants("sensor") else _LIKE_LAW
    for cause, taken in takes.items() if parts else ():
        effect = best.effects[cause]
        if cause in filters or effect.shows_with_time or effect.everyday or effect.is_constant \
                or effect.mixes_axes:
            continue
        part = "odd" if engine.odd_share(best, cause) > 0.5 else "even"
        if taken < alike * parts.get(part, 0.0):
            found[cause] = f"what is left is {part} too ({parts[part]:.3g} RMS beside the " \
                           f"{taken:.3g} that it takes): the law is another one"
    return found


def parts_of_a_law(best, takes, added, left):
    """A shift of the core and a law of force that do nearly the same, the law hardly seen itself.

    A linear and another term are the beginning of any law's series.
    """
    found = {}
    shifts = [cause for cause in takes if best.effects[cause].restates_core]
    laws = [cause for cause in takes if acts_on_spring(best.effects[cause])]
    for shift in shifts:
        for law in laws:
            one, other = added[shift], added[law]
            alike = abs(one @ other) / max(np.linalg.norm(one) * np.linalg.norm(other), 1e-300)
            if alike > _ALIKE and takes[law] < _TELLS_LAW * left.rms:
                words = (f"{shift} and {law} do nearly the same: together they may be another law "
                         "of the force")
                found |= {shift: words, law: words}
    return found


def by_sign(engine, best, added):
    """Gains that are not the same for motion to both sides: what is left goes with its size."""
    p, found = engine.problem, {}
    gains = [cause for cause in added if best.effects[cause].is_constant]
    motion = best.output[p.used]
    if not gains or not _EACH_SIDE < np.mean(motion > 0) < 1 - _EACH_SIDE:
        return found
    forces = [values for cause, values in added.items() if acts_on_spring(best.effects[cause])]
    left = (best.residual + sum(forces))[p.used]
    line = np.stack([np.ones(len(motion)), motion], axis=1)
    size = np.abs(motion) - line @ np.linalg.lstsq(line, np.abs(motion), rcond=None)[0]
    off = left @ size / (size @ size)
    if abs(off) * np.linalg.norm(size) < _SIDED * np.linalg.norm(left):
        return found
    for cause in gains:
        if abs(off) > _OF_GAIN * engine.rms(added[cause]) / engine.rms(best.output):
            found[cause] = (f"the gain differs by {2 * abs(off):.2g} between motion to one side "
                            "and to the other: one number is not what changed")
    return found
