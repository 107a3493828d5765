"""What is named in the end, what describes the rest, and the verdict on both."""

import dataclasses
from typing import NamedTuple

import numpy as np

from ..errors import FracAccelError
from ..identification.fit.uncertainty import beyond_noise, noise_floor
from ..model import AXES, AxisModel, SensorModel, is_link
from ..model.core import Oscillator
from ..model.effects import fault_of_reference
from ..model.effects.base import STAMPS
from . import courses
from .doubts import left_open, most_is_left
from .doubts.delays import delay_of_unseen_core
from .doubts.links import own_delay_s
from .empirical import fit_empirical_link
from .empirical_map import fit_empirical_map
from .engine import OF_MOTION
from .evidence import Evidence
from .finding import Diagnosis
from .gain import gain
from .late_reference import is_reference_late
from .naming import (
    constants_of,
    moved,
    open_by_one_suspect,
    open_by_suspects,
    remaining,
    rms_of,
    sure,
    suspect,
)
from .other_axes import fit_shares, with_unknown_turn
from .own_core import in_own_core
from .words import (
    AS_NOISE,
    ahead_words,
    description_words,
    hidden_words,
    hides_much,
    hint_words,
    is_accounted,
    reason_of,
    set_aside,
    verdict_of,
)

# Verdicts that leave something to be described.
_INCOMPLETE = ("unexplained", "partly_explained")
# Share of the error that all else leaves up to which what is only suspected describes a record.
_CLEARLY = 0.9
# Standard uncertainties, and share of its size, within which a delay is what belongs to another
# cause.
_SAME_STDS, _SAME_SHARE = 5.0, 0.1
# Times as much of the held-out data (RMS) as the model in use leaves, that names must not leave.
_MISLED = 1.1
# Share of what is left (power) that may be no noise in a record that counts as consistent, where so
# little is left that it need not be noise; more of it where that is such a share of the output
# (RMS) at most; of parts that follow the motion: tones, bursts and what wanders are no hint.
_HINT, _MUCH, _UNSEEN = 0.1, 0.3, 0.005


class Curves(NamedTuple):
    """Fitted curves beside a model: their effects by cause, their words, the held-out error (RMS)
    with them, and the output (None without)."""

    effects: dict
    words: list
    after: float
    output: object


class Likely(NamedTuple):
    """What the competition of causes has found, with all that a verdict rests on."""

    best: object
    widest: object
    left: object
    noise: object
    findings: list
    suspects: list
    tied: dict


class Named(NamedTuple):
    """What is named, the model of that alone, and what it leaves."""

    findings: list
    suspects: list
    unnamed: list
    fitted: object
    stds: dict
    complete: bool
    left: object
    fraction: float
    account: "Account"
    strange: list

    def hint(self, engine):
        """Largest share of what is left (power) that may be no noise."""
        return max(engine.left(self.fitted).share, sum(share for share, _ in self.strange))

    @property
    def may_be_noise(self):
        """Whether what is left may be noise that grows with the motion: nothing predicts it, and
        no other cause is suspected."""
        return self.left.only_grows and self.complete and not self.strange and not self.suspects


class Described(NamedTuple):
    """The verdict; what stands in the model for what no cause explains (effects by cause), in words
    and by the causes that are kept without a name; the findings beside it; what is then left of the
    held-out data (RMS), and the output with it (None without)."""

    verdict: str
    plain: bool
    effects: dict
    words: list
    kept: list
    findings: list
    after: float
    output: object


def verdict_on(engine, likely, found, shown_by):
    """`Diagnosis` of what is likely.

    Names are taken back where the model that is written, with what describes the rest, shows that
    they mislead.

    Parameters
    ----------
    engine : Engine
    likely : Likely
    found : Integrity
    shown_by : callable
        Findings that the record shows by itself, beside a fit.
    """
    back = {}
    while True:
        named = _named(engine, likely, shown_by, back)
        described = _described(engine, named, likely)
        more = _taken_back(engine, likely, named, described)
        if not more:
            return _told(engine, likely, named, described, found)
        back |= more


def _named(engine, likely, shown_by, back):
    """`Named`, without the causes that are taken back (words by cause)."""
    best, left, beside = likely.best, likely.left, engine.left_beside_noise(likely.best)
    fraction = remaining(engine, best, left.noise_rms) if left.share > 0 else 0.0
    findings, fitted, stds, more = sure(
        engine, best, [f for f in likely.findings if f.cause not in back], likely.tied, beside,
        fraction)
    # a long record's widest set may be one of its part
    wider = [fit for fit in (best, likely.widest) if fit.problem is fitted.problem]
    findings = open_by_one_suspect(engine, open_by_suspects(findings, fitted, wider), fitted,
                                   [*likely.suspects, *more])
    complete = fitted.causes >= best.causes
    if not complete:
        fraction = remaining(engine, fitted, left.noise_rms)
    # beside the model as it is in the end, not beside one with what is only suspected
    away, near = moved(engine, fitted, stds, most_is_left(engine, beside, likely.noise))
    drifts, other_course = courses.findings(engine, fitted, stds)
    other_course |= {f.cause: back[f.cause] for f in drifts if f.cause in back}
    doubted = {**{cause: back[cause] for cause in sorted(back)}, **near, **other_course}
    suspects = [*likely.suspects, *more,
                *(suspect({cause}, 0.0, words) for cause, words in doubted.items())]
    findings = _without_mean_delay([
        *(with_unknown_turn(engine, fitted, finding) for finding in findings), *away,
        *(f for f in drifts if f.cause not in back),
        *_shown(shown_by, fitted, wider)])
    unnamed = sorted(fitted.causes - {f.cause for f in findings} - engine.search.base.keys())
    # what was in doubt in a part of the record, or beside something else, is no suspect any more
    suspects = [each for each in suspects
                if not {f.cause for f in findings}.issuperset(each["causes"])]
    if any(f.effect.goes_with_size for f in findings):
        left = dataclasses.replace(left, level_score=0.0)
        fraction = fraction if left.share > 0 else 0.0
    account = _account(engine, fitted, findings, likely.noise)
    bare = engine.search.baseline
    if not findings and (fitted.cost > bare.cost or account.after > account.before):
        # a core alone, left to err where its record begins, may leave more than the model in use,
        # and so may a constant without a name of what it was not fitted to
        fitted, stds, unnamed = bare, engine.uncertainties(bare), []
        account = _account(engine, fitted, findings, likely.noise)
    return Named(findings, suspects, unnamed + sorted(other_course), fitted, stds, complete, left,
                 fraction, account, engine.structure(fitted))


def _shown(shown_by, fitted, wider):
    """Findings that the record shows by itself beside what is named; and of what goes with the
    motion's size, beside wider fits: the error of what is only suspected would hide its law."""
    shown = shown_by(fitted)
    for fit in wider:
        if fit is not fitted and not any(f.effect.goes_with_size for f in shown):
            shown = [*shown, *(f for f in shown_by(fit) if f.effect.goes_with_size)]
    return shown


def _without_mean_delay(findings):
    """Findings less a delay that is just what belongs to another one: it stays without a name."""
    known = sum(f.effect.mean_delay_s() for f in findings)

    def belongs(finding):
        delay = finding.effect.pure_delay_s()
        return bool(delay) and known and abs(delay - known) <= max(
            _SAME_STDS * max(finding.std.values()), _SAME_SHARE * known)
    return [f for f in findings if not belongs(f)]


def _described(engine, named, likely):
    """`Described`, by what is only suspected in the sets that are likely."""
    fitted, account, strange = named.fitted, named.account, named.strange
    # beside a model that leaves nothing that stands out, what is only suspected is chance, and a
    # hint of structure in what is left is no reason to call the record unexplained
    hint = named.hint(engine)
    unrelated = [part for _, part in strange if part not in OF_MOTION]
    small = hint < _HINT or hint < _MUCH and np.sqrt(hint) * account.share < _UNSEEN
    plain = all(f.effect.read_off for f in named.findings) and not unrelated and (
        hint == 0 or account.accounted and small)
    verdict = verdict_of(
        named.findings, [] if plain else named.suspects, named.complete,
        0.0 if plain else named.left.share, named.fraction, account.accounted,
        (strange and not plain) or account.faulty)
    if verdict == "consistent" and named.unnamed:
        bare = _account(engine, engine.search.baseline, [], likely.noise)
        if not bare.accounted and account.after <= _CLEARLY * bare.after:
            verdict = "unexplained"  # not by the model in use, but by what has no name
    if verdict == "consistent" and hides_much(engine.record.beyond(engine.problem.axis)):
        verdict = "undecided"
    if verdict in _INCOMPLETE and named.may_be_noise:
        verdict = "explained" if account.accounted and any(
            f.effect.stage != STAMPS for f in named.findings) else "undecided"
    if not (verdict in _INCOMPLETE or (strange and not plain)):
        return Described(verdict, plain, {}, [], [], named.findings, account.after, None)
    named_causes = {f.cause for f in named.findings}
    described = _by_curves(engine, fitted, account.after, named_causes)
    wider, known = None, {}
    for each in {each.causes: each for each in (likely.widest, likely.best)}.values():
        found = _kept(engine, named, each, account.after, likely.tied)
        if found is None:
            continue
        fit, stds, error = found
        with_it = _by_curves(engine, fit, error, named_causes)
        if with_it.after <= _CLEARLY * described.after:
            wider, known, described = fit, stds, with_it
    effects, words, after, output = described
    if wider is None:
        return Described(verdict, plain, effects, words, [], named.findings, after, output)
    # named causes are what they are in the model that is written
    findings = [_as_kept(f, wider.effects, known) for f in named.findings]
    return Described(verdict, plain, {**wider.effects, **effects}, words,
                     sorted(wider.effects.keys() - fitted.causes), findings, after,
                     wider.output if output is None else output)


def _taken_back(engine, likely, named, described):
    """Causes that are named although the model that is written speaks against them, with words."""
    account = named.account
    own = {f.cause for f in likely.findings} & {f.cause for f in described.findings} \
        & named.fitted.causes
    if own and _misleads(described.after, account.own, account.before):
        return dict.fromkeys(sorted(own), "without what is only suspected, the model with it "
                             "leaves more of the held-out data than the model in use")
    along = [f for f in described.findings if f.cause in engine.search.courses]
    if described.output is None or not along:
        return {}
    p = engine.problem
    left = engine.budget_between(p.measured, described.output, p.record.valid)
    return courses.of_another_kind(along, engine.standing_out(left.parts, {}))


def _told(engine, likely, named, described, found):
    """The `Diagnosis`."""
    p, account, fitted, noise = engine.problem, named.account, named.fitted, likely.noise
    findings, verdict, after, output = (described.findings, described.verdict, described.after,
                                        described.output)
    own = {f.cause: f.effect for f in findings}
    effects, late = _of_reference(engine, {**fitted.effects, **own, **described.effects}, own)
    others = p.others.shown_by(p, effects)
    model = _extended(engine, effects, others, _stated(p, fitted, after / account.spread))
    left, fraction = named.left, named.fraction
    counts_as_noise = verdict in ("explained", "undecided") and named.may_be_noise
    if counts_as_noise:
        left = dataclasses.replace(left, level_score=0.0)
    floor = _noise_floor(left, noise, account)
    if verdict == "consistent" or counts_as_noise:
        fraction = 0.0  # nothing asks for an explanation
    elif floor < left.noise_rms:
        fraction = remaining(engine, fitted, floor)
    # a model that has the limits leaves nothing there
    at_limit = engine.at_limit if any(f.effect.read_off for f in findings) else None
    rest = engine.budget_shown(fitted, at_limit) if output is None else \
        engine.budget_between(p.recorded, output, p.record.valid)
    findings = [_beside_unseen_core(others.said(f), delay_of_unseen_core(engine, fitted))
                for f in findings]
    more = [*engine.words_of_budget, *(noise.words if noise.rms is None else ())]
    found.words.extend(words for words in more if words not in found.words)
    if p.others.in_own_core:
        model, findings = in_own_core(model, findings, p.others.in_own_core, AXES[p.axis])
    reason = reason_of(verdict, account.share, noise, account.accounted, named.strange,
                       named.may_be_noise, engine.record.beyond(p.axis), bool(named.unnamed)) \
        + set_aside(engine.aside, engine.drowned, engine.record.valid) \
        + description_words(described.words, named.unnamed, described.kept,
                            after / account.spread) \
        + hint_words(named.hint(engine) if described.plain and not named.strange else 0.0) \
        + _known_words(engine, fitted, account, findings) \
        + hidden_words(account.own, account.error) + late + _ahead(p, effects, own)
    return Diagnosis(
        verdict, reason,
        {"rmse": account.before, "nrmse": account.before / account.spread,
         "noise_rms": floor or left.noise_rms},
        findings, _once_each(named.suspects),
        {"rmse": after, "nrmse": after / account.spread},
        _by_itself(findings, fitted, floor, fraction) if verdict == "explained"
        else float(min(fraction, 1.0)), model, found,
        Evidence.of(engine, likely.best, fitted, own),
        noise.as_dict(), p.limit.summary(),
        [*engine.budget_shown(engine.search.baseline).as_list("baseline"),
         *rest.as_list("extended")])


def _known_words(engine, fitted, account, findings):
    """Words for what is left but for what the record shows of each sample, which no model knows."""
    p = engine.problem
    shown = [f.gain.after for f in findings
             if f.effect.known_by_sample and f.cause not in fitted.effects]
    if p.record.taken_off is not None:
        shown = [rms_of(p.measured - engine.learnt(fitted).output, engine.held_out_rows)]
    if not shown:
        return ""
    left = min(shown)
    return f"; {left / account.spread:.2%} but for what the record shows of each sample by itself"


def _once_each(suspects):
    """Suspects without those that have been told for another reason."""
    first = {tuple(each["causes"]): each for each in reversed(suspects)}
    return [each for each in suspects if first[tuple(each["causes"])] is each]


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


def _by_itself(findings, fitted, noise_rms, fraction):
    """Share of the error's power above the noise that is left where all is explained; where no fit
    counts it, such as at a limit, by what the record shows by itself."""
    if findings and not any(f.cause in fitted.effects for f in findings):
        g = max((f.gain for f in findings), key=lambda g: g.before)
        after, before = (max(rms**2 - noise_rms**2, 0.0) for rms in (g.after, g.before))
        fraction = after / before if before else 0.0
    return float(min(fraction, 1.0))


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
    measured, off = p.recorded, engine.record.taken_off
    off = np.zeros(len(engine.record)) if off is None else off
    spread = float(np.std(measured[rest]))
    baseline = engine.search.baseline
    before = rms_of(measured - baseline.output, rest)
    output = (baseline if fitted.causes == baseline.causes else engine.learnt(fitted)).output
    # what the record shows by itself was not fitted; some of it, such as limits, is simulated
    shown = [f for f in findings if f.effect.read_off and f.cause not in fitted.effects]
    for finding in shown:
        simulated = finding.effect.simulate(output, p.simulator(p.axis).circumstances)
        # rounded once more, values that noise or other instants have moved are farther off
        if rms_of(measured - simulated, rest) < rms_of(measured - output, rest):
            output = simulated
    after = rms_of(measured - output, rest)
    by_itself = [f.gain.after for f in shown]
    own = engine.by_reference(fitted)
    # the record is all of it, not only the part that is held out
    errors = p.errors(fitted) + off
    whole, over = (rms_of(errors, engine.wanted & np.isfinite(errors)),
                   float(np.std((engine.record.sensor[:, p.axis] + off)[engine.wanted])))
    error, of = max((after, spread), (whole, over), key=lambda pair: pair[0] / pair[1])
    # what is named may hide all else
    hidden = False if any(f.effect.read_off for f in findings) else engine.silent
    everywhere = rms_of(errors, (engine.wanted | engine.aside | hidden) & np.isfinite(errors))

    def is_covered(rms, spread):
        """Whether what the reference's own noise does not make is accounted for."""
        return is_accounted(np.sqrt(max(rms**2 - own**2, 0.0)), spread, noise)
    accounted = is_covered(error, of) or any(is_covered(rms, spread) for rms in by_itself)
    return Account(spread, before, after, error, error / of, own, accounted,
                   accounted and not is_covered(everywhere, over))


def _by_curves(engine, fitted, after, named):
    """`Curves` that stand for what no cause explains, with a constant that has no name as it is
    beside them.

    A fitted course of the zero where a part of it is slow, a share of each other axis where one
    comes across, a fitted filter where one is linear, and a fitted curve where one is even or odd.
    """
    p, described = engine.problem, []
    parts = {part for _, part in engine.structure(fitted)}
    rest, effects, output = engine.held_out_rows, fitted.effects, fitted.output
    constants = constants_of(effects) - engine.search.base.keys() - named
    for belongs, words, fit in (
            ({"slow"}, "a fitted course of the zero", lambda _, output: courses.fit_empirical_zero(
                p, output, rest)),
            ({"across"}, "a fitted share of each other axis", lambda effects, output: fit_shares(
                p, effects, output, rest)),
            ({"linear"}, "a fitted filter", lambda _, output: fit_empirical_link(
                p.measured, output, p.used, rest, p.rate)),
            ({"even", "odd"}, "a fitted curve", lambda _, output: fit_empirical_map(
                p.measured, output, p.used, rest))):
        # whatever the time limit: it takes a fraction of a second, and a search that was cut needs
        # it most
        if not belongs & parts:
            continue
        try:
            found = fit(effects, output)
            if found.effect.cause in effects:
                continue
            more = {**effects, found.effect.cause: found.effect}
            if constants:  # it makes another level of the motion's mean
                more = p.fit(more, held=more.keys() - constants).effects
            simulated = p.simulate(more)
        except FracAccelError:
            continue
        error = rms_of(p.recorded - simulated, rest)
        if found.is_worth_it and error < after:
            effects, output, after = more, simulated, error
            described.append(words)
    return Curves({cause: effect for cause, effect in effects.items()
                   if effect is not fitted.effects.get(cause)}, described, after,
                  output if described else None)


def _kept(engine, named, widest, after, tied):
    """Fit of a set with causes that are only suspected, of linear ones, of such as change along the
    record or with temperature, and of those that another one equals (`tied`), where it predicts
    held-out data clearly better than all else that describes them (`after`), its standard
    uncertainties and its held-out error; or None."""
    p, rest, fitted = engine.problem, engine.held_out_rows, named.fitted
    more = {cause: effect for cause, effect in widest.effects.items()
            if cause not in fitted.causes and (is_link(effect) or effect.pure_delay_s()
                                               or effect.is_constant or effect.restates_core
                                               or effect.counts_from_start
                                               or effect.needs_temperature or cause in tied)}
    if not more or p.limit.ends_judging("what is only suspected was not kept as a description"):
        return None
    slow = [effect for effect in {**more, **fitted.effects}.values() if effect.acts_on_slow_motion]
    if len(slow) > 1:
        return None  # they cancel but for a free motion, which no model can have
    wider = engine.search.to_its_best(engine.search.fit({**more, **fitted.effects}))
    errors = [(p.recorded - engine.learnt(fit).output)[rest] for fit in (fitted, wider)]
    error = rms_of(p.recorded - wider.output, rest)
    # a file says nothing of a free motion, which may do what its causes do not
    written, before = (rms_of(p.recorded - fit.simulated, rest) for fit in (wider, fitted))
    better = gain(*errors)
    if not better.is_relevant or engine.hollow(wider) or written > _CLEARLY * max(after, before) \
            or max(error, rms_of(errors[1], slice(None))) > _CLEARLY * after:
        return None
    stds = engine.uncertainties(wider)
    if left_open(engine, wider, stds, wider.causes & {f.cause for f in named.findings}):
        return None
    return wider, stds, error


def _of_reference(engine, effects, named):
    """Effects in which what no sensor can do is the reference's, where that is late by the record
    itself and nothing names it; and words."""
    words = ""
    for cause, early in [*effects.items()]:
        fault = fault_of_reference(early)
        if fault is None or cause in named or effects.get(fault.cause, fault) != fault:
            continue
        is_named = fault.cause in named
        if is_named or is_reference_late(engine.problem, effects):
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
    delays = {cause: effect.slow_delay_s() for cause, effect in effects.items()
              if not effect.of_reference}
    if not any(delay < 0 and cause not in named for cause, delay in delays.items()) \
            or is_reference_late(problem, effects):
        return ""
    core = problem.axis_model(effects).effective_core
    own = own_delay_s(core) if isinstance(core, Oscillator) else 0.0
    return ahead_words(problem.record.lag_s - sum(delays.values()) - own, problem.rate)


def _extended(engine, effects, others, stated):
    """The model in use with these causes on the diagnosed axis, what others (`OtherAxes`) have of
    them, and what is stated of it."""
    p = engine.problem
    own = p.axis_model(effects)
    common = others.common(effects)
    axes = {name: p.axis_model(common, i) for i, name in enumerate(AXES)}
    axes[AXES[p.axis]] = own
    axes = {name: AxisModel(axis.core, tuple(e.on_stamps() for e in axis.effects
                                             if not e.of_reference))
            for name, axis in axes.items()}
    return SensorModel(p.baseline.core, [e.on_stamps() for e in p.baseline.effects], axes,
                       {**p.baseline.metadata, **stated},
                       [effect for effect in own.effects if effect.of_reference])
