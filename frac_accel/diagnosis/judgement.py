"""From fitted causes to a verdict: what is named, what is not, and why."""

import contextlib
import dataclasses
from typing import NamedTuple

import numpy as np
from scipy.special import expit

from ..errors import FracAccelError
from ..identification.fit.uncertainty import beyond_noise, noise_floor
from ..model import AXES, AxisModel, SensorModel, is_link
from ..model.core import Oscillator
from ..model.effects import IDENTIFIED, effect_of, fault_of_reference, known_effects
from ..model.effects.base import OFFSET
from . import courses
from .doubts import (
    by_what_is_left,
    delay_of_unseen_core,
    doubts_about,
    least_lead,
    left_open,
    most_is_left,
    own_delay_s,
    resembles,
    within_own_delay,
)
from .empirical import fit_empirical_link
from .empirical_map import fit_empirical_map
from .engine import WEIGHS
from .evidence import Evidence
from .experiments import separating_experiment
from .finding import Diagnosis, Finding
from .gain import certainty, gain
from .own_core import in_own_core
from .read_off import read_off
from .words import (
    AS_NOISE,
    ahead_words,
    description_words,
    gain_words,
    hidden_words,
    hides_much,
    hint_words,
    is_accounted,
    reason_of,
    set_aside,
    verdict_of,
)

# Times that another set is looked for in which no cause is doubtful.
_AGAIN = 2
# Doubtful causes that are left out one after the other before another set is looked for.
_WEAKEST = 2
# Verdicts that leave something to be described.
_INCOMPLETE = ("unexplained", "partly_explained")
# Share of the baseline's excess power that may be left where causes are named.
_LEFT = 0.03
# Largest deviation of a named cause's strength in parts of a record that holds something else too.
_STEADY = 0.2
# Margin, in variances of the noise, by which a cause must beat its nearest rival.
_CLEAR = 10.0
# Where nothing shows that what is left is noise, share of its power by which it must beat it.
_NEARLY = 0.05
# Share of what the largest cause takes (RMS) that a common one must take to be named for that.
_COMMON = 0.1
# Share of the error that all else leaves up to which what is only suspected describes a record.
_CLEARLY = 0.9
# Times as much of the held-out data (RMS) as the model in use leaves, that names must not leave.
_MISLED = 1.1
# Share of what is left (power) that may be no noise in a record that counts as consistent, where so
# little is left that it need not be noise; more of it where that is such a share of the output
# (RMS) at most.
_HINT, _MUCH, _UNSEEN = 0.1, 0.3, 0.005
# Parts of it that this holds for: tones, bursts and what wanders are no hint of anything.
_OF_MOTION = ("linear", "across", "even", "odd", "time_varying")
# Share of what each named cause takes (RMS) up to which another one is minor; of a filter, which
# may mend what a named one lacks.
_MINOR, _MINOR_FILTER = 0.1, 0.05
# Share by which a parameter may move when what is only suspected is left out.
_OTHERS = 0.25
# Standard uncertainties from the model's own value by which a parameter has moved.
_MOVED = 5.0


def judge(engine, best, found, shown, noise_std=None):
    """Verdict on the best set of causes.

    Parameters
    ----------
    engine : Engine
    best : Fitted
    found : Integrity
    shown : dict of str to Effect
        Causes that the record shows by itself.
    noise_std : float, optional
        Standard deviation of the noise, where somebody states it [output units].

    Returns
    -------
    Diagnosis
    """
    known, doubted, widest = {}, {}, best
    if engine.part:
        shorter, doubted = _settled(engine.part, best, noise_std)
        engine.part.best = shorter.best
        known = {cause: g for cause, g in shorter.gains.items() if cause not in shorter.doubts}
        doubted |= shorter.doubts
        best = engine.whole({cause: effect for cause, effect in shorter.best.effects.items()
                             if cause not in shorter.doubts})
    settled, more = _settled(engine, best, noise_std, known)
    best, gains, left, noise, stds, doubts = settled
    doubted |= more
    findings, tied = [], {}
    nearly = 0.0 if engine.is_accounted(best, noise) else _NEARLY
    suspects = [_suspect({cause}, 0.0, words) for cause, words in doubted.items()]
    most = max((g.taken for g in gains.values()), default=0.0)
    for cause, g in gains.items():
        mirror = best.effects[cause].mirrors
        rivals = [(margin, causes) for margin, causes in engine.rivals(best, cause)
                  # what cannot be named does not stand in the way of what can
                  if (not mirror or mirror not in causes) and not causes & doubted.keys()]
        alone = engine.stands_alone(best, cause, g.taken)
        margin, other = (np.inf, frozenset()) if alone or not rivals else rivals[0]
        clear = max(_CLEAR, nearly * engine.comparing(cause).problem.count)
        instead = sorted(other - best.causes)
        entry = Finding(best.effects[cause], stds[cause],
                        certainty(g) if alone else _confidence(margin * _CLEAR / clear),
                        [*(instead if margin < 10 * _CLEAR else []), *([mirror] if mirror else [])],
                        gain_words(cause, g, margin, instead), g)
        if cause in doubts:
            suspects.append(_suspect({cause}, 0.0, doubts[cause]))
        elif margin > clear or (
                best.effects[cause].everyday and instead and g.taken > _COMMON * most
                and margin > -clear / 2
                and not any(effect_of(name).everyday for name in instead)):
            # of two that say the same, what is common; not what may only mend what another lacks
            findings.append(entry)
        else:
            suspects.append(_suspect({cause, *instead}, margin, "another cause explains as much"))
            tied[cause] = other
    return _verdict(engine, best, widest, left, findings, suspects, tied, found, noise,
                    lambda fitted: read_off(engine, fitted, found, shown))


def _constants(effects):
    """Causes of some effects that are a common constant: in doubt, it has no name, but it stays.

    Without it gravity bends the gain, and that the rest.
    """
    return {cause for cause, effect in effects.items()
            if effect.everyday and effect.stage == OFFSET}


class Examined(NamedTuple):
    """A set of causes with all that its judgement rests on."""

    best: object
    gains: dict
    left: object
    noise: object
    stds: dict
    doubts: dict


def _settled(engine, best, noise_std, known=None):
    """A set in which as little as possible is doubtful, and what was dropped for it, in words.

    Parameters
    ----------
    known : dict of str to Gain, optional
        Causes that a part of the record has shown already, with their gains there.
    """
    known = known or {}
    here = _examined(engine, best, noise_std, known)
    here, dropped = _without_the_weakest(engine, _instead_of_idle(
        engine, best, here, noise_std, known), noise_std, known)
    there, gone = here, {}
    for _ in range(_AGAIN):
        # what cannot be named must not stand in the way of what can
        unwanted = {cause for cause in there.doubts.keys() - _constants(there.best.effects)
                    if cause not in engine.uncontested}
        # what is common may be in doubt only for its odd company
        unwanted = {cause for cause in unwanted
                    if not there.best.effects[cause].everyday} or unwanted
        if not unwanted:
            break
        gone |= {cause: there.doubts[cause] for cause in unwanted}
        there = _examined(engine, engine.instead(there.best, unwanted), noise_std, known)
        # one that is doubtful, too, may lead to another that is not
        if not there.doubts.keys() - _constants(there.best.effects):
            if there.gains.keys() - here.gains.keys():
                here, dropped = there, {**dropped, **gone}
            break
    core = engine.core(here.best) if here.doubts else None
    if core:
        there = _examined(engine, core, noise_std, known)
        # what is certain already stays
        if there.gains and not there.doubts \
                and here.gains.keys() - here.doubts.keys() <= there.gains.keys():
            dropped.update({cause: words for cause, words in here.doubts.items()
                            if cause not in there.gains})
            here = there
    if here.doubts:
        standing = here.gains.keys() - here.doubts.keys()
        gone = {**here.doubts, **_refitted(engine, here.best, standing, {})[2]}
        # an offset is one whatever else is not understood
        there = None if standing - gone.keys() else \
            _examined(engine, engine.everyday(), noise_std, known)
        if there and there.gains.keys() - there.doubts.keys():
            dropped.update({cause: words for cause, words in gone.items()
                            if cause not in there.gains})
            here = there
    return here, dropped


def _instead_of_idle(engine, best, here, noise_std, known):
    """A set in the place of one that describes the record, but not what its fit has not seen, if
    it does and nothing in it is in doubt; else the set as it is."""
    there, fit, idle = here, best, set()
    for _ in range(_AGAIN):
        idle |= fit.causes - there.best.causes
        if not idle or there.best.cost - fit.cost <= engine.threshold(fit):
            break
        fit = engine.instead(fit, idle)
        there = _examined(engine, fit, noise_std, known)
        if there.gains.keys() > here.gains.keys() and not there.doubts:
            return there
    return here


def _without_the_weakest(engine, here, noise_std, known):
    """A set less its weakest doubtful causes, up to two, where nothing is doubtful then, and what
    was dropped, in words; else the set as it is."""
    there, dropped = here, {}
    # more do not become clear by leaving out two
    for _ in range(_WEAKEST if len(here.doubts) <= _WEAKEST + 1 else 0):
        # what comes into doubt only without another one stays
        doubtful = (there.doubts.keys() & here.doubts.keys()) - engine.uncontested \
            - _constants(there.best.effects)
        if not doubtful or len(there.gains) < 2 or engine.problem.limit.ends_search(
                "the weakest doubtful causes were not left out first"):
            break
        weakest = min(doubtful, key=lambda cause: there.gains[cause].taken)
        dropped[weakest] = there.doubts[weakest]
        there = _examined(engine, engine.search.without(there.best, weakest), noise_std, known)
        # a smaller set does not understand more
        named = there.gains.keys() - there.doubts.keys()
        if named and not there.doubts.keys() - _constants(there.best.effects) \
                and min(there.gains[cause].taken for cause in named) \
                > WEIGHS * engine.unexplained(here.best):
            return there, dropped
    return here, {}


def _examined(engine, best, noise_std, known):
    best = engine.plainer(best, not engine.structure(best) and engine.is_accounted(
        best, engine.established_noise(best, noise_std)))
    best, gains = _relevant(engine, _mirrored(engine, best), known)
    turned = _mirrored(engine, best)
    if turned is not best:
        best, gains = _relevant(engine, turned, known)
    best = engine.search.to_its_best(best)
    left = engine.left(best)
    noise = engine.established_noise(best, noise_std)
    stds = engine.uncertainties(best)
    judged = {cause: g for cause, g in gains.items() if cause not in known}
    return Examined(best, gains, left, noise, stds,
                    doubts_about(engine, best, judged, stds, left, noise))


def _relevant(engine, best, known):
    """A fit without the causes that explain nothing of held-out data, and the gains of the rest."""
    base = engine.search.base
    while True:
        gains = {cause: known[cause] if cause in known else engine.held_out(best, cause)
                 for cause in best.effects if cause not in base}
        idle = [cause for cause, g in gains.items() if not g.is_relevant]
        if not idle:
            return best, gains
        less = engine.search.without(best, min(idle, key=lambda cause: gains[cause].reduction))
        best = engine.search.fit(less.effects)


def _mirrored(engine, best):
    """The same set with causes that say the same with the other sign, where these are as good."""
    for cls in known_effects().values():
        cause = cls.mirrors
        if cause in best.effects and cause not in engine.search.base \
                and cls.mirrored(best.effects[cause]) is not None:
            # fitted, unless it is known
            engine.search.fit_from({**{c: e for c, e in best.effects.items() if c != cause},
                                    cls.cause: cls.mirrored(best.effects[cause])})
    for fit in engine.search.fits.values():
        turned = [effect.mirrors for cause, effect in fit.effects.items()
                  if cause not in best.effects]
        if turned and set(turned) == best.causes - fit.causes - set(engine.search.base) \
                and fit.cost - best.cost < _CLEAR * best.cost / engine.problem.count:
            return fit
    return best


def _suspect(causes, margin, reason):
    return {"causes": sorted(causes), "margin": float(margin), "reason": reason,
            "experiment": separating_experiment(causes)}


def _once_each(suspects):
    """Suspects without those that have been told for another reason."""
    first = {tuple(each["causes"]): each for each in reversed(suspects)}
    return [each for each in suspects if first[tuple(each["causes"])] is each]


def _verdict(engine, best, widest, left, likely, doubted, tied, found, noise, shown_by):
    fraction = _remaining(engine, best, left.noise_rms) if left.share > 0 else 0.0
    findings, fitted, stds, more = _sure(engine, best, likely, tied, left, fraction)
    suspects = doubted + more
    unnamed = sorted(fitted.causes - {f.cause for f in findings} - engine.search.base.keys())
    complete = fitted.causes >= best.causes
    if not complete:
        fraction = _remaining(engine, fitted, left.noise_rms)
    # beside the model as it is in the end, not beside one with what is only suspected
    away, near = _moved(engine, fitted, stds, most_is_left(engine, left, noise))
    drifts, other_course = courses.findings(engine, fitted, stds)
    suspects += [_suspect({cause}, 0.0, words) for cause, words in (near | other_course).items()]
    unnamed += sorted(other_course)
    findings = [*findings, *away, *drifts, *shown_by(fitted)]
    # what was in doubt in a part of the record, or beside something else, is no suspect any more
    suspects = [each for each in suspects
                if not {f.cause for f in findings}.issuperset(each["causes"])]
    if any(f.effect.goes_with_size for f in findings):
        left = dataclasses.replace(left, level_score=0.0)
        fraction = fraction if left.share > 0 else 0.0
    account = _account(engine, fitted, findings, noise)
    bare = engine.search.baseline
    if not findings and (fitted.cost > bare.cost or account.after > account.before):
        # a core alone, left to err where its record begins, may leave more than the model in use,
        # and so may a constant without a name of what it was not fitted to
        fitted, stds, unnamed = bare, engine.uncertainties(bare), sorted(other_course)
        account = _account(engine, fitted, findings, noise)
    strange = engine.structure(fitted)
    # beside a model that leaves nothing that stands out, what is only suspected is chance, and a
    # hint of structure in what is left is no reason to call the record unexplained
    hint = max(engine.left(fitted).share, sum(share for share, _ in strange))
    unrelated = [part for _, part in strange if part not in _OF_MOTION]
    small = hint < _HINT or hint < _MUCH and np.sqrt(hint) * account.share < _UNSEEN
    plain = all(f.effect.read_off for f in findings) and not unrelated and (
        hint == 0 or account.accounted and small)
    verdict = verdict_of(
        findings, [] if plain else suspects, complete, 0.0 if plain else left.share,
        fraction, account.accounted, (strange and not plain) or account.faulty)
    beyond = engine.record.beyond(engine.problem.axis)
    if verdict == "consistent" and hides_much(beyond):
        verdict = "undecided"
    described, names, kept, after, output = {}, [], {}, account.after, None
    if verdict in _INCOMPLETE or (strange and not plain):
        described, names, after, output = _described(
            engine, fitted, after, {part for _, part in strange}, {f.cause for f in findings})
        wider, known, after, output = _kept(engine, fitted, widest, after, output)
        if wider is not None:
            # named causes are what they are in the model that is written
            kept = wider.effects
            findings = [_as_kept(f, kept, known) for f in findings]
    misled = {f.cause for f in likely} & {f.cause for f in findings} & fitted.causes
    if misled and _misleads(after, account.own, account.before):
        why = "without what is only suspected, the model with it leaves more of the " \
              "held-out data than the model in use"
        return _verdict(
            engine, best, widest, left, [f for f in likely if f.cause not in misled],
            doubted + [_suspect({cause}, 0.0, why) for cause in sorted(misled)], tied, found,
            noise, shown_by)
    named = {f.cause: f.effect for f in findings}
    effects, late = _of_reference(engine, {**fitted.effects, **named, **(kept or described)}, named)
    model = _extended(engine, effects, _stated(engine.problem, fitted, after / account.spread))
    p, spread = engine.problem, account.spread
    floor = _noise_floor(left, noise, account)
    if verdict == "consistent":
        fraction = 0.0  # nothing asks for an explanation
    elif floor < left.noise_rms:
        fraction = _remaining(engine, fitted, floor)
    # a model that has the limits leaves nothing there
    at_limit = engine.at_limit if any(f.effect.read_off for f in findings) else None
    rest = engine.budget(fitted, at_limit) if output is None else \
        engine.budget_between(p.measured, output, p.record.valid)
    findings = [_beside_unseen_core(f, delay_of_unseen_core(engine, fitted)) for f in findings]
    more = [*engine.words_of_budget, *(noise.words if noise.rms is None else ())]
    found.words.extend(words for words in more if words not in found.words)
    if p.in_own_core:
        model, findings = in_own_core(model, findings, p.in_own_core, AXES[p.axis])
    return Diagnosis(
        verdict, reason_of(verdict, account.share, noise, account.accounted, strange, beyond)
        + set_aside(engine.aside, engine.drowned, engine.record.valid)
        + description_words([] if kept else names, unnamed,
                            sorted(kept.keys() - fitted.causes), after / spread)
        + hint_words(hint if plain and not strange else 0.0)
        + hidden_words(account.own, account.error) + late + _ahead(p, effects, named),
        {"rmse": account.before, "nrmse": account.before / spread,
         "noise_rms": floor or left.noise_rms},
        findings, _once_each(suspects),
        {"rmse": after, "nrmse": after / spread},
        _by_itself(findings, fitted, floor, fraction) if verdict == "explained"
        else float(min(fraction, 1.0)), model, found,
        Evidence.of(engine, best, fitted, named),
        noise.as_dict(), p.limit.summary(),
        [*engine.budget(engine.search.baseline).as_list("baseline"),
         *rest.as_list("extended")])


def _beside_unseen_core(finding, delay_s):
    """A finding whose delay is as uncertain as one that the core has, and may not have, makes it.

    Both ends of a uniform distribution (JCGM 100:2008, 4.3.7).
    """
    if not delay_s or is_link(finding.effect) or not finding.effect.pure_delay_s():
        return finding
    std = {**finding.std, "delay_s": float(np.hypot(finding.std["delay_s"], delay_s / np.sqrt(3)))}
    return dataclasses.replace(finding, std=std, evidence=[
        *finding.evidence, f"the core resonates beyond all that is compared: of its own delay, "
                           f"{delay_s:.3g} s, as much may belong here"])


def _stated(problem, fitted, nrmse):
    """Noise [output units] and error of the extended model, as a model file states them."""
    noise = noise_floor(np.where(problem.used, fitted.residual, np.nan))
    error = beyond_noise(nrmse, noise / float(np.std(problem.measured[problem.used])))
    return {"noise_std": noise, **({"model_error": error} if error else {})}


def _noise_floor(left, noise, account):
    """RMS of what counts as noise of what is left [output units]: what no test tells from noise,
    unless established noise is clearly less; none where nothing shows that so much is noise."""
    if noise.rms is None:
        return left.noise_rms if account.accounted else 0.0
    known = float(np.hypot(noise.rms, account.own))
    return left.noise_rms if left.noise_rms <= AS_NOISE * known else known


def _remaining(engine, fitted, noise_rms):
    """Share of the power that the model in use leaves beyond the noise which is still left."""
    count = engine.problem.count
    excess = max(engine.search.baseline.cost / count - noise_rms**2, 0.0)
    return max(fitted.cost / count - noise_rms**2, 0.0) / excess if excess > 0 else 0.0


def _by_itself(findings, fitted, noise_rms, fraction):
    """Share of the error's power above the noise that is left where all is explained; where no fit
    counts it, such as at a limit, by what the record shows by itself."""
    if findings and not any(f.cause in fitted.effects for f in findings):
        g = max((f.gain for f in findings), key=lambda g: g.before)
        after, before = (max(rms**2 - noise_rms**2, 0.0) for rms in (g.after, g.before))
        fraction = after / before if before else 0.0
    return float(min(fraction, 1.0))


def _sure(engine, best, findings, tied, left, fraction):
    """The findings that stand where something is left; the model of these alone, with its
    uncertainties; and the others as suspects."""
    doubtful = set()
    if left.share > 0:
        # something is left, which the causes may have been bent by, or mistaken for
        doubtful = {f.cause for f in findings if f.cause in best.effects
                    and not engine.stands_alone(best, f.cause, f.gain.taken)
                    and (fraction > _LEFT or engine.unsteadiness(best, f.cause) > _STEADY)}
    fitted, stds, dropped = _refitted(engine, best, {f.cause for f in findings} - doubtful, tied)
    findings = [f for f in findings if f.cause not in doubtful and f.cause not in dropped]
    fitted, stds = _with_identified(engine, best, fitted, stds)
    if fitted.causes != best.causes:
        findings = [dataclasses.replace(f, effect=fitted.effects[f.cause], std=stds[f.cause])
                    if f.cause in fitted.effects else f for f in findings]
    words = {**dict.fromkeys(sorted(doubtful), "too much is left that it does not explain"),
             **dropped}
    return findings, fitted, stds, [_suspect({cause}, 0.0, why) for cause, why in words.items()]


def _misleads(after, own, before):
    """Whether a model leaves more of what it has not seen than the model in use did (RMS), beside
    what the reference's own noise, which a better model lets through, puts there."""
    return after**2 - own**2 > (_MISLED * before)**2


class Account(NamedTuple):
    """RMS of the sensor's signal on held-out data (`spread`), and of what is left of it there
    before and after; of what is left there or of the whole record (`error`), whichever is the
    larger share (`share`) of its signal, and of the noise that the reference puts into it (`own`),
    all in output units; whether that is accounted for; and whether it is no longer with the samples
    that were set aside."""

    spread: float
    before: float
    after: float
    error: float
    share: float
    own: float
    accounted: bool
    faulty: bool


def _account(engine, fitted, findings, noise):
    p, rest = engine.problem, engine.held_out_rows
    spread = float(np.std(p.measured[rest]))
    baseline = engine.search.baseline
    before = _rms(p.measured - baseline.output, rest)
    output = (baseline if fitted.causes == baseline.causes else engine.learnt(fitted)).output
    # what the record shows by itself was not fitted; some of it, such as limits, is simulated
    shown = [f for f in findings if f.effect.read_off and f.cause not in fitted.effects]
    for finding in shown:
        simulated = finding.effect.simulate(output, p.simulator(p.axis).circumstances)
        # rounded once more, values that noise or other instants have moved are farther off
        if _rms(p.measured - simulated, rest) < _rms(p.measured - output, rest):
            output = simulated
    after = _rms(p.measured - output, rest)
    by_itself = [f.gain.after for f in shown]
    own = engine.by_reference(fitted)
    # the record is all of it, not only the part that is held out
    errors = p.errors(fitted)
    whole, over = (_rms(errors, engine.wanted & np.isfinite(errors)),
                   float(np.std(engine.record.sensor[engine.wanted, p.axis])))
    error, of = max((after, spread), (whole, over), key=lambda pair: pair[0] / pair[1])
    # what is named may hide all else
    hidden = False if any(f.effect.read_off for f in findings) else engine.silent
    everywhere = _rms(errors, (engine.wanted | engine.aside | hidden) & np.isfinite(errors))

    def is_covered(rms, spread):
        """Whether what the reference's own noise does not make is accounted for."""
        return is_accounted(np.sqrt(max(rms**2 - own**2, 0.0)), spread, noise)
    accounted = is_covered(error, of) or any(is_covered(rms, spread) for rms in by_itself)
    return Account(spread, before, after, error, error / of, own, accounted,
                   accounted and not is_covered(everywhere, over))


def _with_identified(engine, best, fitted, stds):
    """A fit with what was identified beside the core, or is common in the best set, where that
    predicts held-out data better, named or not; and its uncertainties.

    What is named is not bent by it: beside an odd cause only what that would be bent by without
    it, a constant where there is gravity, and, whatever it gains, a delay where a clock is off: two
    clocks never start together.
    """
    p, delay = engine.problem, IDENTIFIED["delay_s"](0.0)
    common = {**engine.identified,
              **{cause: best.effects[cause] for cause in _constants(best.effects)}}
    needed = _constants(common)
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
    if engine.left(best).share > 0 or engine.structure(best):
        return False
    least = min(engine.takes(best, cause) for cause in named)
    return all(engine.takes(best, cause)
               < (_MINOR_FILTER if is_link(best.effects[cause]) else _MINOR) * least
               for cause in missing)


def _refitted(engine, best, named, tied):
    """The causes that are named, fitted without the others; their uncertainties; and, in words,
    those that are no longer to be named then.

    What is not named is not in the model. Where the others are only `tied` with rivals (sets by
    cause) in which the named ones are the same, these stay as they are: with neither, they would
    be bent. What is minor beside them stays in the model where all is said with it.
    """
    base, named, dropped = engine.search.base.keys(), named & best.effects.keys(), {}
    fitted = best
    stds = known = engine.uncertainties(best)
    constant = _constants(best.effects) - base
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
            takes = {c: engine.rms(engine.added(fitted, c)) for c in named & fitted.causes}
            found = {**by_what_is_left(engine, fitted, takes, engine.left(fitted)),
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


def _described(engine, fitted, after, parts, named):
    """What stands for what no cause explains, by cause, with a constant that has no name as it is
    beside it; its words, the held-out error, and the output with it (None without).

    A fitted filter where a part of it is linear, and a fitted curve where one is even or odd.
    """
    p, described = engine.problem, []
    rest, effects, output = engine.held_out_rows, fitted.effects, fitted.output
    constants = _constants(effects) - engine.search.base.keys() - named
    for belongs, words, fit in (
            ({"linear"}, "a fitted filter", lambda output: fit_empirical_link(
                p.measured, output, p.used, rest, p.rate)),
            ({"even", "odd"}, "a fitted curve", lambda output: fit_empirical_map(
                p.measured, output, p.used, rest))):
        # whatever the time limit: it takes a fraction of a second, and a search that was cut needs
        # it most
        if not belongs & parts:
            continue
        try:
            found = fit(output)
            more = {**effects, found.effect.cause: found.effect}
            if constants:  # it makes another level of the motion's mean
                more = p.fit(more, held=more.keys() - constants).effects
            simulated = p.simulate(more)
        except FracAccelError:
            continue
        error = _rms(p.measured - simulated, rest)
        if found.is_worth_it and error < after:
            effects, output, after = more, simulated, error
            described.append(words)
    return ({cause: effect for cause, effect in effects.items()
             if effect is not fitted.effects.get(cause)}, described, after,
            output if described else None)


def _kept(engine, fitted, widest, after, output):
    """Fit of a set with linear causes that are only suspected, where it predicts held-out data
    clearly better than all else that describes them, its standard uncertainties, its held-out error
    and its output; or None, nothing, and those given."""
    p, rest = engine.problem, engine.held_out_rows
    more = {cause: effect for cause, effect in widest.effects.items()
            if cause not in fitted.causes and (is_link(effect) or effect.pure_delay_s()
                                               or effect.is_constant or effect.restates_core)}
    if not more or p.limit.ends_judging("what is only suspected was not kept as a description"):
        return None, {}, after, output
    slow = [effect for effect in {**more, **fitted.effects}.values() if effect.acts_on_slow_motion]
    if len(slow) > 1:
        return None, {}, after, output  # they cancel but for a free motion, which no model can have
    wider = engine.search.to_its_best(engine.search.fit({**more, **fitted.effects}))
    errors = [(p.measured - engine.learnt(fit).output)[rest] for fit in (fitted, wider)]
    error = _rms(p.measured - wider.output, rest)
    better = gain(*errors)
    if not better.is_relevant or engine.hollow(wider) \
            or max(error, _rms(errors[1], slice(None))) > _CLEARLY * after:
        return None, {}, after, output
    stds = engine.uncertainties(wider)
    if left_open(engine, wider, stds,
                 wider.causes & fitted.causes - engine.search.base.keys()):
        return None, {}, after, output
    return wider, stds, error, wider.output


def _of_reference(engine, effects, named):
    """Effects in which what no sensor can do is the reference's, where that is late by the record
    itself and nothing names it; and words."""
    words = ""
    for cause, early in [*effects.items()]:
        fault = fault_of_reference(early)
        if fault is None or cause in named or effects.get(fault.cause, fault) != fault:
            continue
        is_named = fault.cause in named
        if is_named or engine.problem.record.is_reference_late:
            effects = {other: e for other, e in effects.items() if other != cause} \
                | {fault.cause: fault}
            words += "" if is_named else "; what the sensor shows too early stands in the model " \
                f"as {fault.cause}, so that nothing is taken out of its stamps"
    return effects, words


def _as_kept(finding, kept, known):
    """A finding as a fit with more causes has it, if it does."""
    cause = finding.cause if finding.cause in kept else finding.effect.mirrors
    if cause not in kept or cause not in known:
        return finding
    effect = kept[cause] if cause == finding.cause else fault_of_reference(kept[cause])
    return dataclasses.replace(finding, effect=effect or finding.effect, std=known[cause])


def _ahead(problem, effects, named):
    """Words where a model, by a lead that nothing names, answers before the reference moves though
    no stamp shows that to be late."""
    delays = {cause: effect.pure_delay_s() for cause, effect in effects.items()
              if not effect.of_reference}
    if problem.record.is_reference_late or not any(
            delay < 0 and cause not in named for cause, delay in delays.items()):
        return ""
    core = problem.axis_model(effects).effective_core
    own = own_delay_s(core) if isinstance(core, Oscillator) else 0.0
    return ahead_words(problem.record.lag_s - sum(delays.values()) - own, problem.rate)


def _extended(engine, effects, stated):
    """The model in use with these causes on the diagnosed axis, and what is stated of it."""
    p = engine.problem
    own = p.axis_model(effects)
    common = {cause: effect for cause, effect in effects.items() if effect.common_to_axes}
    axes = {name: p.axis_model(common, i) for i, name in enumerate(AXES)}
    axes[AXES[p.axis]] = own
    axes = {name: AxisModel(axis.core, tuple(e for e in axis.effects if not e.of_reference))
            for name, axis in axes.items()}
    return SensorModel(p.baseline.core, p.baseline.effects, axes,
                       {**p.baseline.metadata, **stated},
                       [effect for effect in own.effects if effect.of_reference])


def _rms(error, rows):
    return float(np.sqrt(np.mean(error[rows]**2)))


def _confidence(margin):
    return float(expit(margin / 2))


def _moved(engine, best, stds, doubt):
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
            findings.append(Finding(mirror or effect, stds[cause], _confidence(farthest**2), [
                cause] if mirror else [], [
                f"{farthest:.3g} standard uncertainties from the model's own value",
                *gain_words(cause, g, np.inf, [])], g))
    return findings, doubtful
