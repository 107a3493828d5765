"""Why a fitted cause is not named: the rules that look at the record beside the fit."""

import dataclasses
import math

import numpy as np
from scipy.ndimage import uniform_filter1d

from ..errors import FracAccelError
from ..model import AXES, AxisModel, SensorModel, is_link
from ..model.core import Gain, Oscillator
from ..model.effects.base import GAIN, OFFSET, Effect
from ..model.parameters import parameter_fields
from .courses import with_level
from .engine import LONG, WEIGHS
from .gradual import gradual
from .in_bands import otherwise_in_bands
from .late_reference import is_reference_late, leads
from .names import cancelling, undetermined
from .problem import WRONG_BY_STEPS, Problem, acts_on_spring, follows_path
from .search import acts_as_filter
from .words import AS_NOISE

# Times the odd (even) part of what is left, in RMS, that an odd (even) cause must take; and beside
# a slower reference, which does not show all of what a law bends.
_LIKE_LAW, _LIKE_LAW_BELOW = 30.0, 15.0
# Logarithm of the size from which a link changes an end of the band, share of the motion's power
# below its highest frequency, and damping ratio of a pole below which a link shows as a resonance.
_UNDONE, _MOTION = 0.3, 0.99
_RESONANT = 0.19
# Parts of the spectrum over which a density is taken, and frequencies at which filters are compared
# where the motion fades into what is left.
_BANDS, _FADING = 200, 8
# Share of the output (RMS) above which what is left says that little of the sensor is understood.
_MOST_OF = 0.5
# Times the RMS of the linear part that is left which what is linear must take, or it may only
# resemble the true response; and what a filter must where that part is most of what is left, for
# one imitates another to a per cent. Several filters may in any case. Likewise what changes with
# time.
_RESEMBLES, _IMITATES, _MOSTLY = 30.0, 100.0, 0.5
# Share of what a filter changes (power) that lies where it acts.
_ACTS = 0.9
# Times what is left (RMS) that every set without a cause must leave for it to be like no other.
_FAR_BEHIND = 5.0
# Share of what is left that its linear part surely must have to count.
_SURELY = 0.03
# The same of what brings in the other axes: these have causes of their own, too.
_ACROSS = 10.0
# Correlation from which a shift of the core does what a law of force does, and times what is left,
# in RMS, that the law must then take to be told from others.
_ALIKE, _TELLS_LAW = 0.8, 5.0
# Parts of the record over whose length the mean shows what is slow, and share of what a cause
# adds (RMS) from which it is slow. Then it must take so many times what is left wanders by: the
# best step in noise with a long memory takes three to four times that.
_SLOW_PARTS, _SLOW_SHARE, _SLOW_TIMES = 20, 0.5, 6.0
# Times the median size of what is left from which it stands out.
_OUTLYING = 10.0
# Share of its strength by which the part of it that is not slow may be stronger or weaker.
_AS_STRONG = 0.1
# Scatter of what a constant adds, over it: a dead zone, or samples that do not count, make some.
_CONSTANT = 0.1
# Share of what a cause takes (RMS) that it must change the output by: else its free motion does
# that.
_BY_ITSELF = 0.5
# Share of what a filter takes (RMS) below which a delay beside it may only mend it.
_MENDS = 0.1
# Share of what is left (RMS) below which an odd cause is too small where nothing shows that this is
# noise: pairing, resampling and the reference's own errors come to as much.
_LITTLE = 0.25
# Filters that may be one of higher order: so many, or two with poles within such a factor.
_SEVERAL, _NEAR = 3, 4.0
# Times the power that is left by a set with filters which a set without them, and without a link of
# the model in use, may leave to say the same.
_AS_WELL = 1.5
# Standard uncertainties by which a delay below zero is one.
_ACAUSAL = 3.0
# Share of the motion's power beyond whose frequencies none is seen, and times the highest of these
# from which a resonance is out of sight.
_ALL_MOTION, _OUT_OF_SIGHT = 0.9999, 1.2
# Of a further resonance, times the frequency at which it raises the end of what is compared as
# much as a filter of the reference.
_FURTHER = (0.95, 1.0, 1.05)
# Sampling intervals below which a lead is none of stamps.
_NO_LEAD = 0.01
# Times what several filters leave (RMS) up to which one other filter is as likely.
_ANOTHER = 1.05
# Times the delay of a core that was identified which a lead beside it may take back, and share by
# which a late reference must differ from one that does just that.
_TAKEN_BACK, _JUST_BACK = 3.0, 0.1
# Damping ratio from which a core has no peak, and times its own delay from which another one is
# none of its kind.
_NO_PEAK, _FAR_LATER = 0.8, 10.0
# Constant of the simulated output, over an offset, from which a gain at standstill may make it.
_OF_CONSTANT = 0.3
# Share of that constant up to which an offset has left nothing of it, and times what such a filter
# takes of the motion that it may add to the constant: only a coupling that takes it away does more.
_CANCELLED, _ADDS = 0.02, 10.0
# Share of the output (RMS) from which a force is strong.
_STRONG = 0.3
# Share of the highest frequency that is compared from which a peak lies at its end.
_EDGE = 0.95
# Correlation of what is left with the motion times what a cause adds that should have nothing to do
# with it, from which a gain that comes and goes may have made both.
_WITH_MOTION = 0.3
# Share of the motion on either side of zero that tells its gains apart, part of what is left (RMS)
# that must go with its size, and of a gain's change from which that is one of one side.
_EACH_SIDE, _SIDED, _OF_GAIN = 0.1, 0.5, 0.3
# Damping ratio below which a link has a peak, and times what is left within half an octave of it
# (RMS) that it must then take.
_PEAKED, _AT_PEAK = 0.1, 10.0
# Times as dense as in the octaves beside its resonance that what is left must be there to be of it.
_DENSER = 10.0
# Times the end of what is compared up to which an average's corner is looked for, and frequencies.
_FAR_BEYOND, _CORNERS = 8.0, 2049
# Times as low as the model in use has it that a core's resonance is another one's, which nothing
# shows.
_FAR_MOVED = 2.0
# Share of a core's pole within which a link's zero undoes it.
_UNDOES = 0.1
# Share of the lead of a mount's zero by which the lag of what undoes it may differ, and share of
# the mount's frequency at which lags are those of slow motion.
_AS_LATE, _SLOW = 0.05, 1e-3
# Share of what is left around a mode's resonance without it from which it explains nothing there.
_NO_LESS = 0.9
# Damping ratio above which a mode beside the sensor's own hardly rings, and below which a peak is
# no smooth filter's.
_RINGS, _CLEAR_PEAK = 0.3, 0.2
_LEAST = ("a lead of {:.3g} s, less than a hundredth of a sampling interval: the phase of whatever "
          "else is not understood")
_MORE = ("a linear filter would take another {:.0%} of what is left: the linear causes only "
         "imitate the true response")
# Share of what is left that changes with time from which filters may be a mean of what moves, and
# times that (RMS) that one of them must then take.
_VARYING, _MOVES = 0.5, 10.0
_MOVING = ("{:.0%} of what is left changes with time: the linear causes may be the mean of what "
           "moves")


def doubts_about(engine, best, gains, stds, left, noise):
    """Why fitted causes are not named, in words by cause."""
    p = engine.problem
    doubts = dict.fromkeys(engine.uncontested, "the time limit left no time for its rivals")
    doubts |= {**engine.as_the_sensor, **left_open(engine, best, stds, gains)}
    takes = {cause: g.taken for cause, g in gains.items()}
    own, rest = engine.by_reference(best), engine.rms_beside_rounding(best)
    added = {cause: engine.added(best, cause) for cause in gains}
    for cause in gains:
        rms = min(takes[cause], engine.rms(added[cause]))
        # where it was judged: what comes and goes may do less elsewhere
        there = float(np.sqrt(np.mean(added[cause][engine.held_out_rows]**2)))
        # of the whole record: what was learnt may go astray where it is held out
        gained = min(takes[cause], engine.takes(best, cause))
        # what is added behind all dynamics sets nothing in motion
        if max(rms, there) < _BY_ITSELF * gained and best.effects[cause].stage < OFFSET:
            doubts.setdefault(cause, f"it changes the output by {there:.3g} RMS only: the rest of "
                                     f"what it explains ({gained:.3g} RMS) is a free motion "
                                     "of its own")
        if rms < _LITTLE * rest and noise.rms is None and not best.effects[cause].everyday:
            doubts.setdefault(cause, f"it takes {rms:.3g} RMS only beside {rest:.3g} that are "
                                     "left, which nothing shows to be noise")
        # noise makes nothing that changes with time, or that goes with other axes
        if rms < AS_NOISE * own and not best.effects[cause].shows_with_time \
                and not best.effects[cause].mixes_axes:
            doubts.setdefault(cause, f"what it explains ({rms:.3g} RMS) is no more than what the "
                                     f"reference's own noise makes ({own:.3g} RMS)")
    if min(takes.values(), default=np.inf) < WEIGHS * left.rms:
        unexplained = engine.unexplained(best)
        for cause, rms in takes.items():
            like = best.effects[cause].kindred(best.residual, p.time)
            strange = math.sqrt(max(unexplained**2 - like**2, 0.0))
            if rms < WEIGHS * strange and not engine.stands_among_slow(best, cause, rms) \
                    and not engine.stands_in_its_kind(best, cause, rms):
                doubts.setdefault(cause, f"what it explains ({rms:.3g} RMS) does not stand out of "
                                         f"what is left unexplained ({strange:.3g} RMS)")
    if words := most_is_left(engine, left, noise):
        for cause in gains:
            doubts.setdefault(cause, words)
    for cause, words in {**by_what_is_left(engine, best, takes, left),
                         **_acausal(engine, best, stds), **_of_the_model(engine, best),
                         **_as_slow(engine, best, added, takes), **_of_level(engine, best, added),
                         **with_level(engine, best, added),
                         **otherwise_in_bands(engine, best, added),
                         **gradual(engine, best, gains)}.items():
        doubts.setdefault(cause, words)
    for pair in cancelling(added):
        # what begins or settles does so from a constant, which may be that of its start or its end,
        # and of a turned axis gravity comes with the motion across
        of_used = [added[cause][p.used] for cause in pair]
        if any(best.effects[cause].counts_from_start or best.effects[cause].mixes_axes
               for cause in pair) \
                and any(np.std(values) < _CONSTANT * abs(np.mean(values)) for values in of_used):
            continue
        for cause, other in (pair, pair[::-1]):
            doubts.setdefault(cause, f"it nearly cancels {other}: together they may stand for "
                                     "one cause that is not known")
    for cause, words in {**_parts_of_a_law(best, takes, added, left),
                         **_beside_a_strong_force(engine, best, takes, left, noise),
                         **_within_steps(engine, best, takes, added),
                         **_hardly_more(engine, best, left), **_beyond_the_motion(engine, best),
                         **_of_motion(engine, best, added), **_of_a_further_mode(engine, best),
                         **_at_the_edge(engine, best), **_hardly_rings(engine, best),
                         **_out_of_sight(engine, best), **_undoes_the_core(engine, best),
                         **_may_be_the_sensor(engine, best),
                         **_rings_otherwise(engine, best, takes, noise),
                         **_nothing_at_its_peak(engine, best),
                         **_by_sign(engine, best, added),
                         **_corrections(engine, best, takes)}.items():
        doubts.setdefault(cause, words)
    if gains and (left.share > 0 or not engine.is_accounted(best, noise)):
        for cause, words in engine.unstable(best).items():
            doubts.setdefault(cause, words)
    return {cause: words for cause, words in doubts.items() if cause in gains}


def most_is_left(engine, left, noise):
    """Why nothing has a name that a fit alone shows, where most of the output is left; or ""."""
    share = left.rms / np.std(engine.problem.measured[engine.problem.used])
    if noise.rms is not None or share < _MOST_OF:
        return ""
    return f"{share:.0%} of the output is left, and nothing shows that it is noise"


def _beside_a_strong_force(engine, best, takes, left, noise):
    """Links that take little beside a force as large as the spring's own: how that motion depends
    on its start, which is not known, leaves more that looks like noise."""
    strong = _STRONG * float(np.std(engine.problem.measured[engine.problem.used]))
    if noise.rms is not None or not any(acts_on_spring(best.effects[cause]) and taken > strong
                                        for cause, taken in takes.items()):
        return {}
    return {cause: f"it takes {taken:.3g} RMS beside a strong force, where {left.rms:.3g} are left "
                   "that nothing shows to be noise" for cause, taken in takes.items()
            if is_link(best.effects[cause]) and taken < WEIGHS * left.rms}


def _within_steps(engine, best, takes, added):
    """Filters that take no more than the steps of the integration of a force may be wrong by."""
    wrong = WRONG_BY_STEPS * math.hypot(*(
        engine.rms(added[cause]) for cause in takes if acts_on_spring(best.effects[cause])))
    return {cause: f"it takes {taken:.3g} RMS, which the simulation of so strong a force may be "
                   "wrong by" for cause, taken in takes.items()
            if taken < wrong and acts_as_filter(best.effects[cause])}


def _as_slow(engine, best, added, takes):
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


def _of_level(engine, best, added):
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
        if apart < min(_MOSTLY * engine.rms(change), WEIGHS * rest) \
                and not _is_as_strong(p, own, best.residual):
            found[cause] = (f"a {other} with that course does the same but for {apart:.3g} RMS, "
                            f"and {rest:.3g} are left")
    return found


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


def by_what_is_left(engine, fitted, takes, left):
    """Causes beside which what is left is still of their kind, in words by cause.

    Parameters
    ----------
    engine : Engine
    fitted : Fitted
    takes : dict of str to float
        RMS that each cause takes [output units].
    left : Leftover
    """
    return {**_other_laws(engine, fitted, takes, left), **_elsewhen(engine, fitted, takes, left),
            **_imitators(engine, fitted, takes, left), **_at_standstill(engine, fitted, takes),
            **_on_both_sides(engine, fitted, takes),
            **_one_filter(engine, fitted), **_another_alone(engine, fitted),
            **_other_axes(engine, fitted, takes, left)}


def left_open(engine, fitted, stds, causes):
    """Why the record leaves causes open, in words by cause."""
    p = engine.problem
    core, found = p.baseline.axis(p.axis).core, {}
    for cause in causes:
        places = [(u, place) for u, place in zip(fitted.unknowns, fitted.theta) if u.cause == cause]
        if not places:
            continue  # read off the record
        words = undetermined(fitted.effects[cause], *zip(*places), stds[cause], core, p.time[-1])
        if words:
            found[cause] = words
    return found


def _filters(engine, best):
    """Causes that act as linear filters, by cause."""
    return {cause: effect for cause, effect in best.effects.items()
            if cause not in engine.search.base and acts_as_filter(effect)}


def _share_of(engine, fitted, part):
    """Share of what a fit leaves that is of one part; 0 where that is noise."""
    return {name: share for share, name in engine.structure(fitted)}.get(part, 0.0)


def _linear_share(engine, fitted):
    """Share of what a fit leaves that a linear filter would take: be it little, where more shows
    that this is no noise; 0 where it is."""
    part = next((entry for entry in engine.budget(fitted).parts if entry["part"] == "linear"), None)
    return part["share"] if part and engine.structure(fitted) and part["ci95"][0] > _SURELY \
        else _share_of(engine, fitted, "linear")


def _imitators(engine, best, takes, left):
    """Linear causes beside which a filter would take still more: they imitate something else."""
    share, filters = _linear_share(engine, best), _filters(engine, best)
    varying = _share_of(engine, best, "time_varying")
    if varying > _VARYING and not share:
        # the mean of a delay or gain that moves is a filter, too
        share, more, clearly = varying, _MOVING, _MOVES
    else:
        more, clearly = _MORE, _RESEMBLES
    if not share:
        return {}
    rest = math.sqrt(share) * left.rms
    if not filters:
        # a gain is the beginning of any response
        return {cause: more.format(share) for cause, taken in takes.items()
                if best.effects[cause].is_constant and taken < _RESEMBLES * rest}
    # a delay is common beside any filter
    odd = [cause for cause, effect in filters.items() if not effect.everyday] or list(filters)
    # those that take little beside the largest may only mend what that lacks, and those whose lag
    # a lead takes back are no cause
    phaseless = _without_phase(engine, best, odd)
    does = {cause: min(takes.get(cause, np.inf), phaseless.get(cause, np.inf)) for cause in odd}
    most = max(does.values())
    main = [cause for cause in odd if does[cause] > _MENDS * most and cause not in phaseless]
    clear = main if len(main) == 1 and (does[main[0]] > rest * (
        clearly if more is _MOVING or filters[main[0]].everyday or share < _MOSTLY
        or _is_like_no_other(engine, best, main[0]) else _IMITATES)
        or phaseless and stands_in_its_band(engine, best, main[0])) else []
    if clear == odd:
        return {}
    linear = [cause for cause, effect in best.effects.items()
              if cause in takes and (cause in filters or effect.is_constant)
              and cause not in clear
              and not _stands_out_at_its_peak(engine, best, cause, takes[cause])]
    return dict.fromkeys(linear, more.format(share))


def _without_phase(engine, best, filters):
    """RMS of what a filter does together with the delays that take back its lag, by the causes of
    such pairs: a filter without a phase, of which either part alone takes much."""
    p, found = engine.problem, {}
    delays = [cause for cause in best.effects if best.effects[cause].pure_delay_s()
              and not is_link(best.effects[cause])]
    lead_s = -sum(best.effects[cause].pure_delay_s() for cause in delays)
    for cause in filters if lead_s > 0 else ():
        lag_s = _lag_s(best.effects[cause], 2 * np.pi / p.time[-1])
        if cause in delays or abs(lag_s - lead_s) > _AS_LATE * lead_s:
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
    used = engine.problem.used
    change, left = (np.abs(np.fft.rfft(values * used))**2
                    for values in (engine.added(fitted, cause), fitted.residual))
    order = np.argsort(change)[::-1]
    acts = order[:1 + int(np.searchsorted(np.cumsum(change[order]), _ACTS * change.sum()))]
    there = left[acts].sum() / max(left.sum(), 1e-300)
    return bool(engine.takes(fitted, cause)
                > _RESEMBLES * math.sqrt(there) * engine.rms(fitted.residual))


def _is_like_no_other(engine, best, cause):
    """Whether no set without a cause, and no larger, comes near what one with it leaves, but for
    such as say the same, which a name must beat anyway."""
    own = engine.comparing(cause)
    costs = [fit.cost / best.cost for fit in own.search.fits.values()
             if cause not in fit.causes and len(fit.causes) <= len(best.causes)]
    return own is engine and min((cost for cost in costs if cost > _AS_WELL), default=0.0) \
        > _FAR_BEHIND**2


def _at_standstill(engine, best, takes):
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
        share = _linear_share(engine, best)
        taken = math.sqrt(share) * engine.rms(best.residual) / np.std(best.output[p.used])
        if share >= _MOSTLY and abs(constant) > _OF_CONSTANT * abs(added) \
                and added / constant < _ADDS * taken:
            found[cause] = (f"a linear filter would take {share:.0%} of what is left, and its gain "
                            f"at standstill may make the {added:.3g} of the {constant:.3g} there")
    return found


def _stands_out_at_its_peak(engine, best, cause, taken):
    """Whether a lightly damped link takes far more than all that is left around its resonance:
    whatever filter is missing elsewhere, this peak is there."""
    there = _share_at_its_peak(engine, best, best.effects[cause])[0]
    return there is not None and taken > _AT_PEAK * math.sqrt(there) * engine.rms(best.residual)


def _share_at_its_peak(engine, best, effect):
    """Share of what is left (power) within half an octave of a lightly damped link's resonance, and
    how many times as dense it is as in the octaves on either side; None of another effect."""
    if not is_link(effect) or not 0 < _damping(effect) <= _PEAKED:
        return None, 0.0
    p = engine.problem
    apart = _octaves_from_its_resonance(p, effect)
    power = np.abs(np.fft.rfft(best.residual * p.used))**2
    near = np.abs(apart) < 0.5
    beside = [power[(side * apart > 0.5) & (side * apart < 1.5)] for side in (-1, 1)]
    denser = power[near].mean() / max(part.mean() for part in beside) \
        if near.any() and all(map(len, beside)) else 0.0
    return power[near].sum() / max(power.sum(), 1e-300), denser


def _octaves_from_its_resonance(problem, effect):
    """Of each line of a residual's spectrum."""
    frequency = np.fft.rfftfreq(len(problem.used), 1 / problem.rate)
    return np.log2(np.maximum(frequency, 1e-300) * 2 * np.pi / np.abs(effect.poles()).min())


def _rings_otherwise(engine, best, takes, noise):
    """Lightly damped links at whose resonance most of what is left lies: no noise, but another way
    of ringing, such as a frequency that falls with the amplitude."""
    found, rest = {}, engine.rms(best.residual)
    for cause, taken in takes.items() if noise.rms is None else ():
        share, denser = _share_at_its_peak(engine, best, best.effects[cause])
        if share is not None and share > _MOSTLY and denser > _DENSER \
                and taken < _AT_PEAK * math.sqrt(share) * rest:
            found[cause] = f"{share:.0%} of what is left lies at its resonance ({rest:.3g} RMS " \
                           f"beside {taken:.3g} that it takes): what rings there is not linear"
    return found


def _nothing_at_its_peak(engine, best):
    """Modes beside the sensor's own, with an antiresonance, around which as much is left as without
    them: what they take lies elsewhere, where their share alone shows, as that of many filters."""
    p, found = engine.problem, {}
    for cause, effect in _filters(engine, best).items():
        if not is_link(effect) or not 0 < len(effect.zeros()) == len(effect.poles()) \
                or not 0 < _damping(effect) <= _RINGS:
            continue
        near = np.abs(_octaves_from_its_resonance(p, effect)) < 0.5
        with_it, without = (float(np.sum(np.abs(np.fft.rfft(fit.residual * p.used)[near])**2))
                            for fit in (best, engine.best_without(best, cause)))
        if with_it > _NO_LESS * without:
            found[cause] = "around its resonance as much is left as without it: what it takes " \
                           "lies elsewhere, where many filters do the same"
    return found


def _hardly_more(engine, best, left):
    """Filters that take little more than what is common in their place does, beside what a filter
    would still take: that may be the response's other part."""
    share, found = _linear_share(engine, best), {}
    for cause, effect in _filters(engine, best).items() if share else ():
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
    share = _share_of(engine, fitted, "linear")
    if not (effect.pure_delay_s() or effect.restates_core) \
            or taken > _RESEMBLES * math.sqrt(share) * engine.left(fitted).rms:
        return ""
    return _MORE.format(share)


def _other_laws(engine, best, takes, left):
    """Nonlinear causes beside which what is left is still nonlinear in the same way."""
    parts = {part: math.sqrt(share) * left.rms for share, part in engine.structure(best)
             if part in ("odd", "even")}
    found, filters = {}, _filters(engine, best)
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


def _parts_of_a_law(best, takes, added, left):
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


def _by_sign(engine, best, added):
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


def _corrections(engine, best, takes):
    """Causes that take less than what is left, and little beside a larger one: they may only mend
    what that lacks. Delays and shifts of the core do so beside a filter, odd ones beside any."""
    filters, found = _filters(engine, best), {}
    rest = engine.rms(best.residual)
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


def _one_filter(engine, best):
    """Filters of the sensor that may be parts of one of higher order, which no cause says."""
    poles = {cause: np.atleast_1d(effect.poles()) for cause, effect in
             _filters(engine, best).items()
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
                    _is_smooth(best.effects[name]) for name in (cause, other)):
                together |= {cause, other}
    return dict.fromkeys(together, "the filters " + ", ".join(sorted(together))
                         + " may be parts of one of higher order")


def _another_alone(engine, best):
    """Filters in whose place one other filter, alone, does nearly as well: they imitate it, or
    what is like it. Common ones are no imitators."""
    home = engine.part or engine
    own, base = home.search.fits.get(best.causes), home.search.base
    filters = {cause for cause, effect in _filters(engine, best).items()
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


def _other_axes(engine, best, takes, left):
    """Causes that bring in the other axes beside which what is left still has much of these."""
    share = _share_of(engine, best, "across")
    rest = math.sqrt(share) * left.rms
    return {cause: f"{share:.0%} of what is left comes from the other axes: they come in otherwise"
            for cause, taken in takes.items()
            if best.effects[cause].mixes_axes and taken < _ACROSS * rest}


def _highest_hz(engine, best, share=_MOTION):
    """Frequency [Hz] below which nearly all of the motion is that the sensor shows."""
    used = engine.problem.used
    energy = np.cumsum(np.abs(np.fft.rfft((best.output - best.output[used].mean()) * used))**2)
    return np.searchsorted(energy, share * energy[-1]) * engine.problem.rate / len(used)


def _highest_seen_hz(engine, best):
    """Frequency [Hz] up to which the motion that the sensor shows stands out of what is left."""
    p = engine.problem

    def density(values):
        power = np.abs(np.fft.rfft((values - values[p.used].mean()) * p.used))**2
        return uniform_filter1d(power, max(len(power) // _BANDS, 1), mode="reflect")
    left, frequency = density(best.residual), np.fft.rfftfreq(len(p.used), 1 / p.rate)
    seen = (density(best.output) > np.maximum(left, left.mean())) \
        & (frequency <= (p.record.band_hz or p.rate))
    return frequency[seen].max(initial=0.0)


def _beyond_the_motion(engine, best):
    """Links of the sensor that resonate above all of the motion, where other filters do the same:
    those that make fast motion larger beside a late reference, which may have been smoothed, any
    beside a core that does so, too, and that nobody has stated, and several beside a stated one."""
    p, found = engine.problem, {}
    highest = 2 * np.pi * _highest_hz(engine, best)
    seen = 2 * np.pi * min(_highest_hz(engine, best, _ALL_MOTION), _highest_seen_hz(engine, best))
    core = np.abs(p.axis_model(best.effects).effective_core.poles()) \
        if _core_is_identified(engine) else []
    for cause, effect in _filters(engine, best).items():
        if not is_link(effect) or effect.of_reference or not len(effect.poles()):
            continue
        lowest = np.abs(effect.poles()).min()
        if lowest > highest \
                and abs(effect.transfer_function(np.array([1j * highest]))[0]) > 1 \
                and is_reference_late(p, best.effects):
            found[cause] = "it resonates above the motion, which ends at " \
                           f"{highest / 2 / np.pi:.3g} Hz: to a reference that is late and was " \
                           "smoothed, fast motion looks as much too large"
        elif len(core) and min(lowest, np.min(core)) > _OUT_OF_SIGHT * seen:
            found[cause] = f"it and the core resonate above the motion, which shows up to " \
                           f"{seen / 2 / np.pi:.3g} Hz: there many filters do the same"
    found |= _another_core(engine, best)
    unseen = [cause for cause, effect in best.effects.items() if cause not in engine.search.base
              and _lowest_pole(engine, best, effect) > _OUT_OF_SIGHT * seen]
    if len(unseen) > 1:
        found |= {cause: f"{' and '.join(sorted(unseen))} act above the motion, which shows up to "
                         f"{seen / 2 / np.pi:.3g} Hz: there many filters do the same"
                  for cause in unseen if cause not in found}
    return found


def _another_core(engine, best):
    """Causes that move the stated core far, to where it resonates beyond all that is compared."""
    p, edge = engine.problem, _end_of_band_hz(engine.problem)
    stated, core = p.baseline.axis(p.axis).core, p.axis_model(best.effects).effective_core
    if _core_is_identified(engine) or not isinstance(core, Oscillator) \
            or not edge < core.natural_frequency_hz < stated.natural_frequency_hz / _FAR_MOVED:
        return {}
    return {cause: f"it would resonate at {core.natural_frequency_hz:.3g} Hz, beyond all that is "
                   f"compared ({edge:.3g} Hz) and far from the model's "
                   f"{stated.natural_frequency_hz:.3g} Hz: many filters do the same"
            for cause, effect in best.effects.items() if effect.restates_core}


def _lowest_pole(engine, best, effect):
    """Size [rad/s] of the lowest pole that an odd effect of the sensor brings, or changes in its
    core; 0 of any other effect."""
    if effect.everyday or effect.of_reference or not (is_link(effect) or effect.restates_core):
        return 0.0
    own = effect if is_link(effect) else engine.problem.axis_model(best.effects).effective_core
    return np.abs(own.poles()).min() if len(own.poles()) else 0.0


def _end_of_band_hz(problem):
    """Highest frequency [Hz] that is compared."""
    return problem.record.band_hz or problem.rate / 2


def own_delay_s(core):
    """Delay [s] of slow motion in an oscillator, 2 zeta / omega_0."""
    return core.damping_ratio / (np.pi * core.natural_frequency_hz)


def _at_the_edge(engine, best):
    """Links that ring at the end of what is compared: what one of the two has lost there, or was
    put on other instants with, looks the same."""
    p, found = engine.problem, {}
    edge = _end_of_band_hz(p)
    for cause, effect in _filters(engine, best).items():
        poles = np.atleast_1d(effect.poles()) if is_link(effect) else np.zeros(0)
        ringing = poles[(poles.imag != 0) & (-poles.real < _PEAKED * np.abs(poles))]
        peaks = np.abs(ringing) / (2 * np.pi)
        if np.any((peaks > _EDGE * edge) & (peaks < edge / _EDGE)):
            found[cause] = f"it rings at {peaks.max():.3g} Hz, at the end of what is compared " \
                           f"({edge:.3g} Hz): what one of the two has lost there looks the same"
    return found


def _of_a_further_mode(engine, best):
    """Filters of the reference that raise the response beside one of the sensor that rings, where a
    further resonance like that, beyond all that is compared, does the same."""
    p, found, filters = engine.problem, {}, _filters(engine, best)
    edge = _end_of_band_hz(p)
    ringing = [effect for effect in filters.values() if is_link(effect)
               and np.size(effect.zeros()) < np.size(effect.poles())
               and 0 < _damping(effect) < _CLEAR_PEAK]
    for cause, effect in filters.items() if ringing else ():
        raised = abs(effect.transfer_function(2j * np.pi * edge)) \
            if is_link(effect) and effect.of_reference else 0.0
        if raised <= 1 or p.limit.ends_judging(
                "no further resonance was tried in the place of the reference's filter"):
            continue
        # where it would raise the response as much at the end of what is compared
        beyond_hz = edge / np.sqrt(1 - 1 / raised)
        rest = {name: other for name, other in best.effects.items() if name != cause}
        try:
            costs = [p.fit({**rest, "further": _at_frequency(ringing[0], share * beyond_hz)}).cost
                     for share in _FURTHER]
        except FracAccelError:
            continue
        # the least of a parabola through them, as far as they have one between them
        bend, slope = (costs[2] - 2 * costs[1] + costs[0]) / 2, (costs[2] - costs[0]) / 2
        least = costs[1] - slope**2 / (4 * bend) if abs(slope) < 2 * bend else min(costs)
        if least - best.cost < engine.threshold(best):
            found[cause] = (f"a further resonance near {beyond_hz:.3g} Hz, beyond what is "
                            "compared, does the same")
    return found


def _at_frequency(link, frequency_hz):
    """A ringing link with its resonance elsewhere."""
    return dataclasses.replace(link, **{
        field.name: float(frequency_hz) for field in parameter_fields(type(link))
        if field.metadata["unit"] == "Hz"})


def _undoes_the_core(engine, best):
    """Links with a zero where the core that was identified has a pole: of both together a filter
    with fewer poles does the same."""
    core = engine.problem.axis_model(best.effects).effective_core
    if not isinstance(core, Oscillator) or not _core_is_identified(engine):
        return {}
    poles = core.poles()
    return {cause: f"its zero undoes a lag of {-pole.real / (2 * np.pi):.3g} Hz in the core that "
                   "was identified: a filter in the place of both does the same"
            for cause, effect in _filters(engine, best).items() if is_link(effect)
            for zero in np.atleast_1d(effect.zeros()) for pole in poles
            if abs(zero - pole) < _UNDOES * abs(pole)}


def undone_mounts(engine, best):
    """Leads [s] of the zeros of mounts, by cause, on a gain that was identified, where the other
    filters together lag by just as much: the sensor's own resonance does the same without either.
    """
    p, found = engine.problem, {}
    if not isinstance(p.baseline.axis(p.axis).core, Gain) or not _core_is_identified(engine):
        return found
    filters = _filters(engine, best)
    for cause, effect in filters.items():
        poles, zeros = np.atleast_1d(effect.poles()), np.atleast_1d(effect.zeros())
        if not is_link(effect) or len(poles) != 2 or not np.all(poles.imag) or len(zeros) != 1 \
                or not zeros[0]:
            continue
        lead_s = float(np.real(-1 / zeros[0]))
        others = [other for name, other in filters.items() if name != cause]
        lag_s = sum(_lag_s(other, _SLOW * abs(poles[0])) for other in others)
        if others and abs(lag_s - lead_s) < _AS_LATE * lead_s:
            found[cause] = lead_s
    return found


def _may_be_the_sensor(engine, best):
    return {cause: f"its zero leads by {lead_s:.3g} s, and the other filters lag by as much: the "
                   "sensor's own resonance does the same without either"
            for cause, lead_s in undone_mounts(engine, best).items()}


def _lag_s(effect, omega):
    """Time [s] by which motion of an angular frequency [rad/s] is late behind an effect."""
    turn = np.angle(effect.transfer_function(np.array([1j * omega]))[0]) if is_link(effect) else 0.0
    return effect.pure_delay_s() - float(turn) / omega


def _out_of_sight(engine, best):
    """Filters without a peak, of the sensor or of the reference, whose corners lie beyond all that
    is compared, beside a model that nobody has stated: its core may be another one there."""
    edge, found = _end_of_band_hz(engine.problem), {}
    if all(entry.is_known for entry in engine.loose.values()):
        return {}
    for cause, effect in _filters(engine, best).items():
        corner = _corner_hz(effect, edge) if is_link(effect) and not follows_path(effect) else 0.0
        if corner > edge:
            found[cause] = f"its corner, {corner:.3g} Hz, lies beyond what is compared " \
                           f"({edge:.3g} Hz): there many filters, and cores, do the same"
    return found


def _corner_hz(effect, edge_hz):
    """Lowest corner [Hz] of a link without a peak; of an average of the reference that has no
    poles, where half the power is left; 0 of other links."""
    turns = np.abs(np.r_[effect.poles(), effect.zeros()]) / (2 * np.pi)
    if len(turns):
        return 0.0 if 0 < _damping(effect) <= _RINGS else float(turns.min())
    if not effect.of_reference:
        return 0.0
    frequency = np.linspace(0, _FAR_BEYOND * edge_hz, _CORNERS)
    size = np.abs(np.log(np.abs(effect.transfer_function(2j * np.pi * frequency)))) > np.log(2) / 2
    return float(frequency[np.argmax(size)]) if size.any() else np.inf


def _of_motion(engine, best, added):
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


def _hardly_rings(engine, best):
    """Modes beside the sensor's own, with an antiresonance, that hardly ring."""
    return {cause: f"it hardly rings (damping ratio {damping:.2g}): a part that swings by itself "
                   "rings longer, and filters do the same"
            for cause, effect in _filters(engine, best).items()
            if is_link(effect) and np.size(effect.zeros()) == np.size(effect.poles()) > 1
            and (damping := _damping(effect)) > _RINGS}


def _damping(effect):
    """Largest damping ratio of a link's poles: 1 of a real one; 0 without any."""
    poles = np.atleast_1d(effect.poles())
    ratios = np.where(poles.imag == 0, 1.0, -poles.real / np.maximum(np.abs(poles), 1e-300))
    return float(np.max(ratios, initial=0.0))


def _on_both_sides(engine, best, takes):
    """Filters of the sensor and of the reference that undo each other at an end of the band, or
    where the motion ends; of which one that takes ten times the other may be there without it."""
    p, found = engine.problem, {}
    links = {cause: effect for cause, effect in _filters(engine, best).items()
             if is_link(effect) and _is_smooth(effect)}
    if len({effect.of_reference for effect in links.values()}) < 2:
        return {}
    fading = np.linspace(_highest_hz(engine, best), _highest_seen_hz(engine, best), _FADING)
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


def _of_the_model(engine, best):
    """Filters and delays without which, and without one link of the model in use, the sensor is
    described as well: it may only lack that."""
    p, filters = engine.problem, _filters(engine, best)
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


def _is_smooth(link):
    """Whether a link has no resonance that would tell it."""
    poles = np.atleast_1d(link.poles())
    return not np.any(np.abs(poles.real) < _RESONANT * np.abs(poles))


def _elsewhen(engine, best, takes, left):
    """Causes that grow with time beside which what is left still changes with it."""
    shares, found = {part: share for share, part in engine.structure(best)}, {}
    takes = {cause: rms for cause, rms in takes.items()
             if not engine.stands_alone(best, cause, rms)}
    for cause, taken in takes.items():
        effect = best.effects[cause]
        # an offset that wanders shows as slow, or as lines of low frequency
        parts = ("slow", "lines") if effect.stage == OFFSET else ("time_varying",)
        share = sum(shares.get(part, 0.0) for part in parts)
        if effect.shows_with_time and not effect.everyday \
                and taken < _RESEMBLES * math.sqrt(share) * left.rms:
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


def _core_is_identified(engine):
    """Whether nobody has stated the sensor's own core: it was identified from the record itself."""
    return any(entry.effect.restates_core and not entry.is_known
               for entry in engine.loose.values())


def within_own_delay(engine, best, effect):
    """Why a lead or delay is not named that may be the own delay of a core which was identified
    with it, or "".

    A soft mount resonates as a sensor does, but does not delay slow motion: the core's delay
    there, 2 zeta / omega_0, is all that tells one from the other well below the resonance. And
    without a peak a core may stand for any low-pass, each of which has a delay of its own.
    """
    p, delay = engine.problem, effect.pure_delay_s()
    core = p.axis_model(best.effects).effective_core
    if not delay or not isinstance(core, Oscillator) or not _core_is_identified(engine):
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
    if is_link(effect) or not 0 < lead < _NO_LEAD / p.rate or not _filters(engine, best):
        return ""
    return _LEAST.format(lead)


def delay_of_unseen_core(engine, best):
    """Delay [s] of slow motion in a core that was identified, but resonates beyond all that is
    compared: it may be one of something else, or of none; otherwise 0."""
    core, p = engine.problem.axis_model(best.effects).effective_core, engine.problem
    if not isinstance(core, Oscillator) or not _core_is_identified(engine) \
            or core.natural_frequency_hz < _end_of_band_hz(p):
        return 0.0
    return own_delay_s(core)


def _acausal(engine, best, stds):
    """Links beside a lead, which takes back what they say too much."""
    p = engine.problem
    links = {cause: effect for cause, effect in _filters(engine, best).items()
             if not effect.restates_core}
    own = [cause for cause, effect in links.items() if not effect.of_reference]
    effects = p.axis_model(best.effects).effects
    # by the stamps, or by the numbers of the samples: either may be when they were taken
    delay = sum(effect.pure_delay_s() for effect in effects if not effect.of_reference) \
        - min(p.record.lag_s, 0.0)
    std = max((each.get("delay_s", 0.0) for each in stds.values()), default=0.0)
    if len(own) >= 2 and delay < 0 and delay <= -_ACAUSAL * std:
        return dict.fromkeys(own, f"together they come to a delay of {delay:.3g} s, which no "
                                  "sensor has: they imitate something else")
    odd = [cause for cause, effect in best.effects.items()
           if cause not in engine.search.base and not effect.everyday
           and type(effect).change_core is not Effect.change_core]
    if odd and delay < 0 and -delay > max(_ACAUSAL * std, 0.5 / p.rate):
        leading = [cause for cause in own if best.effects[cause].pure_delay_s() < 0]
        if leading:
            return dict.fromkeys([*leading, *odd], f"a lead of {-delay:.3g} s beside another core: "
                                 "no sensor has it; they imitate something else")
    within = {cause: words for cause in links
              if (words := within_own_delay(engine, best, best.effects[cause]))}
    if within:
        return within
    # the reference's delay is a lead of the sensor, and so is a delay of its own below zero
    ahead = {cause: -effect.pure_delay_s() for cause, effect in best.effects.items()
             if effect.pure_delay_s() < 0}
    late = {cause: lead for cause, lead in ahead.items()
            if cause in links and links[cause].of_reference}
    if not ahead:
        return {}
    lead = max(ahead.values())
    # a digital filter of some samples delays by less than the one of its length in continuous time
    # and a clear peak is no smooth filter's
    own = [cause for cause in own if cause not in ahead
           and not 0 < _damping(best.effects[cause]) < _CLEAR_PEAK]
    digital = not _leads_less(engine, best, lead)
    strange = [cause for cause in own if not best.effects[cause].everyday and not (
        digital and lead < min(best.effects[cause].pure_delay_s(), 1 / p.rate))]
    # a high-pass has nothing that a lead would take back, where another filter has
    strange = [cause for cause in strange if not leads(best.effects[cause])] or strange
    if lead >= _NO_LEAD / p.rate and strange and not is_reference_late(p, best.effects):
        return dict.fromkeys([*ahead, *strange], f"a lead of {lead:.3g} s, which only a fit beside "
                             "a filter shows: together they imitate something else")
    return {cause: f"a lead of {lead:.3g} s beside a filter, less than a sampling interval: a "
                   "digital filter has one of its own"
            for cause, lead in late.items() if own and lead < 1 / p.rate} | {
        cause: _LEAST.format(lead) for cause, lead in late.items() if lead < _NO_LEAD / p.rate}


def _leads_less(engine, best, lead):
    """Whether as many causes with a filter describe the record as well beside a smaller lead."""
    return any(fit.problem is best.problem and not fit.rough and fit.cost <= best.cost
               and len(fit.causes) <= len(best.causes) and _filters(engine, fit)
               and 0 < max(-effect.pure_delay_s() for effect in fit.effects.values()) < lead
               for fit in engine.search.fits.values() if fit is not best)
