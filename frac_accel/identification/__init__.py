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
from ..simulation import simulate
from .arx import FEWEST_COEFFICIENTS, ArxFit, ArxStructure, fit_arx
from .excitation import excited_band, learning_length, require_excitation
from .output_error import Fit, fit_output_error
from .structures import (
    FractionalStructure,
    FractionalTransferFunctionStructure,
    OscillatorStructure,
)

__all__ = ["STRUCTURES", "Identification", "identify"]

# A standard uncertainty above this share of its value: the data do not determine the parameter.
_UNDETERMINED = 0.2
# Standard uncertainties by which the damping order must differ from 1 to be called fractional.
_SIGNIFICANT = 3.0
# Likelihood ratio that two superfluous parameters reach in one of twenty records: chi-squared.
_LIKELIHOOD_RATIO = 6.0
_STRUCTURES = {"arx": ArxStructure(), "oscillator": OscillatorStructure(),
               "fractional": FractionalStructure(),
               "fractional_transfer_function": FractionalTransferFunctionStructure()}
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
    """

    model: SensorModel
    structure: str
    reason: str
    parameters: dict
    nrmse: float
    held_out_nrmse: float
    notes: list

    def as_dict(self):
        """Plain numbers, lists and the model's content."""
        return {"model": self.model.to_dict(), "structure": self.structure,
                "reason": self.reason, "parameters": self.parameters,
                "nrmse": self.nrmse, "held_out_nrmse": self.held_out_nrmse, "notes": self.notes}


def identify(pair, axis="x", structure="auto", provenance=None, progress=None):
    """Identify a sensor model.

    Parameters
    ----------
    pair : Pair, str or Path
        A measured pair, or a bag with one on the default topics.
    axis : {"x", "y", "z"}
    structure : {"auto", "arx", "oscillator", "fractional", "fractional_transfer_function"}
        Rational transfer function in z, classical seismic sensor, one with a damping of free
        order, or the general equation with two free orders on the left and, where the data call
        for it, a slope term of free order on the right. ``auto`` chooses between classical and
        fractional: the fractional one only where its order differs from 1 by three standard
        uncertainties and it predicts held-out data better.
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
    data = _Data.of(pair, AXES.index(axis), progress or (lambda words: None))
    if structure == "auto":
        chosen, reason = _choose(data)
    else:
        chosen, reason = _Candidate.of(structure, data), "asked for"
    return _identification(chosen, reason, data, axis, provenance or {})


@dataclasses.dataclass(frozen=True)
class _Data:
    pair: Pair
    reference: np.ndarray
    sensor: np.ndarray
    spread: float
    progress: Callable

    @classmethod
    def of(cls, pair, column, progress):
        sensor = pair.sensor[:, column]
        return cls(pair, pair.reference[:, column], sensor, float(np.std(sensor)), progress)

    def fit(self, structure, part=slice(None), start=None, uncertainty=True):
        record = (self.reference[part], self.sensor[part], self.pair.sampling_rate_hz,
                  self.pair.valid[part], self.pair.lag_s, start)
        if isinstance(structure, ArxStructure):
            return fit_arx(*record)
        return fit_output_error(structure, *record, uncertainty)


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
        require_excitation(data.reference, data.pair.sampling_rate_hz,
                           max(len(structure.names) + 2, FEWEST_COEFFICIENTS))
        data.progress(f"fitting the {name} structure")
        structure, fit = _fitted(structure, data)
        data.progress(f"judging the {name} structure on held-out data")
        return cls(structure, name, fit, fit.rmse / data.spread, _held_out(structure, fit, data))


def _fitted(structure, data):
    """A structure and its fit, or a simpler one's where the likelihoods hardly differ."""
    fit = data.fit(structure)
    simpler = None if isinstance(fit, ArxFit) else structure.simpler(fit.unknowns)
    if simpler:
        other = data.fit(simpler[0], start=simpler[1])
        ratio = 2 * np.isfinite(fit.residual).sum() * np.log(other.rmse / fit.rmse)
        if ratio < _LIKELIHOOD_RATIO:
            return simpler[0], other
    return structure, fit


def _choose(data):
    """The better of classical and fractional, and why."""
    classical = _Candidate.of("oscillator", data)
    try:
        fractional = _Candidate.of("fractional", data)
    except IdentificationError as error:
        return classical, f"the data cannot tell more: {error}"
    order = fractional.fit["damping_order"]
    std = fractional.fit.std[fractional.fit.names.index("damping_order")]
    score = f"damping order {order:.4g} +- {std:.2g}"
    held_out = (f"held-out residual {fractional.held_out_nrmse:.3%} against "
                f"{classical.held_out_nrmse:.3%} of the classical model")
    if abs(order - 1) <= _SIGNIFICANT * std:
        return classical, f"a fractional damping is not significant: {score}"
    if not fractional.held_out_nrmse < classical.held_out_nrmse:
        return classical, f"a fractional damping does not predict better: {held_out}"
    return fractional, f"{score} differs from 1; {held_out}"


def _identification(chosen, reason, data, axis, provenance):
    fit, rate = chosen.fit, data.pair.sampling_rate_hz
    low, high = excited_band(data.reference, data.sensor, rate)
    parameters = {name: {"value": float(value), "std": float(std), "unit": _unit(name)}
                  for name, value, std in zip(fit.names, fit.values, fit.std)}
    notes = _notes(parameters, chosen, data, high)
    effects = [TimeDelay(fit["delay_s"])]
    if abs(fit["offset"]) > _SIGNIFICANT * parameters["offset"]["std"]:
        effects.append(Offset(fit["offset"]))
    model = SensorModel(chosen.structure.core(fit), effects, metadata={
        "uncertainties": {name: {"std": entry["std"], "unit": entry["unit"]}
                          for name, entry in parameters.items()},
        "covariance": {"parameters": list(fit.names), "matrix": fit.covariance.tolist()},
        "band_hz": [low, high],
        "sampling_rate_hz": rate,
        "noise_std": _noise(fit.residual),
        "provenance": {"axis": axis, "structure": chosen.name, "reason": reason, **provenance},
        "validation": {"nrmse": chosen.nrmse, "held_out_nrmse": chosen.held_out_nrmse,
                       "notes": notes},
        **({"continuous_equivalent": fit.continuous_equivalent()}
           if isinstance(fit, ArxFit) else {}),
    })
    return Identification(model, chosen.name, reason, parameters, chosen.nrmse,
                          chosen.held_out_nrmse, notes)


def _unit(name):
    """Unit of a parameter, from the class that declares it."""
    if name[1:].isdigit():
        return {"a": "1", "b": unit_of(Oscillator, "sensitivity")}[name[0]]
    # orders and ratios of the general equation belong to no class; they have no unit
    return next((unit_of(cls, name) for cls in (Oscillator, TimeDelay, Offset)
                 if name in (field.name for field in parameter_fields(cls))), "1")


def _noise(residual):
    """White part of the residual: what is left above half the Nyquist frequency, spread evenly.

    Below, the residual also holds what the model gets wrong, which is not noise.
    """
    clean = np.nan_to_num(residual)
    power = np.abs(np.fft.rfft(clean * np.hanning(len(clean))))**2
    window = np.sum(np.hanning(len(clean))**2)
    # the median of a chi-squared of two degrees is ln 2 of its mean
    return float(np.sqrt(np.median(power[len(power) // 2:]) / np.log(2) / window))


def _held_out(structure, fit, data):
    """Residual on the last part of the record of a model fitted to the rest alone."""
    pair = data.pair
    split = learning_length(data.reference)
    rest = slice(split, None)
    if len(pair) - split < 256 or split < 256:
        return float("nan")
    try:
        learnt = data.fit(structure, slice(split), start=fit.unknowns, uncertainty=False)
        # the pair's lag belongs to the stamps, not to the sensor
        model = SensorModel(structure.core(learnt), [TimeDelay(learnt["delay_s"] - pair.lag_s),
                                                     Offset(learnt["offset"])])
    except FracAccelError:
        return float("nan")
    # simulated over the whole record, so that the held-out part begins with its true history
    simulated = simulate(model, data.reference, pair.sampling_rate_hz, axis="x", initial="steady")
    error = (data.sensor - simulated)[rest][pair.valid[rest]]
    spread = np.std(data.sensor[rest][pair.valid[rest]])
    # without its mean: motion long before the record still shows there as a constant
    return float(np.std(error) / spread) if spread > 0 else float("nan")


def _notes(parameters, chosen, data, highest):
    fit, pair, nrmse, held_out = chosen.fit, data.pair, chosen.nrmse, chosen.held_out_nrmse
    notes = fit.notes() if isinstance(fit, ArxFit) else _seismic_notes(parameters, chosen, highest)
    noise = _noise(fit.residual)
    if nrmse > 1e-3 and fit.rmse > 3 * noise:
        notes.append(f"the model leaves {nrmse:.2%} of the output unexplained, while its white "
                     f"noise is {noise / data.spread:.2%}: something real is missing from it")
    if np.isfinite(held_out) and held_out > max(2 * nrmse, 1e-3):
        notes.append(f"held-out data are predicted worse ({held_out:.2%}) than the fitted "
                     f"({nrmse:.2%})")
    missing = int(np.sum(~pair.valid))
    if missing:
        notes.append(f"{missing} of {len(pair)} instants have no sample in one of the topics")
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
        elif name != "sensitivity" and any(note.startswith("natural_f") for note in notes):
            notes.append(f"{name} is not determined by these data (nor is the resonance that it "
                         "describes)")
    resonance = parameters["natural_frequency_hz"]["value"]
    if highest < resonance / 3:
        notes.append(f"the excitation ends at {highest:.4g} Hz, far below the resonance at "
                     f"{resonance:.4g} Hz; the model holds only up to there")
    return notes
