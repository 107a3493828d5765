"""From fitted causes to a verdict: what is named, what is not, and why."""

import dataclasses

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import resample_poly

from ..effects import known_effects
from ..model import AXES, AxisModel, SensorModel
from ..pair import clean
from ..parameters import parameter_fields
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
        Weight of the sets of causes with this one among all that were fitted.
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
class Diagnosis:
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
    engine: object = None
    best: object = None

    def as_dict(self, model_file=None):
        """As the result file has it."""
        return {"verdict": self.verdict, "reason": self.reason, "baseline": self.baseline,
                "findings": [finding.as_dict() for finding in self.findings],
                "suspects": self.suspects,
                "extended": {**self.extended, "model": model_file},
                "unexplained_fraction": self.unexplained_fraction,
                "integrity": self.integrity.words}


def insufficient(reason, model, found):
    """Diagnosis of data that cannot tell."""
    nan = float("nan")
    errors = {"rmse": nan, "nrmse": nan}
    return Diagnosis("insufficient_data", reason, {**errors, "noise_rms": nan}, [], [], errors, nan,
                     model, found)


@dataclasses.dataclass(frozen=True)
class Loose:
    """A cause that stays free in every fit, because the model in use leaves it open.

    Attributes
    ----------
    effect : Effect
        What the model in use says.
    std : dict of str to float
        How well it knows that, by parameter; infinite where not at all.
    """

    effect: object
    std: dict


def judge(engine, best, found, fixed, loose, sensor):
    """Verdict on the best set of causes.

    Parameters
    ----------
    engine : Engine
    best : Fitted
    found : Integrity
    fixed : dict of str to Effect
        Causes read off the record.
    loose : dict of str to Loose
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
    findings += _read_off(engine, best, found, fixed, sensor)
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
        float(min(fraction, 1.0)), model, found, engine, best)


def _extended(engine, effects):
    """The model in use with these causes on the diagnosed axis."""
    p = engine.problem
    own = p.axis_model(effects)
    # the stamps, and with them the clock, are the same for all axes
    clock = {cause: effect for cause, effect in effects.items() if effect.clock_ratio() != 1}
    axes = {name: p.axis_model(clock, i) for i, name in enumerate(AXES)}
    axes[AXES[p.axis]] = AxisModel(own.core, own.effects)
    return SensorModel(p.baseline.core, p.baseline.effects, axes, p.baseline.metadata)


def _rms(error, rows):
    return float(np.sqrt(np.mean(error[rows]**2)))


def _confidence(margin):
    return float(1 / (1 + np.exp(-min(margin, 1400.0) / 2)))


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
            findings.append(Finding(effect, stds[cause], 0.999, [], [
                f"{farthest:.3g} standard uncertainties from what the model allows for",
                *_evidence(cause, g, np.inf, [])], g))
    return findings


def _read_off(engine, best, found, fixed, sensor):
    """Findings that the record shows by itself: limits, lattice, stamps."""
    p, known = engine.problem, known_effects()
    # clipped samples count here, and nothing was fitted: all samples do
    rows = p.record.valid.copy()
    rows[:64] = rows[-64:] = False
    output, findings = best.output, []

    def add(effect, std, before, after, evidence):
        g = gain(before, after)
        if g.ci95[0] > 0 and g.reduction > _RELEVANT:
            findings.append(Finding(effect, std, 0.999, [], [evidence, *_evidence(
                effect.cause, g, np.inf, [])], g))

    if "clipping" in fixed:
        limits = fixed["clipping"]
        resolution = (found.step or 0.0) / np.sqrt(12)
        add(limits, {"lower": resolution, "upper": resolution},
            (p.measured - output)[rows],
            (p.measured - np.clip(output, limits.lower, limits.upper))[rows],
            "; ".join(words for words in found.words if "limit" in words))
    if engine.coarse_step(best):
        coarse = found.step * np.round(output / found.step)
        free = rows & p.used
        add(known["quantization"](found.step), {"step": 1e-6 * found.step},
            (p.measured - output)[free], (p.measured - coarse)[free],
            next(words for words in found.words if "multiples" in words))
    if found.jitter_rms_s:
        slot, values = _at_stamps(output, p.record, sensor)
        inside = rows[slot] & p.used[slot]
        slot, values = slot[inside], values[inside]
        add(known["timestamp_jitter"](found.jitter_rms_s),
            {"rms_s": found.jitter_rms_s / np.sqrt(2 * found.samples)},
            p.measured[slot] - values, p.measured[slot] - output[slot],
            next(words for words in found.words if "scatter" in words))
    if found.missing:
        counted = np.flatnonzero(p.record.valid)
        here = np.arange(len(counted))
        late = rows[counted] & p.used[counted]
        fraction = found.dropped_fraction
        add(known["dropped_samples"](fraction),
            {"fraction": np.sqrt(fraction * (1 - fraction) / (found.samples + found.missing))},
            (p.measured[counted] - output[here])[late],
            (p.measured - output)[counted][late],
            next(words for words in found.words if "missing" in words))
    return findings


def _at_stamps(simulated, record, sensor):
    """Instants with a sample, and the simulated output at the stamps that these carry."""
    stamps, _ = clean(sensor)
    place = (stamps - record.start_ns) * 1e-9 * record.sampling_rate_hz
    slot = np.round(place).astype(int)
    good = (slot >= 0) & (slot < len(simulated))
    fine = resample_poly(simulated, 4, 1)
    spline = CubicSpline(np.arange(len(fine)) / 4, fine)
    return slot[good], spline(np.clip(place[good] - record.lag_s * record.sampling_rate_hz, 0,
                                      len(simulated) - 1))
