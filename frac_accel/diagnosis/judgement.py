"""From fitted causes to a verdict: what is named, what is not, and why."""

import dataclasses
import math
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import resample_poly

from ..budget import WORDS
from ..errors import FracAccelError
from ..model import AXES, AxisModel, SensorModel, is_link
from ..model.effects import known_effects
from ..model.parameters import fixed_values, parameter_fields
from ..shown import Shown
from .empirical import fit_empirical_link
from .engine import WEIGHS
from .evidence import Evidence
from .experiments import separating_experiment
from .gain import gain
from .names import cancelling, undetermined

# Share of the output's RMS that may be left without noise being established, and factor by which an
# error may exceed noise that is.
_LITTLE = 0.05
_AS_NOISE = 1.2
# Times that another set is looked for in which no cause is doubtful.
_AGAIN = 2
# Verdicts that leave something to be described.
_INCOMPLETE = ("unexplained", "partly_explained")
# Samples of a stretch, and share of a record for which it must move, so that the size of what is
# left can be compared with the motion's: not in a shock.
_STRETCH = 64
_LASTS = 0.1
# Share of the excess power that rounds to nothing.
_NOTHING = 0.005
# A filter beside which a linear part is left must take this many times its RMS, or it may only
# resemble the true one; several ones may in any case. Likewise what changes with time.
_RESEMBLES = 30.0
# Standard uncertainties by which a delay below zero is one.
_ACAUSAL = 3.0
# Share of the baseline's excess power that may be left where causes are named.
_LEFT = 0.03
# Largest deviation of a named cause's strength in parts of a record that holds something else too.
_STEADY = 0.2
# Share of the residual's power that may be no noise in a record that counts as explained.
_MOSTLY_NOISE = 0.3
# Share of the held-out error that a cause must take away to matter.
_RELEVANT = 0.005
# Margin, in variances of the noise, by which a cause must beat its nearest rival.
_CLEAR = 10.0
# Standard uncertainties from the model's own value by which a parameter has moved.
_MOVED = 5.0


@dataclasses.dataclass(frozen=True)
class Finding:
    """A named cause.

    Attributes
    ----------
    effect : Effect
        The cause with its parameters.
    std : dict of str to float
        Standard uncertainties of the parameters.
    confidence : float
        Weight of the sets of causes with this one among all that were fitted; where no fit
        competed, since the record shows it by itself, the chance that the gain is above zero.
    confusable_with : list of str
        Rivals that explain nearly as much.
    evidence : list of str
    gain : Gain
    """

    effect: object
    std: dict
    confidence: float
    confusable_with: list
    evidence: list
    gain: object

    @property
    def cause(self):
        """Name of the cause."""
        return self.effect.cause

    def as_dict(self):
        """As the result file has it."""
        parameters = {
            field.name: {"value": float(getattr(self.effect, field.name)),
                         "std": float(self.std[field.name]), "unit": field.metadata["unit"]}
            for field in parameter_fields(type(self.effect)) if field.name in self.std}
        parameters.update({name: {"value": value, "std": 0.0, "unit": ""}
                           for name, value in fixed_values(self.effect).items()})
        return {"cause": self.cause, "parameters": parameters, "confidence": self.confidence,
                "confusable_with": self.confusable_with, "evidence": self.evidence,
                "explanation": self.effect.explanation, "gain": self.gain.as_dict()}


@dataclasses.dataclass(frozen=True)
class Diagnosis(Shown):
    """What was found about one axis.

    Attributes
    ----------
    verdict : str
        consistent, explained, partly_explained, unexplained, undecided or insufficient_data.
    reason : str
        The verdict in words.
    baseline, extended : dict of str to float
        ``rmse``, ``nrmse`` on held-out data, ``noise_rms`` [output units].
    findings : list of Finding
    suspects : list of dict
        ``causes`` that the data cannot tell apart, their ``margin`` in variances of the noise, the
        ``reason`` why they are not named, and the ``experiment`` that would tell.
    unexplained_fraction : float
        What remains above the noise, over the baseline's excess above it (in power).
    model : SensorModel
        The model in use, extended by what was found.
    integrity : Integrity
    established_noise : dict
        ``rms`` [output units] and ``by`` (what shows it); None where nothing does.
    cut_off : str or None
        What a time limit left out.
    budget : list of dict
        ``part``, ``of`` (baseline or extended), ``share`` of what is left, and its ``ci95``.
    evidence : Evidence or None
        What it rests on, for its page; None where nothing was fitted.
    """

    verdict: str
    reason: str
    baseline: dict
    findings: list
    suspects: list
    extended: dict
    unexplained_fraction: float
    model: object
    integrity: object
    evidence: Evidence | None = None
    established_noise: dict = dataclasses.field(
        default_factory=lambda: {"rms": None, "by": None})
    cut_off: str | None = None
    budget: list = dataclasses.field(default_factory=list)

    def __repr__(self):
        causes = ", ".join(finding.cause for finding in self.findings)
        return f"<Diagnosis: {self.verdict}{': ' if causes else ''}{causes}; {self.reason}>"

    def _draw(self, figure):
        if self.evidence is not None:
            self.evidence.draw(figure)

    def as_dict(self, model_file=None):
        """As the result file has it."""
        return {"verdict": self.verdict, "reason": self.reason,
                "established_noise": self.established_noise, "cut_off": self.cut_off,
                "budget": self.budget, "baseline": self.baseline,
                "findings": [finding.as_dict() for finding in self.findings],
                "suspects": self.suspects,
                "extended": {**self.extended, "model": model_file},
                "unexplained_fraction": self.unexplained_fraction,
                "integrity": self.integrity.words,
                "data": {key: value for key, value in dataclasses.asdict(self.integrity).items()
                         if key != "words"},
                "sensor_model": self.model.to_dict() if self.model is not None else None,
                "evidence": self.evidence.as_dict() if self.evidence is not None else None}

    @classmethod
    def from_dict(cls, data):
        """Inverse of `as_dict`.

        Raises
        ------
        FracAccelError
            If it is no result of a diagnosis, or names a cause that is not installed.
        """
        from .result import diagnosis_from
        return diagnosis_from(data)


def insufficient(reason, model, found):
    """Diagnosis of data that cannot tell."""
    nan = float("nan")
    errors = {"rmse": nan, "nrmse": nan}
    return Diagnosis("insufficient_data", reason, {**errors, "noise_rms": nan}, [], [], errors, nan,
                     model, found)


@dataclasses.dataclass(frozen=True)
class Seen:
    """A record beside the best simulation of it, for causes that it shows by itself.

    Attributes
    ----------
    record : Record
    found : Integrity
    sensor : Samples
        The sensor's samples as they were recorded.
    measured, output : ndarray, shape (n,)
    rows, used : ndarray of bool, shape (n,)
        Samples that are there, and those of them that the fit counted.
    is_coarse : bool
        Whether the values' lattice accounts for much of what is left.
    """

    record: object
    found: object
    sensor: object
    measured: np.ndarray
    output: np.ndarray
    rows: np.ndarray
    used: np.ndarray
    is_coarse: bool

    def at_stamps(self):
        """Instants with a sample, and the simulated output at the stamps that these carry."""
        stamps = self.record.topics[1].stamps_ns
        rate = self.record.sampling_rate_hz
        place = (stamps - self.record.start_ns) * 1e-9 * rate
        slot = np.round(place).astype(int)
        good = (slot >= 0) & (slot < len(self.output))
        fine = resample_poly(self.output, 4, 1)
        spline = CubicSpline(np.arange(len(fine)) / 4, fine)
        return slot[good], spline(np.clip(place[good] - self.record.lag_s * rate, 0,
                                          len(self.output) - 1))


def judge(engine, best, found, shown, loose, sensor, noise_std=None):
    """Verdict on the best set of causes.

    Parameters
    ----------
    engine : Engine
    best : Fitted
    found : Integrity
    shown : dict of str to Effect
        Causes that the record shows by itself.
    loose : dict of str to Open
        Causes that were free in every fit.
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
    suspects = [_suspect({cause}, 0.0, words) for cause, words in doubted.items()]
    for cause, g in gains.items():
        mirror = best.effects[cause].mirrors
        rivals = [(margin, causes) for margin, causes in engine.rivals(best, cause)
                  if not mirror or mirror not in causes]
        margin, other = rivals[0] if rivals else (np.inf, frozenset())
        instead = sorted(other - best.causes)
        entry = Finding(best.effects[cause], stds[cause], _confidence(margin),
                        [*(instead if margin < 10 * _CLEAR else []), *([mirror] if mirror else [])],
                        _evidence(cause, g, margin, instead), g)
        if cause in doubts:
            suspects.append(_suspect({cause}, 0.0, doubts[cause]))
        elif margin > _CLEAR:
            findings.append(entry)
        else:
            suspects.append(_suspect({cause, *instead}, margin, "another cause explains as much"))
    return _verdict(engine, best, left, findings, suspects, found, noise,
                    lambda fitted, stds: _moved(engine, fitted, loose, stds),
                    lambda fitted: _read_off(engine, fitted, found, shown, sensor))


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
    known, dropped = known or {}, {}
    here = _examined(engine, best, noise_std, known)
    for _ in range(_AGAIN):
        # what cannot be named must not stand in the way of what can
        unwanted = {cause for cause in here.doubts if cause not in engine.uncontested}
        if not unwanted:
            break
        there = _examined(engine, engine.instead(here.best, unwanted), noise_std, known)
        if there.doubts or not there.gains.keys() - here.gains.keys():
            break
        dropped.update({cause: here.doubts[cause] for cause in unwanted})
        here = there
    return here, dropped


def _examined(engine, best, noise_std, known):
    best, gains = _relevant(engine, _mirrored(engine, best), known)
    left = engine.left(best)
    noise = engine.established_noise(best, noise_std)
    stds = engine.uncertainties(best)
    judged = {cause: g for cause, g in gains.items() if cause not in known}
    return Examined(best, gains, left, noise, stds,
                    _doubts(engine, best, judged, stds, left, noise))


def _relevant(engine, best, known):
    """A fit without the causes that explain nothing of held-out data, and the gains of the rest."""
    base = engine.search.base
    while True:
        gains = {cause: known[cause] if cause in known else engine.held_out(best, cause)
                 for cause in best.effects if cause not in base}
        idle = [cause for cause, g in gains.items()
                if g.reduction < _RELEVANT or g.ci95[0] <= 0]
        if not idle:
            return best, gains
        less = engine.search.without(best, min(idle, key=lambda cause: gains[cause].reduction))
        best = engine.search.fit(less.effects)


def _doubts(engine, best, gains, stds, left, noise):
    """Why fitted causes are not named, in words by cause."""
    p = engine.problem
    core = p.baseline.axis(p.axis).core
    doubts = dict.fromkeys(engine.uncontested, "the time limit left no time for its rivals")
    for cause in gains:
        places = [(u, place) for u, place in zip(best.unknowns, best.theta) if u.cause == cause]
        words = undetermined(best.effects[cause], *zip(*places), stds[cause], core)
        if words:
            doubts[cause] = words
    takes = {cause: float(np.sqrt(max(g.before**2 - g.after**2, 0.0)))
             for cause, g in gains.items()}
    if min(takes.values(), default=np.inf) < WEIGHS * left.rms:
        unexplained = engine.unexplained(best)
        for cause, rms in takes.items():
            if rms < WEIGHS * unexplained:
                doubts.setdefault(cause, f"what it explains ({rms:.3g} RMS) does not stand out of "
                                         f"what is left unexplained ({unexplained:.3g} RMS)")
    for cause, words in (_acausal(engine, best, stds)
                         | _imitators(engine, best, takes, left)).items():
        doubts.setdefault(cause, words)
    for cause, words in _elsewhen(engine, best, takes, left).items():
        doubts.setdefault(cause, words)
    for pair in cancelling({cause: engine.added(best, cause) for cause in gains}):
        for cause, other in (pair, pair[::-1]):
            doubts.setdefault(cause, f"it nearly cancels {other}: together they may stand for "
                                     "one cause that is not known")
    spread = float(np.std(p.measured[p.used]))
    if gains and (left.share > 0 or not _accounted(_rms(best.residual, p.used), spread, noise)):
        for cause, words in engine.unstable(best).items():
            doubts.setdefault(cause, words)
    return {cause: words for cause, words in doubts.items() if cause in gains}


def _filters(engine, best):
    """Causes that act as linear filters, by cause."""
    return {cause: effect for cause, effect in best.effects.items()
            if cause not in engine.search.base and not effect.is_constant
            and (is_link(effect) or effect.pure_delay_s() or effect.restates_core)}


def _imitators(engine, best, takes, left):
    """Linear causes beside which a filter would take still more: they imitate something else."""
    share = sum(share for share, part in engine.structure(best) if part == "linear")
    filters = _filters(engine, best)
    if not share or not filters:
        return {}
    rest = math.sqrt(share) * left.rms
    # a delay is common beside any filter
    odd = [cause for cause, effect in filters.items() if not effect.everyday] or list(filters)
    if len(odd) == 1 and takes.get(odd[0], np.inf) > _RESEMBLES * rest:
        return {}
    linear = [cause for cause, effect in best.effects.items()
              if cause in takes and (cause in filters or effect.is_constant)]
    return dict.fromkeys(linear, f"a linear filter would take another {share:.0%} of what is left: "
                                 "the linear causes only imitate the true response")


def _elsewhen(engine, best, takes, left):
    """Causes that grow with time beside which what is left still changes with it."""
    share = sum(share for share, part in engine.structure(best) if part == "time_varying")
    rest = math.sqrt(share) * left.rms
    words = f"{share:.0%} of what is left changes with time: the course in time is another one"
    return {cause: words for cause in takes if best.effects[cause].shows_with_time
            and not best.effects[cause].everyday and takes[cause] < _RESEMBLES * rest}


def _acausal(engine, best, stds):
    """Links that stand beside a delay below zero: it takes back what they say too much."""
    p = engine.problem
    links = [cause for cause, effect in _filters(engine, best).items()
             if not effect.of_reference and not effect.restates_core]
    delay = sum(effect.pure_delay_s() for effect in p.axis_model(best.effects).effects
                if not effect.of_reference) - p.record.lag_s
    std = max((stds.get(cause, {}).get("delay_s", 0.0) for cause in links), default=0.0)
    if len(links) < 2 or delay > -_ACAUSAL * std or delay >= 0:
        return {}
    return dict.fromkeys(links, f"together they come to a delay of {delay:.3g} s, which no sensor "
                                "has: they imitate something else")


def _accounted(rmse, spread, noise):
    """Whether an error is small beside the output's spread, or no larger than established noise."""
    return rmse <= _LITTLE * spread or (noise.rms is not None and rmse <= _AS_NOISE * noise.rms)


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


def _verdict(engine, best, left, findings, suspects, found, noise, moved, shown_by):
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
    named = {f.cause for f in findings}
    complete = {c for c in best.effects if c not in engine.search.base} <= named
    fitted, stds = best, engine.uncertainties(best)
    if not complete:
        # what is not named is not in the model, and the rest is fitted without it
        fitted = engine.search.fit({c: e for c, e in best.effects.items()
                                    if c in named or c in engine.search.base})
        stds = engine.uncertainties(fitted)
        findings = [dataclasses.replace(f, effect=fitted.effects[f.cause], std=stds[f.cause])
                    if f.cause in fitted.effects else f for f in findings]
        fraction = remaining(fitted)
    # beside the model as it is in the end, not beside one with what is only suspected
    findings = [*findings, *moved(fitted, stds), *shown_by(fitted)]
    after = before if fitted.causes == baseline.causes else _rms(
        p.measured - engine.learnt(fitted).output, rest)
    # what the record shows by itself, such as scattered stamps, is no part of the model
    by_itself = [f.gain.after for f in findings if f.cause not in fitted.effects]
    # the record is all of it, not only the part that is held out
    error = max(after, _rms(fitted.residual, p.used))
    accounted = _accounted(min([error, *by_itself]), spread, noise)
    faulty = accounted and not _accounted(
        _rms(p.measured - fitted.output, p.used | engine.aside), spread, noise)
    budget = engine.budget(fitted)
    strange = engine.structure(fitted)
    verdict = _word(findings, suspects, complete, left.share, fraction, accounted,
                    strange or faulty)
    effects = {**fitted.effects, **{f.cause: f.effect for f in findings}}
    described, after = _described(engine, fitted, after) if verdict in _INCOMPLETE \
        and any(part == "linear" for _, part in strange) else ({}, after)
    model = _extended(engine, {**effects, **described})
    description = ("; the extended model has a fitted filter, which describes a part of it and "
                   "names nothing") if described else ""
    return Diagnosis(
        verdict, _reason(verdict, error / spread, noise, accounted, strange)
        + _set_aside(engine.aside, p.record.valid) + description,
        {"rmse": before, "nrmse": before / spread, "noise_rms": noise_rms},
        findings, suspects,
        {"rmse": after, "nrmse": after / spread},
        float(min(fraction, 1.0)), model, found,
        Evidence.of(engine, best, {f.cause: f.effect for f in findings}),
        noise.as_dict(), p.limit.summary(),
        [entry for of, parted in (("baseline", engine.budget(baseline)), ("extended", budget))
         for entry in parted.as_list(of)])


def _described(engine, fitted, after):
    """A fitted filter that stands for what no cause explains, by cause, and the held-out error."""
    p = engine.problem
    rest = engine.held_out_rows
    if p.limit.ends_judging("no filter was fitted to what is left"):
        return {}, after
    try:
        found = fit_empirical_link(p.measured, fitted.output, p.used, rest, p.rate)
        if not found.is_worth_it:
            return {}, after
        effects = {**fitted.effects, found.effect.cause: found.effect}
        output = p.simulate(effects)
    except FracAccelError:
        return {}, after
    error = _rms(p.measured - output, rest)
    return ({found.effect.cause: found.effect}, error) if error < after else ({}, after)


def _word(findings, suspects, complete, share, fraction, accounted, strange):
    if not findings and not suspects and share == 0:
        if strange:
            return "unexplained"
        return "consistent" if accounted else "undecided"
    nothing = fraction < _NOTHING
    if findings and (nothing or complete and share <= _MOSTLY_NOISE):
        return "explained" if accounted else "undecided"
    if findings:
        return "partly_explained"
    return "unexplained"


def _reason(verdict, nrmse, noise, accounted, strange):
    shown = {"rest": "down to the noise that it shows at rest",
             "covariance": "down to the noise that its messages state",
             "periods": "down to the noise by which its repeated periods differ",
             "stated": "down to the noise that was stated",
             "second_sensor": "down to the noise that a second sensor does not share"}
    to = shown[noise.by] if noise.rms is not None and nrmse > _LITTLE and accounted \
        else f"up to {nrmse:.2%} of the output"
    left = ""
    if strange:
        parts = ", ".join(f"{share:.0%} {part} ({WORDS[part]})" for share, part in strange[:2])
        left = f"; of what is left: {parts}"
    return {"consistent": f"the model explains the record {to}",
            "explained": f"the named causes explain the record {to}",
            "partly_explained": "the named causes leave a part unexplained" + left,
            "unexplained": "no known cause explains what the model gets wrong" + left,
            "undecided": f"{nrmse:.1%} of the output is unaccounted for; {_unknown(noise)}; "
                         "record the sensor at rest too, or repeat the same motion, or state its "
                         "noise (--noise-std)"}[verdict]


def _set_aside(aside, valid):
    """Words for the samples that were not judged."""
    share = aside.sum() / valid.sum()
    return f"; {aside.sum()} samples ({share:.2%}) do not count: a signal stood still or had " \
           "spikes there" if aside.any() else ""


def _unknown(noise):
    if noise.rms is None:
        return "nothing in the record shows that it is noise"
    return f"the noise that is established ({noise.rms:.3g} RMS, by {noise.by}) is less than that"


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
    return float(1 / (1 + np.exp(-min(margin, 1400.0) / 2)))


def _moving_share(reference):
    """Share of a record for which the reference moves: its mean power's square over the mean square
    of the power, in stretches."""
    count = max(len(reference) // _STRETCH, 1)
    moving = (reference - reference.mean())[:count * _STRETCH].reshape(count, -1)
    power = np.mean(np.square(moving), axis=1)
    return float(power.mean()**2 / max(np.mean(power**2), 1e-300))


def _certainty(g):
    """Chance that a gain is above zero, as its bootstrap interval has it."""
    std = max((g.ci95[1] - g.ci95[0]) / 3.92, 1e-12)
    return 0.5 + 0.5 * math.erf(g.reduction / std / math.sqrt(2))


def _evidence(cause, g, margin, instead):
    words = [f"held-out error {g.before:.4g} without it, {g.after:.4g} with it "
             f"({g.reduction:.1%} less, 95 % interval {g.ci95[0]:.1%} to {g.ci95[1]:.1%})"]
    if instead:
        words.append(f"nearest rival: {' with '.join(instead)}, fits worse by {margin:.2g} σ²")
    return words


def _moved(engine, best, loose, stds):
    """Findings among the causes that were free: farther from the model than it allows for."""
    findings = []
    for cause, entry in loose.items():
        effect = best.effects[cause]
        farthest = max(abs(getattr(effect, name) - getattr(entry.effect, name))
                       / np.hypot(std, stds[cause].get(name, 0.0))
                       for name, std in entry.std.items())
        if farthest < _MOVED:
            continue
        rows = engine.held_out_rows
        error = (engine.problem.measured - best.output)[rows]
        held = engine.problem.simulate({**best.effects, cause: entry.effect})
        g = gain(error + (best.simulated - held)[rows], error)
        if g.ci95[0] > 0 and g.reduction > _RELEVANT:
            findings.append(Finding(effect, stds[cause], _confidence(farthest**2), [], [
                f"{farthest:.3g} standard uncertainties from the model's own value",
                *_evidence(cause, g, np.inf, [])], g))
    return findings


def _read_off(engine, fitted, found, shown, sensor):
    """Findings that the record shows by itself: limits, lattice, stamps."""
    p, findings = engine.problem, []
    rows = p.record.valid.copy()
    rows[:64] = rows[-64:] = False
    seen = Seen(p.record, found, sensor, p.measured, fitted.output, rows, rows & p.used,
                engine.coarse_step(fitted) is not None)
    # what the size of a residual tells presumes that it is noise, or bursts of it
    parts = engine.structure(fitted)
    is_noise = all(part == "bursts" for _, part in parts) \
        and engine.left(fitted).share <= _MOSTLY_NOISE \
        and _moving_share(p.record.reference[:, p.axis]) > _LASTS
    for cause, cls in known_effects().items():
        recognised = cls.recognised(seen, shown.get(cause)) if cls.read_off else None
        if recognised is None or (cause not in shown and not is_noise):
            continue
        effect, reading = recognised
        g = gain(reading.before, reading.after)
        if g.ci95[0] > 0 and g.reduction > _RELEVANT:
            findings.append(Finding(effect, reading.std, _certainty(g), [], [
                reading.evidence, *_evidence(cause, g, np.inf, [])], g))
    return findings
