"""Offsets, tones and other axes that the motion itself may make."""

import math

import numpy as np

from ...model.effects.base import OFFSET, Effect
from .links import MOSTLY, linear_share, share_of

# Constant of the simulated output, over an offset, from which a gain at standstill may make it.
_OF_CONSTANT = 0.3
# Share of that constant up to which an offset has left nothing of it, and times what such a filter
# takes of the motion that it may add to the constant: only a coupling that takes it away does more.
_CANCELLED, _ADDS = 0.02, 10.0
# Times what is left of the other axes (RMS) that what brings them in must take: these have causes
# of their own, too.
_ACROSS = 10.0
# Correlation of what is left with the motion times what a cause adds that should have nothing to do
# with it, from which a gain that comes and goes may have made both.
_WITH_MOTION = 0.3


def at_standstill(engine, best, takes):
    """Offsets beside a constant of the reference, such as gravity, that a gain at standstill,
    another one or none, does as well: those that leave nothing of the constant, and any where a
    filter would take most of what is left."""
    p, found = engine.problem, {}
    for cause in takes:
        if best.effects[cause].stage != OFFSET or not best.effects[cause].everyday:
            continue
        added = float(np.mean(engine.added(best, cause)[p.used]))
        left = float(np.mean(best.output[p.used]))
        constant = left - added
        if abs(left) < _CANCELLED * abs(constant):
            found[cause] = (f"it leaves nothing of the constant {constant:.2g} that the reference "
                            "has: AC coupling below all of the motion, or gravity that was taken "
                            "away, does the same")
            continue
        share = linear_share(engine, best)
        taken = math.sqrt(share) * engine.rms(best.residual) / np.std(best.output[p.used])
        if share >= MOSTLY and abs(constant) > _OF_CONSTANT * abs(added) \
                and added / constant < _ADDS * taken:
            found[cause] = (f"a linear filter would take {share:.0%} of what is left, and its gain "
                            f"at standstill may make the {added:.3g} of the {constant:.3g} there")
    return found


def other_axes(engine, best, takes, left):
    """Causes that bring in the other axes beside which what is left still has much of these."""
    share = share_of(engine, best, "across")
    rest = math.sqrt(share) * left.rms
    return {cause: f"{share:.0%} of what is left comes from the other axes: they come in otherwise"
            for cause, taken in takes.items()
            if best.effects[cause].mixes_axes and taken < _ACROSS * rest}


def of_motion(engine, best, added):
    """Causes that should have nothing to do with the motion, but may have."""
    apart = {cause: effect for cause, effect in best.effects.items()
             if type(effect).may_be_of is not Effect.may_be_of}
    p, found = engine.problem, {}
    # its own axis last: that says more than the others
    for axis in np.roll(range(3), 2 - p.axis) if apart else ():
        if not np.ptp(p.record.reference[:, axis]):
            continue
        motion = p.response(axis)
        motion = np.where(p.used, motion - motion[p.used].mean(), 0.0)
        words = "another axis moves like that: what crosses over from there looks the same" \
            if axis != p.axis else "the reference moves like that, and more: a narrow filter " \
            "makes the same of it"
        found |= {cause: words for cause, effect in apart.items()
                  if effect.may_be_of(motion, p.time)}
    motion = best.output - best.output[p.used].mean()
    for cause in apart.keys() & added.keys():
        with_it = motion * added[cause]
        shared = abs(with_it @ best.residual) / max(
            np.linalg.norm(with_it) * np.linalg.norm(best.residual * p.used), 1e-300)
        if shared > _WITH_MOTION:
            found[cause] = (f"{shared**2:.0%} of what is left (power) goes with the motion times "
                            "it: a gain that comes and goes so makes both of a motion with a mean")
    return found
