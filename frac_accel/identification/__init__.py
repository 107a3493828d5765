"""From a measured pair to a sensor model with standard uncertainties."""

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np

from ..core import Oscillator
from ..effects.offset import Offset
from ..effects.time_delay import TimeDelay
from ..errors import FracAccelError, IdentificationError
from ..model import AXES, SensorModel
from ..pair import Pair, load_pair
from ..parameters import parameter_fields, unit_of
from .arx import FEWEST_COEFFICIENTS, ArxFit, ArxStructure, fit_arx
from .direction import exchanged_instead, judge_direction
from .excitation import ExcitationCheck, learning_length, require_excitation
from .fit_checks import far_apart, require_time_to_answer
from .frequency_response import linear_share
from .measured_response import MeasuredResponse
from .open_parameters import open_combinations
from .output_error import Fit, fit_output_error
from .points import ResponsePoints, response_points
from .prediction import predicted
from .record_checks import RecordCheck, check_record
from .structures import FractionalStructure, OscillatorStructure
from .uncertainty import white_noise

__all__ = ["STRUCTURES", "ExcitationCheck", "Identification", "ResponsePoints", "identify",
           "response_points"]

# A standard uncertainty above this share of its value: the data do not determine the parameter.
_UNDETERMINED = 0.2
# Standard uncertainties by which the damping order must differ from 1 to be called fractional.
_SIGNIFICANT = 3.0
# Share of an oscillator's held-out residual that a model which names no cause may leave.
_CLEARLY = 0.7
# Residual from which on the two topics may belong together in another way.
_POOR = 0.7
_STRUCTURES = {"arx": ArxStructure(), "oscillator": OscillatorStructure(),
               "fractional": FractionalStructure()}
STRUCTURES = ("auto", *_STRUCTURES)


@dataclasses.dataclass(frozen=True)
class Identification:
    """An identified model and what the data say about it.

    Attributes
    ----------
    model : SensorModel
        Ready to be saved; its metadata hold uncertainties, covariance, band and rate.
    structure, reason : str
        Structure of the model, and why it was chosen.
    parameters : dict of str to dict
        ``value``, ``std`` and ``unit`` of each parameter.
    nrmse : float
        RMS of the residual over the standard deviation of the sensor's output.
    held_out_nrmse : float
        The same on the last part of the record with a model fitted to the rest of it alone; NaN
        where that part holds no signal.
    notes : list of str
        What a user must know before trusting the model.
    residual : ndarray, shape (n,)
        Measured less simulated [output units]; NaN where not judged.
    excitation : dict
        ``kind`` of excitation found in the record, and ``words`` for it.
    points : ResponsePoints or None
        Frequency response of the pair without a model; None where the record gives none.
    frequency_domain : dict or None
        The same structure fitted to the points, and how far its parameters are from those above
        (`compare_domains`); None for ARX and without points.
    excitation_check : ExcitationCheck
        How the reference has excited the sensor, and how much of the record counts.
    """

    model: SensorModel
    structure: str
    reason: str
    parameters: dict
    nrmse: float
    held_out_nrmse: float
    notes: list
    residual: np.ndarray
    excitation: dict
    points: ResponsePoints | None
    frequency_domain: dict | None
    excitation_check: ExcitationCheck

    def as_dict(self):
        """Plain numbers, lists and the model's content."""
        return {"model": self.model.to_dict(), "structure": self.structure,
                "reason": self.reason, "parameters": self.parameters,
                "nrmse": self.nrmse, "held_out_nrmse": self.held_out_nrmse, "notes": self.notes,
                "excitation": self.excitation,
                "excitation_check": dataclasses.asdict(self.excitation_check),
                "points": None if self.points is None else self.points.as_dict(),
                "frequency_domain": self.frequency_domain}


def identify(pair, axis="x", structure="auto", provenance=None, progress=None):
    """Identify a sensor model.

    Parameters
    ----------
    pair : Pair, str or Path
        A measured pair, or a bag with one on the default topics.
    axis : {"x", "y", "z"}
    structure : {"auto", "arx", "oscillator", "fractional"}
        Rational transfer function in z, classical seismic sensor, one with a damping of free
        order, or the choice between them: the fractional one only where its order differs from 1 by
        three standard uncertainties and it predicts held-out data better; the one in z, which names
        no cause, only where it predicts them clearly better than both.
    provenance : dict, optional
        Where the data come from; becomes part of the model.
    progress : callable, optional
        Called with a few words before each step that may take seconds.

    Returns
    -------
    Identification

    Raises
    ------
    IdentificationError
        If the data cannot identify the model; says what is missing.
    """
    if structure not in STRUCTURES:
        raise FracAccelError(f"structure: {structure!r} given, expected one of "
                             f"{', '.join(STRUCTURES)}")
    if isinstance(pair, (str, Path)):
        pair = load_pair(pair, axis=axis)
    progress = progress or (lambda words: None)
    require_excitation(pair.reference[:, AXES.index(axis)], pair.sampling_rate_hz,
                       FEWEST_COEFFICIENTS)
    progress("checking the record")
    data = _Data.of(check_record(pair, axis), axis, progress)
    if structure == "auto":
        chosen, reason = _choose(data)
    else:
        chosen, reason = _Candidate.of(structure, data), "asked for"
    return _identification(chosen, reason, data, axis, provenance or {})


@dataclasses.dataclass(frozen=True)
class _Data:
    record: RecordCheck
    pair: Pair
    reference: np.ndarray
    sensor: np.ndarray
    spread: float
    response: MeasuredResponse
    progress: Callable

    @classmethod
    def of(cls, record, axis, progress):
        pair, column = record.pair, AXES.index(axis)
        reference, sensor = pair.reference[:, column], pair.sensor[:, column]
        progress("measuring the frequency response")
        return cls(record, pair, reference, sensor, float(np.std(sensor[pair.valid])),
                   MeasuredResponse.of(pair, axis), progress)

    def fit(self, structure, part=slice(None), start=None):
        if start is None:
            start = self.response.start(structure)
        record = (self.reference[part], self.sensor[part], self.pair.sampling_rate_hz,
                  self.pair.valid[part], self.pair.lag_s, start)
        if isinstance(structure, ArxStructure):
            return fit_arx(*record)
        return fit_output_error(structure, *record)


@dataclasses.dataclass(frozen=True)
class _Candidate:
    """A structure fitted to all data, and judged on data that a second fit has not seen."""

    structure: object
    name: str
    fit: Fit | ArxFit
    nrmse: float
    held_out_nrmse: float

    @classmethod
    def of(cls, name, data):
        structure = _STRUCTURES[name]
        require_excitation(data.reference, data.pair.sampling_rate_hz, _coefficients(structure))
        data.progress(f"fitting the {name} structure")
        try:
            fit = data.fit(structure)
        except IdentificationError as error:
            record = data.reference, data.sensor, data.pair
            raise exchanged_instead(*record) or far_apart(*record) or error from None
        data.progress(f"judging the {name} structure on held-out data")
        return cls(structure, name, fit, fit.rmse / data.spread, _held_out(structure, fit, data))


def _coefficients(structure):
    """Parameters that the excitation must suffice for: also sensitivity and delay."""
    return max(len(structure.names) + 2, FEWEST_COEFFICIENTS)


def _choose(data):
    """The best of the structures, and why."""
    chosen, best, reason = _choose_oscillator(data)
    if linear_share(data.reference, chosen.fit.residual) < 1 - _CLEARLY**2:
        return chosen, reason
    try:
        arx = _Candidate.of("arx", data)
    except IdentificationError:
        return chosen, reason
    held_out = f"held-out residual {arx.held_out_nrmse:.3%} against {best:.3%}"
    if not arx.held_out_nrmse < _CLEARLY * best:
        return chosen, (f"{reason}; a free transfer function in z does not predict clearly better: "
                        f"{held_out}")
    return arx, ("it predicts clearly better than an oscillator with classical or fractional "
                 f"damping: {held_out}; something else acts, which its coefficients cannot name")


def _choose_oscillator(data):
    """The better of classical and fractional, the smallest held-out residual, and why."""
    classical = _Candidate.of("oscillator", data)
    try:
        fractional = _Candidate.of("fractional", data)
    except IdentificationError as error:
        return classical, classical.held_out_nrmse, f"the data cannot tell more: {error}"
    best = min(classical.held_out_nrmse, fractional.held_out_nrmse)
    order = fractional.fit["damping_order"]
    std = fractional.fit.std[fractional.fit.names.index("damping_order")]
    score = f"damping order {order:.4g} +- {std:.2g}"
    held_out = (f"held-out residual {fractional.held_out_nrmse:.3%} against "
                f"{classical.held_out_nrmse:.3%} of the classical model")
    if abs(order - 1) <= _SIGNIFICANT * std:
        return classical, best, f"a fractional damping is not significant: {score}"
    if not fractional.held_out_nrmse < classical.held_out_nrmse:
        return classical, best, f"a fractional damping does not predict better: {held_out}"
    return fractional, best, f"{score} differs from 1; {held_out}"


def _identification(chosen, reason, data, axis, provenance):
    fit, rate = chosen.fit, data.pair.sampling_rate_hz
    suspicions = _require_plausible(chosen, data)
    excitation = ExcitationCheck.of(data.record, data.reference, data.sensor,
                                    _coefficients(chosen.structure))
    parameters = {name: {"value": float(value), "std": float(std), "unit": _unit(name)}
                  for name, value, std in zip(fit.names, fit.values, fit.std)}
    compared, more = data.response.compared(chosen.structure, fit)
    notes = (data.record.notes + suspicions + _notes(parameters, chosen, data, excitation.band_hz)
             + data.response.notes + more)
    effects = [TimeDelay(fit["delay_s"])]
    if abs(fit["offset"]) > _SIGNIFICANT * parameters["offset"]["std"]:
        effects.append(Offset(fit["offset"]))
    model = SensorModel(chosen.structure.core(fit), effects, metadata={
        "uncertainties": {name: {"std": entry["std"], "unit": entry["unit"]}
                          for name, entry in parameters.items()},
        "covariance": {"parameters": list(fit.names), "matrix": fit.covariance.tolist()},
        "band_hz": list(excitation.band_hz),
        "sampling_rate_hz": rate,
        "noise_std": white_noise(fit.residual),
        "provenance": {"axis": axis, "structure": chosen.name, "reason": reason, **provenance},
        "validation": {"nrmse": chosen.nrmse, "held_out_nrmse": chosen.held_out_nrmse,
                       "notes": notes},
        **({"continuous_equivalent": fit.continuous_equivalent()}
           if isinstance(fit, ArxFit) else {}),
    })
    return Identification(model, chosen.name, reason, parameters, chosen.nrmse,
                          chosen.held_out_nrmse, notes, fit.residual, data.response.excitation,
                          data.response.points, compared, excitation)


def _require_plausible(chosen, data):
    """Refuse a fit that no sensor can be behind; notes on what is suspicious."""
    fit, record = chosen.fit, (data.reference, data.sensor, data.pair)
    apart = far_apart(*record) if chosen.nrmse > _POOR else None
    if apart is not None:
        raise apart
    require_time_to_answer(fit, data.pair)
    data.progress("judging the direction from reference to sensor")
    return judge_direction(fit, *record)


def _unit(name):
    """Unit of a parameter, from the class that declares it."""
    if name[1:].isdigit():
        return {"a": "1", "b": unit_of(Oscillator, "sensitivity")}[name[0]]
    return next(unit_of(cls, name) for cls in (Oscillator, TimeDelay, Offset)
                if name in (field.name for field in parameter_fields(cls)))


def _held_out(structure, fit, data):
    """Residual on the last part of the record of a model fitted to the rest alone."""
    pair = data.pair
    split = learning_length(data.reference, pair.valid)
    rest = slice(split, None)
    if min(pair.valid[:split].sum(), pair.valid[rest].sum()) < 256:
        return float("nan")
    try:
        learnt = data.fit(structure, slice(split), start=fit.unknowns)
        # over the whole record, so that the held-out part begins with its true history
        simulated = predicted(structure, learnt, data.reference, pair.sampling_rate_hz, pair.lag_s)
    except FracAccelError:
        return float("nan")
    error = (data.sensor - simulated)[rest][pair.valid[rest]]
    spread = np.std(data.sensor[rest][pair.valid[rest]])
    # without its mean: motion long before the record still shows there as a constant
    return float(np.std(error) / spread) if spread > 0 else float("nan")


def _notes(parameters, chosen, data, band_hz):
    fit, nrmse, held_out = chosen.fit, chosen.nrmse, chosen.held_out_nrmse
    notes = fit.notes() if isinstance(fit, ArxFit) else [
        *_seismic_notes(parameters, chosen, band_hz[1]),
        *open_combinations(fit, band_hz, data.pair.sampling_rate_hz)]
    noise = white_noise(fit.residual)
    if nrmse > 1e-3 and fit.rmse > 3 * noise:
        notes.append(f"the model leaves {nrmse:.2%} of the output unexplained, while its white "
                     f"noise is {noise / data.spread:.2%}: something real is missing from it")
    if np.isfinite(held_out) and held_out > max(2 * nrmse, 1e-3):
        notes.append(f"held-out data are predicted worse ({held_out:.2%}) than the fitted "
                     f"({nrmse:.2%})")
    return notes


def _seismic_notes(parameters, chosen, highest):
    """What the data leave open of an oscillator."""
    notes = []
    for name in ("sensitivity", *chosen.structure.names):
        entry = parameters[name]
        if entry["std"] > _UNDETERMINED * abs(entry["value"]):
            share = entry["std"] / abs(entry["value"])
            size = f"{share:.0%} of" if share < 10 else "more than ten times"
            notes.append(f"{name} is not determined by these data (standard uncertainty {size} "
                         "its value)")
    resonance = parameters["natural_frequency_hz"]["value"]
    if highest < resonance / 3:
        notes.append(f"the excitation ends at {highest:.4g} Hz, far below the resonance at "
                     f"{resonance:.4g} Hz; the model holds only up to there")
    return notes
