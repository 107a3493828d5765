"""From fitted causes to a set in which as little as possible is doubtful."""

from typing import NamedTuple

import numpy as np

from ..model.effects import effect_of, known_effects
from .doubts import doubts_about
from .engine import WEIGHS
from .finding import Finding
from .gain import certainty
from .names import DETERMINED
from .naming import confidence, constants_of, refitted, suspect
from .other_axes import as_they_show
from .read_off import read_off
from .verdict import Likely, verdict_on
from .words import gain_words

# Times that another set is looked for in which no cause is doubtful, and times what a set leaves
# (power) that such a one may not leave with causes that the other does without.
_AGAIN, _FAR_WORSE = 2, 2.0
# Doubtful causes that are left out one after the other before another set is looked for.
_WEAKEST = 2
# Margin, in variances of the noise, by which a cause must beat its nearest rival.
_CLEAR = 10.0
# Where nothing shows that what is left is noise, share of its power by which it must beat it.
_NEARLY = 0.05
# Share of what a cause takes (power) by which it must beat one that follows the temperature as it
# was measured: a thermometer has noise and a place of its own.
_AS_MEASURED = 1e-3
# Share of what the largest cause takes (RMS) that a common one must take to be named for that.
_COMMON = 0.1


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
    best, gains, noise, stds, doubts = settled
    doubted |= more
    findings, tied = [], {}
    nearly = 0.0 if engine.is_accounted(best, noise) else _NEARLY
    suspects = [suspect({cause}, 0.0, words) for cause, words in doubted.items()]
    most = max((g.taken for g in gains.values()), default=0.0)
    for cause, g in gains.items():
        mirror = best.effects[cause].mirrors
        of_all = engine.margin_of_all(best, cause)
        clear = max(_CLEAR, nearly * of_all)
        rivals = [(margin, causes) for margin, causes in engine.rivals(best, cause, nearly > 0,
                                                                       clear)
                  # what cannot be named does not stand in the way of what can
                  if (not mirror or mirror not in causes) and not causes & doubted.keys()]
        alone = engine.stands_alone(best, cause, g.taken)
        margin, other = (np.inf, frozenset()) if alone or not rivals else rivals[0]
        instead = sorted(other - best.causes)
        if any(effect_of(name).needs_temperature for name in instead):
            clear = max(clear, _AS_MEASURED * g.taken**2 * of_all * engine.problem.count
                        / best.cost)
        entry = Finding(best.effects[cause], stds[cause],
                        certainty(g) if alone else confidence(margin * _CLEAR / clear),
                        [*(instead if margin < 10 * _CLEAR else []), *([mirror] if mirror else [])],
                        gain_words(cause, g, margin, instead), g)
        if cause in doubts:
            suspects.append(suspect({cause}, 0.0, doubts[cause]))
        elif margin > clear or (
                best.effects[cause].everyday and instead and g.taken > _COMMON * most
                and margin > -clear / 2
                and not any(effect_of(name).everyday for name in instead)):
            # of two that say the same, what is common; not what may only mend what another lacks
            findings.append(entry)
        else:
            suspects.append(suspect({cause, *instead}, margin, "another cause explains as much"))
            tied[cause] = other
    # what comes and goes with the motion bends no cause, but may be an unknown one's
    left = engine.left(best)
    return verdict_on(engine, Likely(best, widest, left, noise, findings, suspects, tied), found,
                      lambda fitted: read_off(engine, fitted, found, shown))


class Examined(NamedTuple):
    """A set of causes with all that its judgement rests on."""

    best: object
    gains: dict
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
    there, gone, others = here, {}, []
    for _ in range(_AGAIN):
        # what cannot be named must not stand in the way of what can
        unwanted = {cause for cause in there.doubts.keys() - constants_of(there.best.effects)
                    if cause not in engine.uncontested
                    and not _is_of_stamps(engine.record, there, cause)}
        # what is common may be in doubt only for its odd company
        unwanted = {cause for cause in unwanted
                    if not there.best.effects[cause].everyday} or unwanted
        if not unwanted:
            break
        other = engine.instead(there.best, unwanted, gone.keys())
        gone |= {cause: there.doubts[cause] for cause in unwanted}
        there = _examined(engine, other, noise_std, known)
        # one that is doubtful, too, may lead to another that is not
        if not there.doubts.keys() - constants_of(there.best.effects):
            if there.gains.keys() - here.gains.keys() and not _is_far_behind(here, there):
                here, dropped = there, {**dropped, **gone}
            break
        others.append((there, dict(gone)))
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
        told = {**here.doubts, **_no_longer(engine, here)}
        if here.gains.keys() <= told.keys():
            # an offset is one whatever else is not understood
            others.append((_examined(engine, engine.everyday(), noise_std, known), {}))
            for there, gone in others:
                if there.gains.keys() - there.doubts.keys() - _no_longer(engine, there).keys():
                    dropped.update({cause: words for cause, words in {**told, **gone}.items()
                                    if cause not in there.gains})
                    here = there
                    break
    return here, dropped


def _is_far_behind(here, there):
    """Whether a set in which nothing is doubtful leaves far more than another one, by odd causes
    that the other does without: what they stand for is known to be something else."""
    return there.best.cost > _FAR_WORSE * here.best.cost and any(
        not there.best.effects[cause].everyday
        for cause in there.gains.keys() - here.gains.keys())


def _no_longer(engine, examined):
    """Causes that nothing speaks against in a set, but do not stand without the others; in words.
    """
    return refitted(engine, examined.best, examined.gains.keys() - examined.doubts.keys(), {})[2]


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
            - constants_of(there.best.effects)
        if not doubtful or len(there.gains) < 2 or engine.problem.limit.ends_search(
                "the weakest doubtful causes were not left out first"):
            break
        weakest = min(doubtful, key=lambda cause: there.gains[cause].taken)
        dropped[weakest] = there.doubts[weakest]
        there = _examined(engine, engine.search.without(there.best, weakest), noise_std, known)
        # a smaller set does not understand more
        named = there.gains.keys() - there.doubts.keys()
        if named and not there.doubts.keys() - constants_of(there.best.effects) \
                and min(there.gains[cause].taken for cause in named) \
                > WEIGHS * engine.unexplained(here.best):
            return there, dropped
    return here, {}


def _is_of_stamps(record, here, cause):
    """Whether what a cause says is no more than what scattered stamps leave open: it is there, and
    nothing else may take its place, but has no name."""
    effect = here.best.effects[cause]
    return any(abs(getattr(effect, name)) < DETERMINED * std and std > here.stds[cause][name] / 2
               for name, std in effect.std_by_stamps(record).items())


def _examined(engine, best, noise_std, known):
    best = engine.plainer(best, not engine.structure(best) and engine.is_accounted(
        best, engine.established_noise(best, noise_std)))
    best, gains = _relevant(engine, _mirrored(engine, best), known)
    turned = _mirrored(engine, best)
    if turned is not best:
        best, gains = _relevant(engine, turned, known)
    best = as_they_show(engine, engine.search.to_its_best(best))
    left = engine.left_beside_noise(best)
    noise = engine.established_noise(best, noise_std)
    stds = engine.uncertainties(best)
    judged = {cause: g for cause, g in gains.items() if cause not in known}
    return Examined(best, gains, noise, stds,
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
