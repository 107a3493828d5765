"""Leads that no sensor has, and delays and lags that the sensor's own core may have."""

import numpy as np

from ...model import is_link
from ...model.core import Gain, Oscillator
from ...model.effects.base import Effect
from ..in_bands import alike_in_bands
from ..late_reference import is_reference_late, leads
from .links import (
    AS_LATE,
    CLEAR_PEAK,
    core_is_identified,
    end_of_band_hz,
    filters_of,
    lag_s_at,
    largest_damping,
    own_delay_s,
)

# Standard uncertainties by which a delay below zero is one.
_ACAUSAL = 3.0
# Sampling intervals below which a lead is none of stamps.
_NO_LEAD = 0.01
# Times the delay of a core that was identified which a lead beside it may take back, and share by
# which a late reference must differ from one that does just that.
_TAKEN_BACK, _JUST_BACK = 3.0, 0.1
# Damping ratio from which a core has no peak, and times its own delay from which another one is
# none of its kind.
_NO_PEAK, _FAR_LATER = 0.8, 10.0
# Share of a mount's frequency at which lags are those of slow motion.
_SLOW = 1e-3
# Share of a core's pole within which a link's zero undoes it.
_UNDOES = 0.1
_LEAST = ("a lead of {:.3g} s, less than a hundredth of a sampling interval: the phase of whatever "
          "else is not understood")


def acausal(engine, best, stds):
    """Links beside a lead, which takes back what they say too much."""
    links = {cause: effect for cause, effect in filters_of(engine, best).items()
             if not effect.restates_core}
    return _of_no_sensor(engine, best, stds, links) \
        or {cause: words for cause in links
            if (words := within_own_delay(engine, best, best.effects[cause]))} \
        or _taken_back(engine, best, links)


def _of_no_sensor(engine, best, stds, links):
    """Several links, or another core, that come to a lead together with the delays beside them."""
    p = engine.problem
    own = [cause for cause, effect in links.items() if not effect.of_reference]
    # by the stamps, or by the numbers of the samples: either may be when they were taken
    delay = sum(effect.pure_delay_s() for effect in p.axis_model(best.effects).effects
                if not effect.of_reference) - min(p.record.lag_s, 0.0)
    surely = _ACAUSAL * max((each.get("delay_s", 0.0) for each in stds.values()), default=0.0)
    if len(own) >= 2 and delay < 0 and -delay >= surely:
        return dict.fromkeys(own, f"together they come to a delay of {delay:.3g} s, which no "
                                  "sensor has: they imitate something else")
    odd = [cause for cause, effect in best.effects.items()
           if cause not in engine.search.base and not effect.everyday
           and type(effect).change_core is not Effect.change_core]
    leading = [cause for cause in own if best.effects[cause].pure_delay_s() < 0]
    if odd and leading and -delay > max(surely, 0.5 / p.rate):
        return dict.fromkeys([*leading, *odd], f"a lead of {-delay:.3g} s beside another core: "
                             "no sensor has it; they imitate something else")
    return {}


def _taken_back(engine, best, links):
    """Leads beside filters whose lag they take back, with these."""
    p = engine.problem
    # the reference's delay is a lead of the sensor, and so is a delay of its own below zero
    ahead = {cause: -effect.pure_delay_s() for cause, effect in best.effects.items()
             if effect.pure_delay_s() < 0}
    if not ahead:
        return {}
    lead = max(ahead.values())
    # a clear peak is no smooth filter's
    own = [cause for cause, effect in links.items()
           if not effect.of_reference and cause not in ahead
           and not 0 < largest_damping(effect) < CLEAR_PEAK]
    # a digital filter of some samples delays by less than the one of its length in continuous time
    digital = not _leads_less(engine, best, lead)
    strange = [cause for cause in own if not links[cause].everyday and not (
        digital and lead < min(links[cause].pure_delay_s(), 1 / p.rate))]
    # a high-pass has nothing that a lead would take back: not where another filter has, or where
    # the lead is one at all frequencies
    slowly = [cause for cause in strange if leads(links[cause])]
    if len(slowly) < len(strange) or all(
            alike_in_bands(engine, best, engine.added(best, cause)) for cause in ahead):
        strange = [cause for cause in strange if cause not in slowly]
    if lead >= _NO_LEAD / p.rate and strange and not is_reference_late(p, best.effects):
        return dict.fromkeys([*ahead, *strange], f"a lead of {lead:.3g} s, which only a fit beside "
                             "a filter shows: together they imitate something else")
    late = {cause: its for cause, its in ahead.items()
            if cause in links and links[cause].of_reference}
    return {cause: f"a lead of {its:.3g} s beside a filter, less than a sampling interval: a "
                   "digital filter has one of its own"
            for cause, its in late.items()
            if its < 1 / p.rate and any(not leads(links[other]) for other in own)} | {
        cause: _LEAST.format(its) for cause, its in late.items() if its < _NO_LEAD / p.rate}


def _leads_less(engine, best, lead):
    """Whether as many causes with a filter describe the record as well beside a smaller lead."""
    return any(fit.problem is best.problem and not fit.rough and fit.cost <= best.cost
               and len(fit.causes) <= len(best.causes) and filters_of(engine, fit)
               and 0 < max(-effect.pure_delay_s() for effect in fit.effects.values()) < lead
               for fit in engine.search.fits.values() if fit is not best)


def within_own_delay(engine, best, effect):
    """Why a lead or delay is not named that may be the own delay of a core which was identified
    with it, or "".

    A soft mount resonates as a sensor does, but does not delay slow motion: the core's delay
    there, 2 zeta / omega_0, is all that tells one from the other well below the resonance. And
    without a peak a core may stand for any low-pass, each of which has a delay of its own.
    """
    p, delay = engine.problem, effect.pure_delay_s()
    core = p.axis_model(best.effects).effective_core
    if not delay or not isinstance(core, Oscillator) or not core_is_identified(engine):
        return ""
    own = own_delay_s(core)
    if effect.of_reference:
        return "" if abs(-delay - own) > _JUST_BACK * own \
            or is_reference_late(p, best.effects) else \
            (f"a lead of {-delay:.3g} s beside a core whose own delay is {own:.3g} s: a filter "
             "that delays nothing, such as a centred mean, does the same")
    if 0 > delay >= -_TAKEN_BACK * own:
        return (f"a lead of {-delay:.3g} s beside a resonance whose own delay is {own:.3g} s: a "
                "soft mount resonates alike and does not delay")
    if 0 < delay <= _FAR_LATER * own and core.damping_ratio >= _NO_PEAK:
        return (f"a delay of {delay:.3g} s beside a core without a peak whose own is {own:.3g} s: "
                "other filters do the same with another delay")
    return ""


def least_lead(engine, best, effect):
    """Why a lead beside a filter is not named that is none of stamps, or ""."""
    p, lead = engine.problem, -effect.pure_delay_s()
    if is_link(effect) or not 0 < lead < _NO_LEAD / p.rate or not filters_of(engine, best):
        return ""
    return _LEAST.format(lead)


def delay_of_unseen_core(engine, best):
    """Delay [s] of slow motion in a core that was identified, but resonates beyond all that is
    compared: it may be one of something else, or of none; otherwise 0."""
    core, p = engine.problem.axis_model(best.effects).effective_core, engine.problem
    if not isinstance(core, Oscillator) or not core_is_identified(engine) \
            or core.natural_frequency_hz < end_of_band_hz(p):
        return 0.0
    return own_delay_s(core)


def undone_mounts(engine, best):
    """Leads [s] of the zeros of mounts, by cause, on a gain that was identified, where the other
    filters together lag by just as much: the sensor's own resonance does the same without either.
    """
    p, found = engine.problem, {}
    if not isinstance(p.baseline.axis(p.axis).core, Gain) or not core_is_identified(engine):
        return found
    filters = filters_of(engine, best)
    for cause, effect in filters.items():
        poles, zeros = np.atleast_1d(effect.poles()), np.atleast_1d(effect.zeros())
        if not is_link(effect) or len(poles) != 2 or not np.all(poles.imag) or len(zeros) != 1 \
                or not zeros[0]:
            continue
        lead_s = float(np.real(-1 / zeros[0]))
        others = [other for name, other in filters.items() if name != cause]
        lag_s = sum(lag_s_at(other, _SLOW * abs(poles[0])) for other in others)
        if others and abs(lag_s - lead_s) < AS_LATE * lead_s:
            found[cause] = lead_s
    return found


def may_be_the_sensor(engine, best):
    """Mounts whose zero the other filters undo."""
    return {cause: f"its zero leads by {lead_s:.3g} s, and the other filters lag by as much: the "
                   "sensor's own resonance does the same without either"
            for cause, lead_s in undone_mounts(engine, best).items()}


def undoes_the_core(engine, best):
    """Links with a zero where the core that was identified has a pole: of both together a filter
    with fewer poles does the same."""
    core = engine.problem.axis_model(best.effects).effective_core
    if not isinstance(core, Oscillator) or not core_is_identified(engine):
        return {}
    poles = core.poles()
    return {cause: f"its zero undoes a lag of {-pole.real / (2 * np.pi):.3g} Hz in the core that "
                   "was identified: a filter in the place of both does the same"
            for cause, effect in filters_of(engine, best).items() if is_link(effect)
            for zero in np.atleast_1d(effect.zeros()) for pole in poles
            if abs(zero - pole) < _UNDOES * abs(pole)}
