"""From fitted causes to a verdict: what is named, what is not, and why."""

import dataclasses
from typing import NamedTuple

import numpy as np
from scipy.special import expit

from ..errors import FracAccelError
from ..model import AXES, AxisModel, SensorModel
from ..model.effects import effect_of
from .doubts import by_what_is_left, doubts_about, left_open, resembles
from .empirical import fit_empirical_link
from .empirical_map import fit_empirical_map
from .engine import WEIGHS
from .evidence import Evidence
from .experiments import separating_experiment
from .finding import Diagnosis, Finding
from .gain import gain
from .read_off import read_off
from .words import gain_words, is_accounted, reason_of, set_aside, verdict_of

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
# Standard uncertainties from the model's own value by which a parameter has moved.
_MOVED = 5.0


def judge(engine, best, found, shown, sensor, noise_std=None):
    """Verdict on the best set of causes.

    Parameters
    ----------
    engine : Engine
    best : Fitted
    found : Integrity
    shown : dict of str to Effect
        Causes that the record shows by itself.
    sensor : Samples
        The sensor's samples as they were recorded.
    noise_std : float, optional
        Standard deviation of the noise, where somebody states it [output units].

    Returns
    -------
    Diagnosis
    """
    known, doubted = {}, {}
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
    findings = []
    p = engine.problem
    clear = _CLEAR if is_accounted(engine.rms(best.residual), float(np.std(p.measured[p.used])),
                                   noise) else max(_CLEAR, _NEARLY * p.count)
    suspects = [_suspect({cause}, 0.0, words) for cause, words in doubted.items()]
    for cause, g in gains.items():
        mirror = best.effects[cause].mirrors
        rivals = [(margin, causes) for margin, causes in engine.rivals(best, cause)
                  # what cannot be named does not stand in the way of what can
                  if (not mirror or mirror not in causes) and not causes & doubted.keys()]
        margin, other = rivals[0] if rivals else (np.inf, frozenset())
        instead = sorted(other - best.causes)
        entry = Finding(best.effects[cause], stds[cause], _confidence(margin),
                        [*(instead if margin < 10 * _CLEAR else []), *([mirror] if mirror else [])],
                        gain_words(cause, g, margin, instead), g)
        if cause in doubts:
            suspects.append(_suspect({cause}, 0.0, doubts[cause]))
        elif margin > clear or (best.effects[cause].everyday and instead and not any(
                effect_of(name).everyday for name in instead)):
            # of two that say the same, what is common
            findings.append(entry)
        else:
            suspects.append(_suspect({cause, *instead}, margin, "another cause explains as much"))
    return _verdict(engine, best, left, findings, suspects, found, noise,
                    lambda fitted: read_off(engine, fitted, found, shown, sensor))


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
    here, dropped = _without_the_weakest(engine, _examined(engine, best, noise_std, known),
                                         noise_std, known)
    for _ in range(_AGAIN):
        # what cannot be named must not stand in the way of what can
        unwanted = {cause for cause in here.doubts if cause not in engine.uncontested}
        # what is common may be in doubt only for its odd company
        unwanted = {cause for cause in unwanted
                    if not here.best.effects[cause].everyday} or unwanted
        if not unwanted:
            break
        there = _examined(engine, engine.instead(here.best, unwanted), noise_std, known)
        if there.doubts or not there.gains.keys() - here.gains.keys():
            break
        dropped.update({cause: here.doubts[cause] for cause in unwanted})
        here = there
    return here, dropped


def _without_the_weakest(engine, here, noise_std, known):
    """A set less its weakest doubtful causes, up to two, where nothing is doubtful then, and what
    was dropped, in words; else the set as it is."""
    there, dropped = here, {}
    # more do not become clear by leaving out two
    for _ in range(_WEAKEST if len(here.doubts) <= _WEAKEST + 1 else 0):
        # what comes into doubt only without another one stays
        doubtful = (there.doubts.keys() & here.doubts.keys()) - engine.uncontested
        if not doubtful or len(there.gains) < 2 or engine.problem.limit.ends_search(
                "the weakest doubtful causes were not left out first"):
            break
        weakest = min(doubtful, key=lambda cause: there.gains[cause].taken)
        dropped[weakest] = there.doubts[weakest]
        there = _examined(engine, engine.search.without(there.best, weakest), noise_std, known)
        # a smaller set does not understand more
        if there.gains and not there.doubts and min(g.taken for g in there.gains.values()) \
                > WEIGHS * engine.unexplained(here.best):
            return there, dropped
    return here, {}


def _examined(engine, best, noise_std, known):
    best, gains = _relevant(engine, _mirrored(engine, best), known)
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
    """The same set with causes that say the same with the other sign, where these were as good."""
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


def _verdict(engine, best, left, findings, suspects, found, noise, shown_by):
    p = engine.problem
    rest = engine.held_out_rows
    spread = float(np.std(p.measured[rest]))
    baseline = engine.search.fit(engine.search.base)
    before = _rms(p.measured - baseline.output, rest)
    noise_rms = left.noise_rms
    excess = max(baseline.cost / p.count - noise_rms**2, 0.0)

    def remaining(fitted):
        power = max(fitted.cost / p.count - noise_rms**2, 0.0)
        return power / excess if excess > 0 else 0.0

    # differences that chance makes are no remains
    fraction = remaining(best) if left.share > 0 else 0.0
    if left.share > 0:
        # something is left, which the causes may have been bent by, or mistaken for
        doubtful = {f.cause for f in findings if f.cause in best.effects
                    and (fraction > _LEFT or engine.unsteadiness(best, f.cause) > _STEADY)}
        suspects += [_suspect({cause}, 0.0, "too much is left that it does not explain")
                     for cause in sorted(doubtful)]
        findings = [f for f in findings if f.cause not in doubtful]
    fitted, stds, dropped = _refitted(engine, best, {f.cause for f in findings})
    suspects += [_suspect({cause}, 0.0, words) for cause, words in dropped.items()]
    findings = [f for f in findings if f.cause not in dropped]
    complete = fitted.causes == best.causes
    if not complete:
        findings = [dataclasses.replace(f, effect=fitted.effects[f.cause], std=stds[f.cause])
                    if f.cause in fitted.effects else f for f in findings]
        fraction = remaining(fitted)
    # beside the model as it is in the end, not beside one with what is only suspected
    away, near = _moved(engine, fitted, stds)
    suspects += [_suspect({cause}, 0.0, words) for cause, words in near.items()]
    findings = [*findings, *away, *shown_by(fitted)]
    if any(f.effect.goes_with_size for f in findings):
        left = dataclasses.replace(left, level_score=0.0)
        fraction = fraction if left.share > 0 else 0.0
    after = before if fitted.causes == baseline.causes else _rms(
        p.measured - engine.learnt(fitted).output, rest)
    # what the record shows by itself, such as scattered stamps, is no part of the model
    by_itself = [f.gain.after for f in findings if f.cause not in fitted.effects]
    own = engine.by_reference(fitted)

    def beyond(rms):
        """What the reference's own noise does not account for."""
        return np.sqrt(max(rms**2 - own**2, 0.0))
    # the record is all of it, not only the part that is held out
    errors = p.errors(fitted)
    error = max(after, _rms(errors, engine.wanted & np.isfinite(errors)))
    accounted = is_accounted(beyond(min([error, *by_itself])), spread, noise)
    faulty = accounted and not is_accounted(
        beyond(_rms(errors, (engine.wanted | engine.aside) & np.isfinite(errors))), spread, noise)
    strange = engine.structure(fitted)
    # beside a model that leaves nothing that stands out, what is only suspected is chance
    plain = not findings and not strange and engine.left(fitted).share == 0
    verdict = verdict_of(findings, [] if plain else suspects, complete,
                         0.0 if plain else left.share, fraction, accounted, strange or faulty)
    effects = {**fitted.effects, **{f.cause: f.effect for f in findings}}
    described, after = _described(engine, fitted, after, {part for _, part in strange}) \
        if verdict in _INCOMPLETE or strange else ({}, after)
    model = _extended(engine, {**effects, **{e.cause: e for e in described}})
    description = (f"; the extended model has {' and '.join(described.values())}, which describes "
                   "a part of it and names nothing") if described else ""
    return Diagnosis(
        verdict, reason_of(verdict, error / spread, noise, accounted, strange)
        + set_aside(engine.aside, engine.record.valid) + description
        + (f"; {min(own / error, 1.0)**2:.0%} of that power is what the reference's own noise hides"
           if own > 0.1 * error else ""),
        {"rmse": before, "nrmse": before / spread, "noise_rms": noise_rms},
        findings, suspects,
        {"rmse": after, "nrmse": after / spread},
        float(min(fraction, 1.0)), model, found,
        Evidence.of(engine, best, {f.cause: f.effect for f in findings}),
        noise.as_dict(), p.limit.summary(),
        [*engine.budget(baseline).as_list("baseline"), *engine.budget(fitted).as_list("extended")])


def _refitted(engine, best, named):
    """The causes that are named, fitted without the others; their uncertainties; and, in words,
    those that are no longer to be named then.

    What is not named is not in the model.
    """
    base, named, dropped = engine.search.base.keys(), named & best.effects.keys(), {}
    fitted, stds = best, engine.uncertainties(best)
    while True:
        if named != fitted.causes - base:
            fitted = engine.search.to_its_best(engine.search.fit(
                {c: e for c, e in best.effects.items() if c in named or c in base}))
            stds = engine.uncertainties(fitted)
            takes = {c: engine.rms(engine.added(fitted, c)) for c in fitted.causes - base}
            found = {**by_what_is_left(engine, fitted, takes, engine.left(fitted)),
                     **left_open(engine, fitted, stds, takes),
                     **dict.fromkeys(named - fitted.causes, "beside the others that are found the "
                                     "model's motion grows without bound")}
        elif named and not engine.predicts_better(fitted):
            found = dict.fromkeys(named, "the causes that are found predict held-out data no "
                                         "better than the model in use describes them")
        else:
            return fitted, stds, dropped
        named, dropped = named - found.keys(), {**dropped, **found}


def _described(engine, fitted, after, parts):
    """What stands for what no cause explains, with words, and the held-out error.

    A fitted filter where a part of it is linear, and a fitted curve where one is even or odd.
    """
    p, described = engine.problem, {}
    rest, effects, output = engine.held_out_rows, fitted.effects, fitted.output
    for belongs, words, fit in (
            ({"linear"}, "a fitted filter", lambda output: fit_empirical_link(
                p.measured, output, p.used, rest, p.rate)),
            ({"even", "odd"}, "a fitted curve", lambda output: fit_empirical_map(
                p.measured, output, p.used, rest))):
        if not belongs & parts or p.limit.ends_judging("no description was fitted to what is left"):
            continue
        try:
            found = fit(output)
            more = {**effects, found.effect.cause: found.effect}
            simulated = p.simulate(more)
        except FracAccelError:
            continue
        error = _rms(p.measured - simulated, rest)
        if found.is_worth_it and error < after:
            effects, output, after = more, simulated, error
            described[found.effect] = words
    return described, after


def _extended(engine, effects):
    """The model in use with these causes on the diagnosed axis."""
    p = engine.problem
    own = p.axis_model(effects)
    common = {cause: effect for cause, effect in effects.items() if effect.common_to_axes}
    axes = {name: p.axis_model(common, i) for i, name in enumerate(AXES)}
    axes[AXES[p.axis]] = own
    axes = {name: AxisModel(axis.core, tuple(e for e in axis.effects if not e.of_reference))
            for name, axis in axes.items()}
    return SensorModel(p.baseline.core, p.baseline.effects, axes, p.baseline.metadata,
                       [effect for effect in own.effects if effect.of_reference])


def _rms(error, rows):
    return float(np.sqrt(np.mean(error[rows]**2)))


def _confidence(margin):
    return float(expit(margin / 2))


def _moved(engine, best, stds):
    """Findings among the causes that were free: farther from the model than it allows for; and
    those in doubt, with words."""
    findings, doubtful = [], {}
    for cause, entry in engine.loose.items():
        effect = best.effects[cause]
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
        words = resembles(engine, best, effect, g.taken)
        other = None if words or not np.isfinite([*entry.std.values()]).all() else \
            engine.instead_of_moved(best, entry.effect)
        if other:
            words = f"{other} explains more"
        if words:
            doubtful[cause] = words
        else:
            findings.append(Finding(effect, stds[cause], _confidence(farthest**2), [], [
                f"{farthest:.3g} standard uncertainties from the model's own value",
                *gain_words(cause, g, np.inf, [])], g))
    return findings, doubtful
