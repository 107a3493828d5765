"""What a diagnosis finds, as plain data."""

import dataclasses

from ..model.parameters import fixed_values, parameter_fields
from ..shown import Shown
from .evidence import Evidence
from .words import AS_NOISE


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
        units = {field.name: field.metadata["unit"] for field in parameter_fields(type(self.effect))
                 if field.metadata.get("fixed")}
        parameters.update({name: {"value": value, "std": 0.0, "unit": units.get(name, "")}
                           for name, value in fixed_values(self.effect).items()
                           if name not in self.std})
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
    screened : dict or None
        Where asked for, ``estimates`` of every cause on its own beside the model in use, to first
        order, and the ``correlations`` of their effects (`Screen`): for pooling over many records.
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
    screened: dict | None = None

    def __repr__(self):
        causes = ", ".join(finding.cause for finding in self.findings)
        return f"<Diagnosis: {self.verdict}{': ' if causes else ''}{causes}; {self.reason}>"

    @property
    def is_extended(self):
        """Whether the extended model is another one than the model in use."""
        return bool(self.findings) or self.extended["rmse"] < self.baseline["rmse"]

    @property
    def noise_words(self):
        """How much of what the model in use leaves is noise."""
        known = self.established_noise
        return f"{known['rms']:.4g} is noise, by {known['by']}" if known["by"] \
            else f"{self.baseline['noise_rms']:.4g} may be noise"

    def shares(self, of):
        """Parts of what a model ("baseline" or "extended") leaves, in words, and their shares.

        Of what nothing predicts only what is established is noise.
        """
        shares = {entry["part"]: entry["share"] for entry in self.budget if entry["of"] == of}
        open_share, rmse = shares.get("noise", 0.0), getattr(self, of)["rmse"]
        noise = min(open_share, (self.baseline["noise_rms"] / rmse)**2) \
            if self.established_noise["by"] and rmse > 0 else 0.0
        if open_share > AS_NOISE**2 * noise:
            shares |= {"noise": noise, "that nothing predicts": open_share - noise}
        return shares

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
                "evidence": self.evidence.as_dict() if self.evidence is not None else None,
                **({"screened": self.screened} if self.screened is not None else {})}

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
