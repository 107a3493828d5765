"""From fitted causes to a verdict: what is named, what is not, and why."""

import dataclasses
import math

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import resample_poly

from ..effects import known_effects
from ..model import AXES, AxisModel, SensorModel
from ..pair import clean
from ..parameters import parameter_fields
from ..shown import Shown
from .evidence import Evidence
from .experiments import separating_experiment
from .gain import gain

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
        return {"cause": self.cause, "parameters": parameters, "confidence": self.confidence,
                "confusable_with": self.confusable_with, "evidence": self.evidence,
                "explanation": self.effect.explanation, "gain": self.gain.as_dict()}


@dataclasses.dataclass(frozen=True)
class Diagnosis(Shown):
    """What was found about one axis.

    Attributes
    ----------
    verdict : str
        consistent, explained, partly_explained, unexplained or insufficient_data.
    reason : str
        The verdict in words.
    baseline, extended : dict of str to float
        ``rmse``, ``nrmse`` on held-out data, ``noise_rms`` [output units].
    findings : list of Finding
    suspects : list of dict
        ``causes`` that the data cannot tell apart, their ``margin`` in variances of the noise, and
        the ``experiment`` that would.
    unexplained_fraction : float
        What remains above the noise, over the baseline's excess above it (in power).
    model : SensorModel
        The model in use, extended by what was found.
    integrity : Integrity
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

    def __repr__(self):
        causes = ", ".join(finding.cause for finding in self.findings)
        return f"<Diagnosis: {self.verdict}{': ' if causes else ''}{causes}; {self.reason}>"

    def _draw(self, figure):
        if self.evidence is not None:
            self.evidence.draw(figure)

    def as_dict(self, model_file=None):
        """As the result file has it."""
        return {"verdict": self.verdict, "reason": self.reason, "baseline": self.baseline,
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
        stamps, _ = clean(self.sensor)
        rate = self.record.sampling_rate_hz
        place = (stamps - self.record.start_ns) * 1e-9 * rate
        slot = np.round(place).astype(int)
        good = (slot >= 0) & (slot < len(self.output))
        fine = resample_poly(self.output, 4, 1)
        spline = CubicSpline(np.arange(len(fine)) / 4, fine)
        return slot[good], spline(np.clip(place[good] - self.record.lag_s * rate, 0,
                                          len(self.output) - 1))


def judge(engine, best, found, shown, loose, sensor):
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

    Returns
    -------
    Diagnosis
    """
    base = engine.search.base
    gains = {}
    while True:
        gains = {cause: engine.held_out(best, cause)
                 for cause in best.effects if cause not in base}
        idle = [cause for cause, g in gains.items()
                if g.reduction < _RELEVANT or g.ci95[0] <= 0]
        if not idle:
            break
        less = engine.search.without(best, min(idle, key=lambda cause: gains[cause].reduction))
        best = engine.search.fit(less.effects)
    left = engine.left(best)
    stds = engine.uncertainties(best)
    findings, suspects = [], []
    for cause, g in gains.items():
        rivals = engine.rivals(best, cause)
        margin, other = rivals[0] if rivals else (np.inf, frozenset())
        instead = sorted(other - best.causes)
        entry = Finding(best.effects[cause], stds[cause], _confidence(margin),
                        instead if margin < 10 * _CLEAR else [],
                        _evidence(cause, g, margin, instead), g)
        if margin > _CLEAR:
            findings.append(entry)
        else:
            suspects.append(_suspect({cause, *instead}, margin))
    findings += _moved(engine, best, loose, stds)
    findings += _read_off(engine, best, found, shown, sensor)
    return _verdict(engine, best, left, findings, suspects, found)


def _suspect(causes, margin):
    return {"causes": sorted(causes), "margin": float(margin),
            "experiment": separating_experiment(causes)}


def _verdict(engine, best, left, findings, suspects, found):
    p = engine.problem
    rest = engine.held_out_rows
    measured = p.measured[rest]
    spread = float(np.std(measured))
    baseline = engine.search.fit(engine.search.base)
    errors = {"baseline": _rms(p.measured - baseline.output, rest),
              "extended": _rms(p.measured - engine.learnt(best).output, rest)}
    noise = left.noise_rms
    excess = max(baseline.cost / p.count - noise**2, 0.0)
    remains = max(best.cost / p.count - noise**2, 0.0)
    # differences that chance makes are no remains
    fraction = remains / excess if left.share > 0 and excess > 0 else 0.0
    if left.share > 0:
        # something is left, which the causes may have been bent by, or mistaken for
        doubtful = {f.cause for f in findings if f.cause in best.effects
                    and (fraction > _LEFT or engine.unsteadiness(best, f.cause) > _STEADY)}
        suspects += [_suspect({cause}, 0.0) for cause in sorted(doubtful)]
        findings = [f for f in findings if f.cause not in doubtful]
    named = {f.cause for f in findings}
    complete = {c for c in best.effects if c not in engine.search.base} <= named
    if not findings and not suspects and left.share == 0:
        verdict, reason = "consistent", "the model explains the record down to its noise"
    elif findings and complete and left.share <= _MOSTLY_NOISE:
        verdict, reason = "explained", "the named causes explain the record down to its noise"
    elif findings:
        verdict, reason = "partly_explained", "the named causes leave a part unexplained"
    else:
        verdict, reason = "unexplained", "no known cause explains what the model gets wrong"
    fitted = best
    if not complete:
        # what is not named is not in the model, and the rest is fitted without it
        fitted = engine.search.fit({c: e for c, e in best.effects.items()
                                    if c in named or c in engine.search.base})
        stds = engine.uncertainties(fitted)
        findings = [dataclasses.replace(f, effect=fitted.effects[f.cause], std=stds[f.cause])
                    if f.cause in fitted.effects else f for f in findings]
        errors["extended"] = _rms(p.measured - engine.learnt(fitted).output, rest)
        remains = max(fitted.cost / p.count - noise**2, 0.0)
        fraction = remains / excess if excess > 0 else 0.0
    model = _extended(engine, {**fitted.effects, **{f.cause: f.effect for f in findings}})
    return Diagnosis(
        verdict, reason,
        {"rmse": errors["baseline"], "nrmse": errors["baseline"] / spread, "noise_rms": noise},
        findings, suspects,
        {"rmse": errors["extended"], "nrmse": errors["extended"] / spread},
        float(min(fraction, 1.0)), model, found,
        Evidence.of(engine, best, {f.cause: f.effect for f in findings}))


def _extended(engine, effects):
    """The model in use with these causes on the diagnosed axis."""
    p = engine.problem
    own = p.axis_model(effects)
    common = {cause: effect for cause, effect in effects.items() if effect.common_to_axes}
    axes = {name: p.axis_model(common, i) for i, name in enumerate(AXES)}
    axes[AXES[p.axis]] = AxisModel(own.core, own.effects)
    return SensorModel(p.baseline.core, p.baseline.effects, axes, p.baseline.metadata)


def _rms(error, rows):
    return float(np.sqrt(np.mean(error[rows]**2)))


def _confidence(margin):
    return float(1 / (1 + np.exp(-min(margin, 1400.0) / 2)))


def _certainty(g):
    """Chance that a gain is above zero, as its bootstrap interval has it."""
    std = max((g.ci95[1] - g.ci95[0]) / 3.92, 1e-12)
    return 0.5 + 0.5 * math.erf(g.reduction / std / math.sqrt(2))


def _evidence(cause, g, margin, instead):
    words = [f"held-out error {g.before:.4g} without it, {g.after:.4g} with it "
             f"({g.reduction:.1%} less, 95 % interval {g.ci95[0]:.1%} to {g.ci95[1]:.1%})"]
    if instead:
        words.append(f"nearest rival: {' with '.join(instead)}, behind by {margin:.4g} variances "
                     "of the noise")
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
                f"{farthest:.3g} standard uncertainties from what the model allows for",
                *_evidence(cause, g, np.inf, [])], g))
    return findings


def _read_off(engine, best, found, shown, sensor):
    """Findings that the record shows by itself: limits, lattice, stamps."""
    p, findings = engine.problem, []
    rows = p.record.valid.copy()
    rows[:64] = rows[-64:] = False
    seen = Seen(p.record, found, sensor, p.measured, best.output, rows, rows & p.used,
                engine.coarse_step(best) is not None)
    for cause, cls in known_effects().items():
        recognised = cls.recognised(seen, shown.get(cause)) if cls.read_off else None
        if recognised is None:
            continue
        effect, reading = recognised
        g = gain(reading.before, reading.after)
        if g.ci95[0] > 0 and g.reduction > _RELEVANT:
            findings.append(Finding(effect, reading.std, _certainty(g), [], [
                reading.evidence, *_evidence(cause, g, np.inf, [])], g))
    return findings
