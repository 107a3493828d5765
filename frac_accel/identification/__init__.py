"""From a measured pair to a sensor model with standard uncertainties."""

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np

from ..core import Oscillator
from ..effects.offset import Offset
from ..effects.time_delay import TimeDelay
from ..errors import FracAccelError, IdentificationError
from ..metrics import octave_bands
from ..model import AXES, SensorModel
from ..pair import Pair, load_pair
from ..parameters import parameter_fields, unit_of
from ..simulation import simulate
from .arx import FEWEST_COEFFICIENTS, ArxFit, ArxStructure, fit_arx
from .excitation import excited_band, learning_length, require_excitation
from .fit_validation import FitValidation, band_fits, fit_validation, judge_residual
from .output_error import Fit, fit_output_error
from .records import agreement, combine
from .structures import FractionalStructure, OscillatorStructure

__all__ = ["STRUCTURES", "Identification", "identify"]

# A standard uncertainty above this share of its value: the data do not determine the parameter.
_UNDETERMINED = 0.2
# Standard uncertainties by which the damping order must differ from 1 to be called fractional.
_SIGNIFICANT = 3.0
# Time constants after which a motion from before the record counts no more, and samples at both
# ends that the band-limited simulation cannot know.
_SETTLING = 7.0
_EDGE = 32
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
        RMS of the residual over the standard deviation of the sensor's output; of several records
        that of their common model, in quadratic mean.
    held_out_nrmse : float
        The same on the last part of the record with a model fitted to the rest of it alone; NaN
        where that part holds no signal. Of several records: of each with the others' models.
    notes : list of str
        What a user must know before trusting the model.
    validation : FitValidation
        Residual tests, held-out data by octaves, agreement of the records, and the verdict.
    """

    model: SensorModel
    structure: str
    reason: str
    parameters: dict
    nrmse: float
    held_out_nrmse: float
    notes: list
    validation: FitValidation

    def as_dict(self):
        """Plain numbers, lists and the model's content."""
        return {"model": self.model.to_dict(), "structure": self.structure,
                "reason": self.reason, "parameters": self.parameters,
                "nrmse": self.nrmse, "held_out_nrmse": self.held_out_nrmse, "notes": self.notes,
                "validation": self.validation.as_dict()}


def identify(pair, axis="x", structure="auto", provenance=None, progress=None, records=None):
    """Identify a sensor model.

    Parameters
    ----------
    pair : Pair, str or Path, or a list of them
        A measured pair, or a bag with one on the default topics. Of several, each gets a model
        that is judged on all others, and the result is their mean, weighted by the inverse
        covariances.
    axis : {"x", "y", "z"}
    structure : {"auto", "arx", "oscillator", "fractional"}
        Rational transfer function in z, classical seismic sensor, one with a damping of free
        order, or the choice between the last two: the fractional one only where its order differs
        from 1 by three standard uncertainties and it predicts held-out data better.
    provenance : dict, optional
        Where the data come from; becomes part of the model.
    progress : callable, optional
        Called with a few words before each step that may take seconds.
    records : list of str, optional
        Names of several pairs, for messages.

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
    pairs = pair if isinstance(pair, (list, tuple)) else [pair]
    records = records or [Path(pair).name if isinstance(pair, (str, Path)) else f"record {i + 1}"
                          for i, pair in enumerate(pairs)]
    pairs = [load_pair(pair, axis=axis) if isinstance(pair, (str, Path)) else pair
             for pair in pairs]
    if not pairs:
        raise IdentificationError("no record given, expected at least one")
    datas = [_Data.of(pair, AXES.index(axis), progress or (lambda words: None)) for pair in pairs]
    if len(datas) > 1:
        chosen, reason, agreeing = _choose_of_several(structure, datas, records)
    elif structure == "auto":
        (chosen, reason), agreeing = _choose(datas[0]), None
    else:
        chosen, reason, agreeing = _Candidate.of(structure, datas[0]), "asked for", None
    return _identification(chosen, reason, datas[0], axis, provenance or {}, agreeing)


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

    def fit(self, structure, part=slice(None), start=None):
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
    held_out: object

    @classmethod
    def of(cls, name, data):
        fit = _fitted(name, data)
        data.progress(f"judging the {name} structure on held-out data")
        held_out = _held_out(_STRUCTURES[name], fit, data)
        return cls(_STRUCTURES[name], name, fit, fit.rmse / data.spread, held_out.nrmse, held_out)


@dataclasses.dataclass(frozen=True)
class _Prediction:
    """Output of a part of a record, predicted by a model that has not seen it; or nothing."""

    measured: np.ndarray
    simulated: np.ndarray
    valid: np.ndarray

    @property
    def nrmse(self):
        error = (self.measured - self.simulated)[self.valid]
        spread = np.std(self.measured[self.valid]) if len(error) else 0.0
        # without its mean: motion long before the record still shows there as a constant
        return float(np.std(error) / spread) if spread > 0 else float("nan")

    def bands(self, rate, low, high):
        """BandFits by octaves."""
        if not np.isfinite(self.nrmse):
            return []
        # instants without a sample are predicted without error, so that they do not count
        measured = np.where(self.valid, self.measured, self.simulated)
        return band_fits(measured, self.simulated, rate, octave_bands(low, high))


_NOTHING = _Prediction(np.empty(0), np.empty(0), np.empty(0, bool))


def _fitted(name, data, start=None):
    structure = _STRUCTURES[name]
    require_excitation(data.reference, data.pair.sampling_rate_hz,
                       max(len(structure.names) + 2, FEWEST_COEFFICIENTS))
    data.progress(f"fitting the {name} structure")
    return data.fit(structure, start=start)


def _predicted(structure, fit, data, part):
    """_Prediction of a part of a record by the model of a fit, offset included."""
    pair = data.pair
    # the pair's lag belongs to the stamps, not to the sensor
    model = SensorModel(structure.core(fit), [TimeDelay(fit["delay_s"] - pair.lag_s),
                                              Offset(fit["offset"])])
    # simulated over the whole record, so that the part begins with its true history
    simulated = simulate(model, data.reference, pair.sampling_rate_hz, axis="x", initial="steady")
    return _Prediction(data.sensor[part], simulated[part], pair.valid[part])


def _choose(data):
    """The better of classical and fractional, and why."""
    classical = _Candidate.of("oscillator", data)
    try:
        fractional = _Candidate.of("fractional", data)
    except IdentificationError as error:
        return classical, f"the data cannot tell more: {error}"
    return _preferred(classical, fractional, "held-out residual")


def _preferred(classical, fractional, judged):
    order = fractional.fit["damping_order"]
    std = fractional.fit.std[fractional.fit.names.index("damping_order")]
    score = f"damping order {order:.4g} +- {std:.2g}"
    held_out = (f"{judged} {fractional.held_out_nrmse:.3%} against "
                f"{classical.held_out_nrmse:.3%} of the classical model")
    if abs(order - 1) <= _SIGNIFICANT * std:
        return classical, f"a fractional damping is not significant: {score}"
    if not fractional.held_out_nrmse < classical.held_out_nrmse:
        return classical, f"a fractional damping does not predict better: {held_out}"
    return fractional, f"{score} differs from 1; {held_out}"


def _choose_of_several(structure, datas, records):
    """The combined model, why its structure, and how the records agree."""
    if structure != "auto":
        chosen, agreeing = _combined(structure, datas, records)
        return chosen, "asked for", agreeing
    classical, agreeing = _combined("oscillator", datas, records)
    try:
        fractional, fractionally = _combined("fractional", datas, records)
    except IdentificationError as error:
        return classical, f"the data cannot tell more: {error}", agreeing
    better, reason = _preferred(classical, fractional, "residual on other records")
    return better, reason, fractionally if better is fractional else agreeing


def _combined(name, datas, records):
    """Candidate of all records together and their RecordAgreement."""
    structure, fits = _STRUCTURES[name], []
    for data in datas:
        # the orders of a transfer function must be the same in all
        start = fits[0].unknowns if fits and name == "arx" else None
        fits.append(_fitted(name, data, start))
    datas[0].progress(f"judging the {name} structure on the other records")
    table = [[_predicted(structure, fit, data, _settled(structure, fit, data)) for data in datas]
             for fit in fits]
    combination = combine(fits)
    joint = dataclasses.replace(fits[0], values=combination.values,
                                covariance=combination.covariance)
    try:
        structure.core(joint).require_stable("core")
    except FracAccelError:
        raise IdentificationError(
            f"the records' models contradict each other so much (chi-squared "
            f"{combination.statistic:.3g} of {combination.freedom} degrees of freedom) that their "
            "mean is not stable; identify each record by itself") from None
    joined = [_predicted(structure, joint, data, _settled(structure, joint, data))
              for data in datas]
    tests = [judge_residual(structure.core(fit), fit, data.reference, data.pair)
             for fit, data in zip(fits, datas)]
    result = agreement(records, fits, combination,
                       [[entry.nrmse for entry in row] for row in table],
                       [entry.nrmse for entry in joined],
                       all(test is None or test.independent for test in tests))
    others = [(i, j) for i in range(len(fits)) for j in range(len(fits)) if i != j]
    worst = max(others, key=lambda pair: table[pair[0]][pair[1]].nrmse)
    return _Candidate(structure, name, joint,
                      float(np.sqrt(np.mean([entry.nrmse**2 for entry in joined]))),
                      float(np.sqrt(np.mean([table[i][j].nrmse**2 for i, j in others]))),
                      table[worst[0]][worst[1]]), result


def _settled(structure, fit, data):
    """Part of a record after the motion before it, which another record's model cannot know."""
    decay = np.abs(structure.core(fit).poles().real)
    slowest = np.min(decay, initial=np.inf)
    samples = _SETTLING * data.pair.sampling_rate_hz / slowest if slowest > 0 else np.inf
    return slice(int(min(max(samples, _EDGE), len(data.sensor) // 4)), -_EDGE)


def _identification(chosen, reason, data, axis, provenance, agreeing=None):
    fit, rate = chosen.fit, data.pair.sampling_rate_hz
    low, high = excited_band(data.reference, data.sensor, rate)
    parameters = {name: {"value": float(value), "std": float(std), "unit": _unit(name)}
                  for name, value, std in zip(fit.names, fit.values, fit.std)}
    notes = _notes(parameters, chosen, data, high)
    tests = judge_residual(chosen.structure.core(fit), fit, data.reference, data.pair)
    validation = fit_validation(tests, fit.rmse / data.spread,
                                chosen.held_out.bands(rate, low, high), agreeing)
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
                       "notes": notes, **validation.essentials()},
        **({"continuous_equivalent": fit.continuous_equivalent()}
           if isinstance(fit, ArxFit) else {}),
    })
    return Identification(model, chosen.name, reason, parameters, chosen.nrmse,
                          chosen.held_out_nrmse, notes, validation)


def _unit(name):
    """Unit of a parameter, from the class that declares it."""
    if name[1:].isdigit():
        return {"a": "1", "b": unit_of(Oscillator, "sensitivity")}[name[0]]
    return next(unit_of(cls, name) for cls in (Oscillator, TimeDelay, Offset)
                if name in (field.name for field in parameter_fields(cls)))


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
    """_Prediction of the last part of the record by a model fitted to the rest alone."""
    split = learning_length(data.reference)
    if len(data.pair) - split < 256 or split < 256:
        return _NOTHING
    try:
        learnt = data.fit(structure, slice(split), start=fit.unknowns)
        return _predicted(structure, learnt, data, slice(split, None))
    except FracAccelError:
        return _NOTHING


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
    resonance = parameters["natural_frequency_hz"]["value"]
    if highest < resonance / 3:
        notes.append(f"the excitation ends at {highest:.4g} Hz, far below the resonance at "
                     f"{resonance:.4g} Hz; the model holds only up to there")
    return notes
