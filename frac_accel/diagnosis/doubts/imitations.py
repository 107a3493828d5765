"""Linear causes that may imitate another one, or what is not known."""

import math

import numpy as np

from ...errors import FracAccelError
from ...model import AXES, AxisModel, SensorModel, is_link
from ..engine import LONG, WEIGHS
from ..problem import Problem, follows_path
from .links import (
    AS_LATE,
    MOSTLY,
    RESEMBLES,
    filters_of,
    highest_hz,
    highest_seen_hz,
    is_smooth,
    lag_s_at,
    linear_share,
    power_of,
    share_of,
)
from .peaks import stands_out_at_its_peak

# Times the RMS of the linear part that is left which a filter must take where that is most of what
# is left, for one imitates another to a per cent. Several filters may in any case.
_IMITATES = 100.0
# Share of what a filter changes (power) that lies where it acts.
_ACTS = 0.9
# Times what is left (RMS) that every set without a cause must leave for it to be like no other.
_FAR_BEHIND = 5.0
# Share of what a filter takes (RMS) below which a delay beside it may only mend it.
_MENDS = 0.1
# Filters that may be one of higher order: so many, or two with poles within such a factor.
_SEVERAL, _NEAR = 3, 4.0
# Times the power that is left by a set with filters which a set without them, and without a link of
# the model in use, may leave to say the same.
_AS_WELL = 1.5
# Times what several filters leave (RMS) up to which one other filter is as likely.
_ANOTHER = 1.05
# Logarithm of the size from which a link changes an end of the band, and frequencies at which
# filters are compared where the motion fades into what is left.
_UNDONE, _FADING = 0.3, 8
_MORE = ("a linear filter would take another {:.0%} of what is left: the linear causes only "
         "imitate the true response")
# Share of what is left that changes with time from which filters may be a mean of what moves, and
# times that (RMS) that one of them must then take.
_VARYING, _MOVES = 0.5, 10.0
_MOVING = ("{:.0%} of what is left changes with time: the linear causes may be the mean of what "
           "moves")


def imitators(engine, best, takes, left):
    """Linear causes beside which a filter would take still more: they imitate something else."""
    share, filters = linear_share(engine, best), filters_of(engine, best)
    varying = share_of(engine, best, "time_varying")
    if varying > _VARYING and not share:
        # the mean of a delay or gain that moves is a filter, too
        share, more, clearly = varying, _MOVING, _MOVES
    else:
        more, clearly = _MORE, RESEMBLES
    if not share:
        return {}
    rest = math.sqrt(share) * left.rms
    if not filters:
        # a gain is the beginning of any response
        return {cause: more.format(share) for cause, taken in takes.items()
                if best.effects[cause].is_constant and taken < RESEMBLES * rest}
    # a delay is common beside any filter
    odd = [cause for cause, effect in filters.items() if not effect.everyday] or list(filters)
    # those that take little beside the largest may only mend what that lacks, and those whose lag
    # a lead takes back are no cause
    phaseless = _without_phase(engine, best, odd)
    does = {cause: min(takes.get(cause, np.inf), phaseless.get(cause, np.inf)) for cause in odd}
    most = max(does.values())
    main = [cause for cause in odd if does[cause] > _MENDS * most and cause not in phaseless]
    clear = main if len(main) == 1 and (does[main[0]] > rest * (
        clearly if more is _MOVING or filters[main[0]].everyday or share < MOSTLY
        or _is_like_no_other(engine, best, main[0]) else _IMITATES)
        or phaseless and stands_in_its_band(engine, best, main[0])) else []
    if clear == odd:
        return {}
    linear = [cause for cause, effect in best.effects.items()
              if cause in takes and (cause in filters or effect.is_constant)
              and cause not in clear
              and not stands_out_at_its_peak(engine, best, cause, takes[cause])]
    return dict.fromkeys(linear, more.format(share))


def _without_phase(engine, best, filters):
    """RMS of what a filter does together with the delays that take back its lag, by the causes of
    such pairs: a filter without a phase, of which either part alone takes much."""
    p, found = engine.problem, {}
    delays = [cause for cause in best.effects if best.effects[cause].pure_delay_s()
              and not is_link(best.effects[cause])]
    lead_s = -sum(best.effects[cause].pure_delay_s() for cause in delays)
    for cause in filters if lead_s > 0 else ():
        lag_s = lag_s_at(best.effects[cause], 2 * np.pi / p.time[-1])
        if cause in delays or abs(lag_s - lead_s) > AS_LATE * lead_s:
            continue
        pair = [cause, *delays]
        rest = {name: effect for name, effect in best.effects.items() if name not in pair}
        try:
            found |= dict.fromkeys(pair, engine.rms(best.simulated - p.simulate(rest)))
        except FracAccelError:
            continue
    return found


def stands_in_its_band(engine, fitted, cause):
    """Whether what a cause takes stands far out of all that is left at the frequencies at which it
    acts, whatever is left at others."""
    change, left = (power_of(engine.problem, values)
                    for values in (engine.added(fitted, cause), fitted.residual))
    order = np.argsort(change)[::-1]
    acts = order[:1 + int(np.searchsorted(np.cumsum(change[order]), _ACTS * change.sum()))]
    there = left[acts].sum() / max(left.sum(), 1e-300)
    return bool(engine.takes(fitted, cause)
                > RESEMBLES * math.sqrt(there) * engine.rms(fitted.residual))


def _is_like_no_other(engine, best, cause):
    """Whether no set without a cause, and no larger, comes near what one with it leaves, but for
    such as say the same, which a name must beat anyway."""
    own = engine.comparing(cause)
    costs = [fit.cost / best.cost for fit in own.search.fits.values()
             if cause not in fit.causes and len(fit.causes) <= len(best.causes)]
    return own is engine and min((cost for cost in costs if cost > _AS_WELL), default=0.0) \
        > _FAR_BEHIND**2


def hardly_more(engine, best, left):
    """Filters that take little more than what is common in their place does, beside what a filter
    would still take: that may be the response's other part."""
    share, found = linear_share(engine, best), {}
    for cause, effect in filters_of(engine, best).items() if share else ():
        if effect.everyday or not is_link(effect):
            continue
        plain = engine.as_plain(best, cause)
        more = math.sqrt(max(plain.cost - best.cost, 0.0) / engine.problem.count) \
            if plain else math.inf
        if more < WEIGHS * math.sqrt(share) * left.rms:
            common = ", ".join(sorted(plain.causes - best.causes)) or "nothing"
            found[cause] = (f"{common} in its place takes only {more:.3g} RMS less, and a linear "
                            f"filter would take another {share:.0%} of what is left")
    return found


def resembles(engine, fitted, effect, taken):
    """Why a delay or a shift of the core is not named that a filter would be better than, or ""."""
    share = share_of(engine, fitted, "linear")
    if not (effect.pure_delay_s() or effect.restates_core) \
            or taken > RESEMBLES * math.sqrt(share) * engine.left(fitted).rms:
        return ""
    return _MORE.format(share)


def corrections(engine, best, takes):
    """Causes that take less than what is left, and little beside a larger one: they may only mend
    what that lacks. Delays and shifts of the core do so beside a filter, odd ones beside any."""
    filters, found = filters_of(engine, best), {}
    rest = engine.rms(best.residual)
    # what settles does little where it is judged
    takes = {cause: max(taken, engine.takes(best, cause))
             if best.effects[cause].shows_with_time else taken for cause, taken in takes.items()}
    for among, small in (
            ({cause for cause in filters if cause in takes},
             lambda cause: filters[cause].pure_delay_s() or filters[cause].restates_core),
            (takes, lambda cause: not best.effects[cause].everyday
             and not engine.stands_among_slow(best, cause, takes[cause]))):
        large = max(among, key=takes.get, default=None)
        found |= {cause: f"it takes {takes[cause]:.3g} RMS only beside {large} "
                         f"({takes[large]:.3g} RMS): it may mend what that lacks"
                  for cause in among if takes[cause] < min(_MENDS * takes[large], rest)
                  and small(cause)}
    return found


def one_filter(engine, best):
    """Filters of the sensor that may be parts of one of higher order, which no cause says."""
    poles = {cause: np.atleast_1d(effect.poles()) for cause, effect in
             filters_of(engine, best).items()
             if is_link(effect) and not effect.of_reference and not effect.pure_delay_s()
             and not follows_path(effect)}
    # what keeps the motion's constant is no low-pass
    poles = {cause: own for cause, own in poles.items()
             if len(own) and abs(best.effects[cause].transfer_function(np.array([0j]))[0]) > 0}
    together = set(poles) if len(poles) >= _SEVERAL else set()
    for cause, own in poles.items():
        for other, others in poles.items():
            apart = np.log(np.abs(own).min() / np.abs(others).min())
            if cause < other and abs(apart) < np.log(_NEAR) and all(
                    is_smooth(best.effects[name]) for name in (cause, other)):
                together |= {cause, other}
    return dict.fromkeys(together, "the filters " + ", ".join(sorted(together))
                         + " may be parts of one of higher order")


def another_alone(engine, best):
    """Filters in whose place one other filter, alone, does nearly as well: they imitate it, or
    what is like it. Common ones are no imitators."""
    home = engine.part or engine
    own, base = home.search.fits.get(best.causes), home.search.base
    filters = {cause for cause, effect in filters_of(engine, best).items()
               if is_link(effect) and not effect.everyday and cause not in base}
    if own is None or len(filters) < 2:
        return {}
    for fit in home.search.fits.values():
        other = fit.causes - best.causes
        if len(other) == 1 and not fit.causes & filters and not fit.rough \
                and fit.cost <= _ANOTHER**2 * own.cost:
            cause, = other
            if is_link(fit.effects[cause]) and not fit.effects[cause].everyday:
                more = math.sqrt(fit.cost / own.cost) - 1
                return dict.fromkeys(filters, f"{cause} alone leaves only {more:.1%} more than "
                                     + " and ".join(sorted(filters)))
    return {}


def on_both_sides(engine, best, takes):
    """Filters of the sensor and of the reference that undo each other at an end of the band, or
    where the motion ends; of which one that takes ten times the other may be there without it."""
    p, found = engine.problem, {}
    links = {cause: effect for cause, effect in filters_of(engine, best).items()
             if is_link(effect) and is_smooth(effect)}
    if len({effect.of_reference for effect in links.values()}) < 2:
        return {}
    fading = np.linspace(highest_hz(engine, best), highest_seen_hz(engine, best), _FADING)
    ends = 2j * np.pi * np.array([0.01 / p.time[-1], *fading, 10 * p.rate])
    filters = [(cause, effect, np.log(np.abs(effect.transfer_function(ends))))
               for cause, effect in links.items()]
    for cause, effect, size in filters:
        for other, reference, back in filters:
            if reference.of_reference and not effect.of_reference and np.any(
                    (size * back < 0) & (np.minimum(np.abs(size), np.abs(back)) > _UNDONE)):
                words = (f"{cause} and {other} undo each other in part: one filter of the sensor "
                         "alone, with a zero for the reference's pole, does the same")
                found |= {mine: words for mine, its in ((cause, other), (other, cause))
                          if _MENDS * takes.get(mine, 0.0) < takes.get(its, np.inf)}
    return found


def of_the_model(engine, best):
    """Filters and delays without which, and without one link of the model in use, the sensor is
    described as well: it may only lack that."""
    p, filters = engine.problem, filters_of(engine, best)
    links = [effect for effect in p.baseline.axis(p.axis).effects
             if is_link(effect) and effect.cause not in best.effects]
    if not filters or not links:
        return {}
    rows = p.strongest(LONG // 2)
    rest = {cause: effect for cause, effect in best.effects.items() if cause not in filters}
    record, used = p.part(rows), p.used[rows]
    power = Problem(record, p.axis, p.baseline, used, p.limit).fit(best.effects).cost
    for link in links:
        try:
            without = Problem(record, p.axis, _without(p.baseline, p.axis, link), used, p.limit)
            if without.fit(rest).cost < _AS_WELL * power:
                return dict.fromkeys(filters, f"without the {link.cause} of the model in use the "
                                              "record is described as well: the sensor may lack it")
        except FracAccelError:
            continue
    return {}


def _without(model, axis, link):
    """A model without one link on an axis."""
    axes = {name: model.axis(i) for i, name in enumerate(AXES)}
    own = axes[AXES[axis]]
    axes[AXES[axis]] = AxisModel(own.core, tuple(e for e in own.effects if e is not link))
    return SensorModel(model.core, model.effects, axes, model.metadata, model.reference_faults)
