"""Whether a record without a model is better begun with a gain than with an oscillator."""

import dataclasses
from typing import NamedTuple

import numpy as np

from ..model import SensorModel, is_link
from ..model.core import Gain, Oscillator
from ..model.effects import Effect, fault_of_reference, known_effects
from .doubts.links import own_delay_s
from .engine import LONG, Engine
from .gain import gain
from .naming import as_open
from .off_clock import is_clock
from .search import acts_as_filter
from .stretches import strongest_part

# Links that are fitted, and the share of an oscillator's residual power that one may leave: by
# itself, and where it is as good as the oscillator with one.
_FITTED = 6
_FAR_LESS, _LESS = 0.1, 0.5
# Damping ratio from which an oscillator is two lags.
_OVERDAMPED = 1.0
# Share of the RMS that an oscillator leaves which something else of as many parameters must take to
# be better, and factor by which it may leave more power than an oscillator with another link, which
# bends itself.
_SURELY_LESS, _NEARLY_AS_GOOD = 0.005, 1.02
# Share by which an oscillator's lead may differ from that of a mount's spring, and factor by which
# the gain with a mount may then leave more power; and from its faster lag, and factor of one lag.
_AS_A_MOUNT, _OF_A_MOUNT = 0.1, 1.1
_AS_ITS_LAG, _OF_ONE_LAG = 0.2, 2.0
# Times what the diagnosis leaves in the end (RMS) up to which a rival describes as much.
_AS_MUCH = 1.2
# Variances of the noise within which a gain with one link describes a record as well.
_AS_WELL = 10.0
# Variances within which a gain with one filter says the same as an oscillator with a link, of more
# parameters: no sensor's own would meet the shape of a filter by chance.
_IN_PLACE_OF_BOTH = 30.0


class Rival(NamedTuple):
    """What describes a record as well as an oscillator: effects by cause, and RMS that it leaves
    [output units]."""

    effects: dict
    rms: float


def flat_instead(record, column, used, model, opened, seed, limit=None):
    """A gain with one link that explains far more than the oscillator that was identified, or as
    much with fewer parameters.

    A filter of the conditioner has no resonance, but an oscillator bends itself to look like it,
    and every cause that is then found makes up for what it cannot.

    Parameters
    ----------
    record : Record
    column : int
    used : ndarray of bool, shape (n,)
    model : SensorModel
        With the oscillator.
    opened : callable
        (model) -> causes by name that the model leaves open, with which each fit begins.
    seed : dict of str to Effect
        What the oscillator was identified with.
    limit : TimeLimit, optional

    Returns
    -------
    SensorModel
        The one given, or with the gain.
    dict of str to Effect
        What to begin with.
    Rival or None
        With the oscillator: what a gain with one link has instead that describes the record as
        well, if any does.
    """
    if len(record) > LONG:
        record, used = strongest_part(record, column, used, LONG // 2)
    links = [cause for cause, effect in known_effects().items()
             if not effect.read_off and (not effect.of_reference or effect.acts_on_slow_motion)
             and effect.transfer_function is not Effect.transfer_function]
    clocks = [cause for cause, effect in known_effects().items() if is_clock(effect)]
    own = Engine(record, column, model, used, opened(model), [*links, *clocks], limit=limit)
    before = own.search.fit({**own.search.base, **seed})
    before = own.search.prune(_with_what_stands_alone(own, _with_clock(own, before, clocks)),
                              own.threshold)
    beside = {cause: effect for cause, effect in before.effects.items()
              if cause in seed or cause not in own.search.base}
    flat = SensorModel(Gain(model.axes[column].core.sensitivity))
    engine = Engine(record, column, flat, used, opened(flat),
                    [cause for cause in links if known_effects()[cause].acts_on(flat.core)],
                    limit=limit)
    fits = _with_a_link(engine, engine.search.fit({**engine.search.base, **beside}))
    # as well with fewer parameters is better: what one more must gain, it must gain here, too
    as_well = max(before.cost + own.threshold(before), _by_its_lead(own, before) * before.cost)
    # without a resonance two lags are no oscillator: what else says as much is as likely
    enough = _FAR_LESS if model.axes[column].core.damping_ratio < _OVERDAMPED else 1.0
    found = next((fit for fit in fits if fit.cost <= enough * before.cost
                  or (fit.size < before.size and fit.cost <= as_well)), None)
    rival = None
    if found is None:
        found, rival = _or_with_a_link(own, before, fits)
    if found is None:
        return model, seed, rival
    return flat, {cause: effect for cause, effect in found.effects.items()
                  if cause not in engine.search.base}, None


def _by_its_lead(engine, fitted):
    """Factor by which a gain with one link may leave more power than an oscillator whose lead says
    that it is one: no sensor is ahead of its motion by itself.

    The damping of a mount's spring makes a lead of 2 zeta / omega; and a lead that undoes the
    faster of two lags, 1 / (omega (zeta + sqrt(zeta^2 - 1))), leaves one.
    """
    model = engine.problem.axis_model(fitted.effects)
    core = model.effective_core
    omega, damping = 2 * np.pi * core.natural_frequency_hz, core.damping_ratio
    lead_s = -sum(effect.pure_delay_s() for effect in model.effects)
    if _as_of_a_mount(lead_s, core):
        return _OF_A_MOUNT
    faster_s = 1 / (omega * (damping + np.sqrt(max(damping**2 - 1, 0.0))))
    undone = damping > _OVERDAMPED and abs(lead_s - faster_s) < _AS_ITS_LAG * faster_s
    return _OF_ONE_LAG if undone else 1.0


def _as_of_a_mount(lead_s, core):
    """Whether a lead is that which the damping of a mount's spring makes."""
    return abs(lead_s - own_delay_s(core)) < _AS_A_MOUNT * own_delay_s(core)


def by_its_lead_a_mount(engine, best):
    """Cause of a set without which its oscillator would be no mount, or None: a zero, and nothing
    else, where that of a mount lies."""
    core = engine.problem.axis_model(best.effects).effective_core
    for cause in best.causes - engine.search.base.keys() if isinstance(core, Oscillator) else ():
        effect = best.effects[cause]
        zeros = effect.zeros()
        if len(zeros) == 1 and zeros[0] and not len(effect.poles()) \
                and _as_of_a_mount(float(np.real(-1 / zeros[0])), core):
            return cause
    return None


def is_a_mount(best, other):
    """Whether a gain's best set is as good as an oscillator's with the zero of a mount, with fewer
    parameters."""
    return other.cost <= _OF_A_MOUNT * best.cost and other.size < best.size


def links_beside_core(engine, best):
    """Links of a set beside an oscillator, by cause; none beside another core."""
    core = engine.problem.axis_model(best.effects).effective_core
    return {cause: effect for cause, effect in best.effects.items()
            if isinstance(core, Oscillator) and cause not in engine.search.base
            and acts_as_filter(effect) and is_link(effect)}


def one_filter_instead(engine, best, links):
    """A gain's set with one filter in the place of an oscillator and links, where it describes the
    record as well with fewer parameters; or None. What comes across from other axes hides that from
    `flat_instead`."""
    search = engine.search
    rest = {cause: effect for cause, effect in best.effects.items()
            if cause in search.candidates and cause not in links}
    fits = map(search.varied,
               search.with_a_filter(search.fit({**search.base, **rest}), _FITTED))
    enough = (1 + _IN_PLACE_OF_BOTH / engine.problem.count) * best.cost
    return min((fit for fit in fits if fit.varied < best.varied and fit.cost <= enough),
               key=lambda fit: fit.cost, default=None)


def own_resonance_instead(engine, best):
    """The set of an oscillator's engine in the place of a gain's with a mount and filters, where it
    describes the record as well with fewer parameters; or None."""
    search = engine.search
    fit = search.fit({**search.base, **{
        cause: effect for cause, effect in best.effects.items()
        if cause in search.candidates and not acts_as_filter(effect)}})
    enough = (1 + _IN_PLACE_OF_BOTH / engine.problem.count) * best.cost
    return fit if fit.varied < best.varied and fit.cost <= enough else None


def _or_with_a_link(own, before, fits):
    """The fit that is better than an oscillator and as good as one with another link, if any; and
    the `Rival` that describes the record as well, if any."""
    change = _change(own, before, fits)
    as_good = 0.0
    if fits and fits[0].cost < _LESS * before.cost:
        as_good = 1 + _AS_WELL / own.problem.count
    elif change and change.reduction > _SURELY_LESS and change.ci95[0] > 0:
        as_good = _NEARLY_AS_GOOD
    found = next((fit for other in (_with_a_link(own, before)[:1] if as_good else ())
                  for fit in fits
                  if fit.size < other.size and fit.cost <= as_good * other.cost), None)
    if not change or change.ci95[1] < 0:
        return found, None
    return found, Rival(fits[0].effects, float(np.sqrt(fits[0].cost / own.problem.count)))


def _change(engine, before, fits):
    """`Gain` of the best of other fits over an oscillator, if it has no more parameters."""
    if not fits or fits[0].size > before.size:
        return None
    used = engine.problem.used
    return gain(*((engine.problem.measured - each.output)[used] for each in (before, fits[0])))


def with_rival(judged, rival):
    """A diagnosis whose parameters are as uncertain as what says the same makes them.

    A resonance of the sensor and one of its mount have another delay: where the record does not
    tell them apart, it may be either. Both ends of a uniform distribution (JCGM 100:2008, 4.3.7).

    Parameters
    ----------
    judged : Diagnosis
    rival : Rival or None
        As from `flat_instead`; what leaves clearly more than the diagnosis in the end is none.
    """
    if rival is None or rival.rms > _AS_MUCH * judged.extended["rmse"]:
        return judged
    faults = [fault_of_reference(effect) for effect in rival.effects.values()]
    other = {**rival.effects, **{fault.cause: fault for fault in faults if fault}}
    return dataclasses.replace(judged, findings=[
        as_open(finding, other[finding.cause], " and ".join(sorted(
            rival.effects.keys() - {finding.cause, finding.effect.mirrors}))
            + " in place of the sensor's own resonance, which describes the record as well")
        if finding.cause in other else finding for finding in judged.findings])


def _with_a_link(engine, fitted):
    """Fits with one link more, the best first; of those that say the same, the smallest."""
    search = engine.search
    fits = search.with_a_filter(fitted, _FITTED, fitted.cost)
    # one of another order may be the best, and none needs what the oscillator was identified with
    pruned = [search.prune(search.varied(fit), engine.threshold) for fit in fits]
    least = min((fit.cost for fit in pruned), default=0.0)
    alike = (1 + _AS_WELL / engine.problem.count) * least
    return sorted(pruned, key=lambda fit: (_is_degenerate(fit), fit.cost > alike,
                                           fit.size * (fit.cost <= alike), fit.cost))


def _is_degenerate(fit):
    """Whether an effect of a fit is not what its name says."""
    scales = {unknown.name: unknown.scale for unknown in fit.unknowns}
    return any(effect.degenerate(scales) for effect in fit.effects.values())


def _with_clock(engine, fitted, clocks):
    """A fit with what a clock does, where that takes most of what is left: what was identified
    without it tells nothing of the sensor."""
    search = engine.search
    for _, cause, begin in search.screen(fitted):
        if cause in clocks:
            fit = next(iter(search.fit_all([search.begun(fitted, cause, begin)])), fitted)
            if fit.cost < _LESS * fitted.cost:
                return fit
    return fitted


def _with_what_stands_alone(engine, fitted):
    """A fit with what stands far out in one place, such as a tone, beside any response: it would
    hide how much better one is than the other."""
    for cause, effect in known_effects().items():
        if effect.beside is Effect.beside or effect.read_off or cause in fitted.effects:
            continue
        for start in effect.starts(engine.search.view(fitted)):
            fit = engine.search.fit({**fitted.effects, cause: start.effect})
            if engine.stands_alone(fit, cause, engine.rms(engine.added(fit, cause))):
                fitted = fit
    return fitted
