"""An identified model with everything that the data say about it."""

import dataclasses

import numpy as np

from ..errors import FracAccelError, ModelError
from ..model import SensorModel
from ..model.core import Oscillator
from ..model.effects import IDENTIFIED, fault_of_reference, identified_effect
from ..model.parameters import parameter_fields, plain, rebuilt, unit_of
from ..shown import Shown, above, plain_logarithms
from .evidence import Evidence
from .fit.arx import ArxFit
from .fit.uncertainty import SIGNIFICANT, beyond_noise, noise_floor
from .judge.candidate import needed_order, suspicions
from .judge.fit_validation import FitValidation, fit_validation, judge_residual
from .judge.notes import candidate_notes
from .response.excitation import Excitation
from .response.points import ResponsePoints


@dataclasses.dataclass(frozen=True)
class Identification(Shown):
    """An identified model and what the data say about it.

    What belongs to one record is, of several records, that of the first.

    Attributes
    ----------
    model : SensorModel
        Ready to be saved; its metadata hold uncertainties, covariance, band and rate.
    structure, reason : str
        Structure of the model, and why it was chosen.
    parameters : dict of str to dict
        ``value``, ``std`` and ``unit`` of each parameter.
    nrmse : float
        RMS of the residual over the standard deviation of the sensor's output; of several records
        that of their common model, in quadratic mean.
    held_out_nrmse : float
        The same on the last part of the record with a model fitted to the rest of it alone; NaN
        where that part holds no signal. Of several records: of each with the others' models.
    notes : list of str
        What a user must know before trusting the model.
    validation : FitValidation
        Residual tests, held-out data by octaves, agreement of the records, and the verdict.
    evidence : Evidence
        Signals, residual and spectra, as they are drawn.
    excitation : Excitation
        How the reference has excited the sensor, and how much of the record counts.
    points : ResponsePoints or None
        Frequency response of the pair without a model; None where the record gives none.
    frequency_domain : dict or None
        The same structure fitted to the points, and how far its parameters are from those above
        (`compare_domains`); None for ARX and without points.
    """

    model: SensorModel
    structure: str
    reason: str
    parameters: dict
    nrmse: float
    held_out_nrmse: float
    notes: list
    validation: FitValidation
    evidence: Evidence
    excitation: Excitation
    points: ResponsePoints | None
    frequency_domain: dict | None

    @property
    def fitted_effects(self):
        """Effects by cause that were fitted beside the core: a late reference as the sensor's lead.
        """
        delay = identified_effect("delay_s", self.parameters["delay_s"]["value"])
        return {**{effect.cause: effect for effect in self.model.effects}, delay.cause: delay}

    def __repr__(self):
        values = ", ".join(f"{name} {entry['value']:.5g} ± {entry['std']:.2g}"
                           for name, entry in list(self.parameters.items())[:4])
        return f"<Identification: {self.structure}: {values}; residual {self.nrmse:.2%}>"

    def _draw(self, figure):
        band = self.model.band_hz or (1.0, 1000.0)
        frequency = np.geomspace(max(band[0], 1e-3 * band[1]), band[1], 400)
        response = self.model.frequency_response(frequency, self.evidence.axis)
        upper, lower = figure.subplots(2, sharex=True)
        upper.loglog(frequency, np.abs(response), label="model")
        lower.semilogx(frequency, np.degrees(np.unwrap(np.angle(response))))
        if self.points is not None:
            measured = self.points.response
            upper.loglog(self.points.frequency_hz, np.abs(measured), ".", label="measured")
            lower.semilogx(self.points.frequency_hz, np.degrees(np.angle(measured)), ".")
        above(upper)
        for axes in (upper, lower):
            plain_logarithms(axes)
        upper.set_ylabel("amplitude [output units per m/s²]")
        lower.set(xlabel="frequency [Hz]", ylabel="phase [°]")

    def as_dict(self):
        """Plain numbers, lists and the model's content, as the result file has them."""
        fields = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        return plain({**fields, "model": self.model.to_dict(),
                      "validation": self.validation.as_dict(),
                      "evidence": dataclasses.asdict(self.evidence),
                      "excitation": dataclasses.asdict(self.excitation),
                      "points": self.points and dataclasses.asdict(self.points)})

    @classmethod
    def from_dict(cls, data):
        """Inverse of `as_dict`; null stands for numbers that are none.

        Raises
        ------
        FracAccelError
            If it is no result of an identification.
        """
        if not isinstance(data, dict) or not {"structure", "evidence"} <= data.keys():
            raise FracAccelError("no result of an identification that holds its evidence, expected "
                                 "what frac_accel identify --json writes")
        try:
            compared = data["frequency_domain"]
            return cls(**{
                **{field.name: data[field.name] for field in dataclasses.fields(cls)},
                "model": SensorModel.from_dict(data["model"]),
                "parameters": _quantities(data["parameters"]),
                "nrmse": _number(data["nrmse"]),
                "held_out_nrmse": _number(data["held_out_nrmse"]),
                "validation": FitValidation.from_dict(data["validation"]),
                "evidence": Evidence.from_dict(data["evidence"]),
                "excitation": rebuilt(Excitation, {  # older ones have one band
                    "excited_hz": data["excitation"]["band_hz"], **data["excitation"]}),
                "points": data["points"] and ResponsePoints.from_dict(data["points"]),
                "frequency_domain": compared and {
                    **compared, "parameters": _quantities(compared["parameters"])}})
        except ModelError:
            raise
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise FracAccelError("no complete result of an identification: "
                                 f"{type(error).__name__}: {error}") from None


def identification(chosen, reason, datas, records, axis, provenance, agreeing=None):
    """Identification from the chosen candidate.

    Parameters
    ----------
    chosen : Candidate
    reason : str
    datas : list of Data
    records : list of str
        Their names.
    axis : {"x", "y", "z"}
    provenance : dict
    agreeing : RecordAgreement, optional

    Returns
    -------
    Identification

    Raises
    ------
    IdentificationError
        If no sensor can be behind the fit.
    """
    fit, data = chosen.fit, datas[0]
    rate = data.pair.sampling_rate_hz
    doubts = [(data.record.notes + suspicions(own, data)) for own, data in zip(chosen.fits, datas)]
    excitation = Excitation.of(data.record, data.reference, data.sensor, data.order,
                               needed_order(chosen.structure), data.response.excitation)
    parameters = {name: {"value": float(value), "std": float(std), "unit": _unit(name)}
                  for name, value, std in zip(fit.names, fit.values, fit.std)}
    compared, more = data.response.compared(chosen.structure, chosen.fits[0])
    notes = _named(doubts, records) + candidate_notes(parameters, chosen, data,
                                                      excitation.band_hz)
    notes += data.response.notes + more
    own = chosen.fits[0]
    tests = judge_residual(chosen.structure.core(own), own, data.reference, data.pair)
    validation = fit_validation(tests, own.rmse / data.spread,
                                chosen.held_out.bands(rate, *excitation.band_hz), agreeing)
    delay, faults = identified_effect("delay_s", fit["delay_s"]), []
    if _is_the_references(parameters["delay_s"], datas):
        faults = [fault_of_reference(delay)]
        delay = identified_effect("delay_s", 0.0)
        notes.append(f"the delay of {fit['delay_s']:.4g} s stands in the model as one of the "
                     f"reference ({-fit['delay_s']:.4g} s): nothing is taken out of the sensor's "
                     "stamps")
    noise_std = max(noise_floor(fit.residual), fit.noise_std)
    model_error = beyond_noise(chosen.held_out_nrmse, noise_std / data.spread)
    effects = [delay]
    if abs(fit["offset"]) > SIGNIFICANT * parameters["offset"]["std"]:
        effects.append(identified_effect("offset", fit["offset"]))
    model = SensorModel(chosen.structure.core(fit), effects, metadata={
        "uncertainties": {name: {"std": entry["std"], "unit": entry["unit"]}
                          for name, entry in parameters.items()},
        "covariance": {"parameters": list(fit.names), "matrix": fit.covariance.tolist()},
        "band_hz": list(excitation.band_hz),
        "sampling_rate_hz": rate,
        "noise_std": noise_std,
        **({"model_error": model_error} if model_error else {}),
        "provenance": {"axis": axis, "structure": chosen.name, "reason": reason, **provenance},
        "validation": {"nrmse": chosen.nrmse, "held_out_nrmse": chosen.held_out_nrmse,
                       "notes": notes, **validation.essentials()},
        **({"continuous_equivalent": fit.continuous_equivalent()}
           if isinstance(fit, ArxFit) else {}),
    }, reference_faults=faults)
    return Identification(model, chosen.name, reason, parameters, chosen.nrmse,
                          chosen.held_out_nrmse, notes, validation,
                          Evidence.of(data, fit.residual), excitation,
                          data.response.points, compared)


def _is_the_references(delay, datas):
    """Whether the sensor shows the motion before the reference, in every record and by the fit."""
    return delay["value"] < -SIGNIFICANT * delay["std"] \
        and all(data.pair.is_reference_late for data in datas)


def _number(value):
    return np.nan if value is None else float(value)


def _quantities(entries):
    return {name: {**entry, "value": _number(entry["value"]), "std": _number(entry["std"])}
            for name, entry in entries.items()}


def _named(notes, records):
    """Each record's notes in one list, with its name where there are several."""
    if len(notes) == 1:
        return list(notes[0])
    return [f"{name}: {note}" for name, own in zip(records, notes) for note in own]


def _unit(name):
    """Unit of a parameter, from the class that declares it."""
    if name[1:].isdigit():
        return {"a": "1", "b": unit_of(Oscillator, "sensitivity")}[name[0]]
    # orders and ratios of the general equation belong to no class; they have no unit
    return next((unit_of(cls, name) for cls in (Oscillator, *IDENTIFIED.values())
                 if name in (field.name for field in parameter_fields(cls))), "1")
