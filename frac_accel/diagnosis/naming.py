"""Which names stand in the end, and the model of these alone."""

import contextlib
import dataclasses

import numpy as np
from scipy.special import expit

from ..errors import FracAccelError
from ..model import is_link
from ..model.effects import IDENTIFIED, fault_of_reference
from ..model.effects.base import OFFSET
from ..model.parameters import fixed_values, parameter_fields
from ..shown import listed
from .courses import with_level
from .doubts import by_what_is_left, left_open
from .doubts.delays import least_lead, within_own_delay
from .doubts.imitations import resembles, stands_in_its_band
from .engine import WEIGHS
from .experiments import separating_experiment
from .finding import Finding
from .gain import gain
from .search import acts_as_filter
from .words import gain_words

# Share of the baseline's excess power that may be left where causes are named.
_LEFT = 0.03
# The same where that is no more than this share of what is left, of which the budget sees nothing.
_LEFT_UNSEEN, _UNSEEN = 0.1, 0.03
# Largest deviation of a named cause's strength in parts of a record that holds something else too.
_STEADY = 0.2
# Share of what each named cause takes (RMS) up to which another one is minor; of a filter, which
# may mend what a named one lacks.
_MINOR, _MINOR_FILTER = 0.1, 0.05
# Share of what comes across (RMS) that is a constant beside which the zero is fitted.
_BROUGHT = 0.5
# Share by which a parameter may move when what is only suspected is left out.
_OTHERS = 0.25
# The same of a filter beside which nothing else acts in its band.
_STAYS = 0.05
# Standard uncertainties by which two fits must differ for a parameter to be as open as that.
_OPEN_FROM = 2.0
# Standard uncertainties from the model's own value by which a parameter has moved.
_MOVED = 5.0


def constants_of(effects):
    """Causes of some effects that are a common constant: in doubt, it has no name, but it stays.

    Without it gravity bends the gain, and that the rest.
    """
    return {cause for cause, effect in effects.items()
            if effect.everyday and effect.stage == OFFSET}


def suspect(causes, margin, reason):
    """Causes that are not named, as a result has them."""
    return {"causes": sorted(causes), "margin": float(margin), "reason": reason,
            "experiment": separating_experiment(causes)}


def as_open(finding, other, beside):
    """A finding whose parameters are as uncertain as another fit of its cause makes them, `beside`
    something else, in words: both ends of a uniform distribution (JCGM 100:2008, 4.3.7)."""
    std, words = dict(finding.std), []
    for field in parameter_fields(type(finding.effect)):
        name, here = field.name, getattr(finding.effect, field.name)
        away = abs(getattr(other, name) - here) if name in std else 0.0
        if away > _OPEN_FROM * std.get(name, np.inf):
            std[name] = float(np.hypot(std[name], away / np.sqrt(3)))
            words.append(f"{name} is {getattr(other, name):.4g} {field.metadata['unit']} with "
                         f"{beside}")
    return dataclasses.replace(finding, std=std, evidence=[*finding.evidence, *words])


def open_by_suspects(findings, fitted, wider):
    """Findings, of which filters are as uncertain as others make them that have no name, in fits
    that have these as well and leave less: each may do a part of what the other does."""
    for fit in wider:
        more = [cause for cause in fit.causes - fitted.causes
                if acts_as_filter(fit.effects[cause])]
        if more and fit.cost < fitted.cost:
            findings = [as_open(f, fit.effects[f.cause], _as_well(more))
                        if acts_as_filter(f.effect) and _is_alike(f, fit.effects.get(f.cause))
                        else f for f in findings]
    return findings


def open_by_one_suspect(engine, findings, fitted, suspects):
    """Findings as uncertain as one suspect more makes them, where that describes the record clearly
    better: whatever it is that it stands for has no name, but bends what has one."""
    known = {cause for each in suspects for cause in each["causes"]} - fitted.causes
    beside = [engine.search.fits.get(fitted.causes | {cause}) for cause in sorted(known)]
    wider = min((fit for fit in beside if fit and fit.problem is fitted.problem and not fit.rough
                 and fitted.cost - fit.cost > engine.threshold(fit)),
                key=lambda fit: fit.cost, default=None)
    if wider is None:
        return findings
    return [as_open(f, wider.effects[f.cause], _as_well(wider.causes - fitted.causes))
            if f.cause in fitted.causes and f.effect == fitted.effects[f.cause]
            and fixed_values(f.effect) == fixed_values(wider.effects[f.cause]) else f
            for f in findings]


def _as_well(causes):
    return f"{listed(sorted(causes))}, which may be there as well"


def _is_alike(finding, other):
    """Whether another fit's effect is the same cause with other parameters, and nothing else."""
    return other is not None and all(
        abs(getattr(other, name) - getattr(finding.effect, name))
        < _OTHERS * abs(getattr(finding.effect, name)) for name in finding.std)


def sure(engine, best, findings, tied, left, fraction):
    """The findings that stand where something is left; the model of these alone, with its
    uncertainties; and the others as suspects."""
    doubtful = set()
    most = _LEFT_UNSEEN if left.share < _UNSEEN and not engine.structure(best) else _LEFT
    if left.share > 0:
        # something is left, which the causes may have been bent by, or mistaken for
        doubtful = {f.cause for f in findings if f.cause in best.effects
                    and not engine.stands_among_slow(best, f.cause, f.gain.taken)
                    and (engine.unsteadiness(best, f.cause) > _STEADY or fraction > most
                         and not engine.stands_in_its_kind(best, f.cause, f.gain.taken))}
    fitted, stds, dropped = refitted(engine, best, {f.cause for f in findings} - doubtful, tied)
    findings = [f for f in findings if f.cause not in doubtful and f.cause not in dropped]
    fitted, stds = _with_identified(engine, best, fitted, stds)
    if fitted.causes != best.causes:
        findings = [dataclasses.replace(f, effect=fitted.effects[f.cause], std=stds[f.cause])
                    if f.cause in fitted.effects else f for f in findings]
    words = {**dict.fromkeys(sorted(doubtful), "too much is left that it does not explain"),
             **dropped}
    return findings, fitted, stds, [suspect({cause}, 0.0, why) for cause, why in words.items()]


def _with_identified(engine, best, fitted, stds):
    """A fit with what was identified beside the core, or is common in the best set, where that
    predicts held-out data better, named or not; and its uncertainties.

    What is named is not bent by it: beside an odd cause only what that would be bent by without
    it, a constant where there is gravity, and, whatever it gains, a delay where a clock is off: two
    clocks never start together.
    """
    p, delay = engine.problem, IDENTIFIED["delay_s"](0.0)
    common = {**engine.identified,
              **{cause: best.effects[cause] for cause in constants_of(best.effects)}}
    needed = constants_of(common)
    odd = [cause for cause in fitted.causes - engine.search.base.keys()
           if not fitted.effects[cause].everyday]
    effects = fitted.effects.values()
    if any(effect.clock_ratio() != 1 or effect.time_steps() for effect in effects) \
            and not any(delay.cause in (effect.cause, effect.mirrors) for effect in effects):
        # with the orders of filters that were found without it
        with contextlib.suppress(FracAccelError):
            fitted = engine.search.to_its_best(
                engine.search.again({delay.cause: delay, **fitted.effects}))
            stds = engine.uncertainties(fitted)
    more = {cause: effect for cause, effect in common.items() if cause not in fitted.effects
            and (not odd or cause in needed)}
    if not more:
        return fitted, stds
    wider = engine.search.to_its_best(engine.search.fit({**more, **fitted.effects}))
    better = gain(*((p.measured - engine.learnt(fit).output)[engine.held_out_rows]
                    for fit in (fitted, wider)))
    return (wider, engine.uncertainties(wider)) if better.is_relevant else (fitted, stds)


def _are_minor(engine, best, missing, named):
    """Whether causes without a name take little beside each named one of a set that leaves nothing
    that stands out: what they stand for is no reason to doubt the others."""
    if engine.left_beside_noise(best).share > 0 or engine.structure(best):
        return False
    least = min(engine.takes(best, cause) for cause in named)
    return all(engine.takes(best, cause)
               < (_MINOR_FILTER if is_link(best.effects[cause]) else _MINOR) * least
               for cause in missing)


def _stays(engine, best, fitted, cause):
    """Whether a filter is the same without what is only suspected, and stands far out of all that
    is left beside that in its own band: what is missing acts elsewhere."""
    one, other = best.effects[cause], fitted.effects[cause]
    return is_link(one) and stands_in_its_band(engine, best, cause) and all(
        abs(getattr(other, unknown.name) - getattr(one, unknown.name))
        < _STAYS * abs(getattr(one, unknown.name))
        for unknown in best.unknowns if unknown.cause == cause)


def _with_zero(engine, best, named):
    """A fit with a zero of its own, where a named cause says of one what another may do."""
    zero = IDENTIFIED["offset"](0.0)
    if zero.cause in best.effects or not any(_says_a_zero(engine, best, c) for c in named):
        return best
    return engine.search.to_its_best(engine.search.fit({zero.cause: zero, **best.effects}))


def _says_a_zero(engine, best, cause):
    """Whether a cause changes the zero, which begins anywhere, or brings a constant of other axes,
    such as gravity, which a zero may do as well."""
    effect = best.effects[cause]
    if not effect.mixes_axes:
        return bool(effect.adds) and not effect.everyday
    brought = engine.added(best, cause)
    return abs(brought[engine.problem.used].mean()) >= _BROUGHT * engine.rms(brought)


def refitted(engine, best, named, tied):
    """The causes that are named, fitted without the others; their uncertainties; and, in words,
    those that are no longer to be named then.

    What is not named is not in the model. Where the others are only `tied` with rivals (sets by
    cause) in which the named ones are the same, these stay as they are: with neither, they would
    be bent. What is minor beside them stays in the model where all is said with it.
    """
    base, named, dropped = engine.search.base.keys(), named & best.effects.keys(), {}
    fitted = best = _with_zero(engine, best, named)
    stds = known = engine.uncertainties(best)
    constant = constants_of(best.effects) - base
    missing = best.causes - base - named - constant
    if named and missing and missing <= tied.keys() and all(
            engine.agrees(best, stds, named, engine.search.fits.get(tied[cause]))
            for cause in missing):
        kept = {c: e for c, e in best.effects.items() if c not in missing}
        return engine.problem.fit(kept, held=kept), stds, {}
    if named and missing and _are_minor(engine, best, missing, named):
        return best, stds, {}
    while True:
        if named | constant != fitted.causes - base:
            fitted = engine.search.to_its_best(engine.search.fit(
                {c: e for c, e in best.effects.items() if c in named | constant or c in base}))
            stds = engine.uncertainties(fitted)
            added = {c: engine.added(fitted, c) for c in named & fitted.causes}
            takes = {c: engine.rms(change) for c, change in added.items()}
            found = {**{c: words for c, words in by_what_is_left(
                engine, fitted, takes, engine.left_beside_noise(fitted)).items()
                if not _stays(engine, best, fitted, c)},
                     **with_level(engine, fitted, added),
                     **left_open(engine, fitted, stds, takes),
                     **{c: "without what is only suspected its parameters are others"
                        for c in takes if not engine.agrees(best, known, [c], fitted, _OTHERS)},
                     **dict.fromkeys(named - fitted.causes, "beside the others that are found the "
                                     "model's motion grows without bound")}
        elif named and not engine.predicts_better(fitted):
            found = dict.fromkeys(named, "the causes that are found predict held-out data no "
                                         "better than the model in use describes them")
        else:
            return fitted, stds, dropped
        named, dropped = named - found.keys(), {**dropped, **found}


def moved(engine, best, stds, doubt):
    """Findings among the causes that were free: farther from the model than it allows for; and
    those in doubt, with words: all of them where there is a `doubt` already."""
    findings, doubtful = [], {}
    for cause, entry in engine.loose.items():
        effect = best.effects.get(cause)
        if effect is None:
            continue  # another cause stands in its place
        farthest = max(abs(getattr(effect, name) - getattr(entry.effect, name))
                       / np.hypot(std, stds[cause].get(name, 0.0))
                       for name, std in entry.std.items())
        if farthest < _MOVED:
            continue
        rows = engine.held_out_rows
        error = (engine.problem.measured - best.output)[rows]
        try:
            held = engine.problem.simulate({**best.effects, cause: entry.effect})
        except FracAccelError:
            continue
        g = gain(error + (best.simulated - held)[rows], error)
        if not g.is_relevant or g.taken < WEIGHS * engine.unexplained(best):
            continue
        words = doubt or resembles(engine, best, effect, g.taken) \
            or within_own_delay(engine, best, effect) or least_lead(engine, best, effect)
        other = None if words or not entry.is_known else \
            engine.instead_of_moved(best, entry.effect)
        if other:
            words = f"{other} explains more"
        mirror = fault_of_reference(effect)  # what no sensor can do
        if words:
            doubtful[(mirror or effect).cause] = words
        else:
            findings.append(Finding(mirror or effect, stds[cause], confidence(farthest**2), [
                cause] if mirror else [], [
                f"{farthest:.3g} standard uncertainties from the model's own value",
                *gain_words(cause, g, np.inf, [])], g))
    return findings, doubtful


def remaining(engine, fitted, noise_rms):
    """Share of the power that the model in use leaves beyond the noise which is still left."""
    count = engine.problem.count
    excess = max(engine.search.baseline.cost / count - noise_rms**2, 0.0)
    return max(fitted.cost / count - noise_rms**2, 0.0) / excess if excess > 0 else 0.0


def confidence(margin):
    """That of a lead by so many variances of the noise."""
    return float(expit(margin / 2))


def rms_of(error, rows):
    """RMS of some rows."""
    return float(np.sqrt(np.mean(error[rows]**2)))
