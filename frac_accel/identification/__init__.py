"""From a measured pair to a sensor model with standard uncertainties."""

import dataclasses
from pathlib import Path

import numpy as np

from ..core import Oscillator
from ..effects.offset import Offset
from ..effects.time_delay import TimeDelay
from ..errors import FracAccelError, IdentificationError
from ..model import AXES, SensorModel
from ..pair import load_pair
from ..parameters import unit_of
from ..simulation import simulate
from .excitation import excited_band, require_excitation
from .oscillator import PARAMETERS, fit_oscillator

__all__ = ["Identification", "identify"]

# The share of the record, counted by the reference's energy, that the held-out check learns from.
_LEARN = 0.6
# A standard uncertainty above this share of its value: the data do not determine the parameter.
_UNDETERMINED = 0.2
_UNITS = {
    "sensitivity": unit_of(Oscillator, "sensitivity"),
    "natural_frequency_hz": unit_of(Oscillator, "natural_frequency_hz"),
    "damping_ratio": unit_of(Oscillator, "damping_ratio"),
    "delay_s": unit_of(TimeDelay, "delay_s"),
    "offset": unit_of(Offset, "offset"),
}


@dataclasses.dataclass(frozen=True)
class Identification:
    """An identified model and what the data say about it.

    Attributes
    ----------
    model : SensorModel
        Ready to be saved; its metadata hold uncertainties, covariance, band and rate.
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
    parameters: dict
    nrmse: float
    held_out_nrmse: float
    notes: list

    def as_dict(self):
        """Plain numbers, lists and the model's content."""
        return {"model": self.model.to_dict(), "parameters": self.parameters, "nrmse": self.nrmse,
                "held_out_nrmse": self.held_out_nrmse, "notes": self.notes}


def identify(pair, axis="x", structure="oscillator", provenance=None):
    """Identify a sensor model.

    Parameters
    ----------
    pair : Pair, str or Path
        A measured pair, or a bag with one on the default topics.
    axis : {"x", "y", "z"}
    structure : {"oscillator"}
        Classical seismic sensor with sensitivity, natural frequency, damping ratio and delay.
    provenance : dict, optional
        Where the data come from; becomes part of the model.

    Returns
    -------
    Identification

    Raises
    ------
    IdentificationError
        If the data cannot identify the model; says what is missing.
    """
    if structure != "oscillator":
        raise FracAccelError(f"structure: {structure!r} given, expected 'oscillator'")
    if isinstance(pair, (str, Path)):
        pair = load_pair(pair, axis=axis)
    column = AXES.index(axis)
    reference, sensor, rate = pair.reference[:, column], pair.sensor[:, column], \
        pair.sampling_rate_hz
    require_excitation(reference, rate, parameters=4)
    fit = fit_oscillator(reference, sensor, rate, pair.valid, pair.lag_s)
    low, high = excited_band(reference, sensor, rate)
    parameters = {name: {"value": float(value), "std": float(std), "unit": _UNITS[name]}
                  for name, value, std in zip(PARAMETERS, fit.values, fit.std)}
    nrmse = fit.rmse / float(np.std(sensor))
    held_out = _held_out(pair, reference, sensor)
    notes = _notes(parameters, nrmse, held_out, pair, fit, high)
    effects = [TimeDelay(parameters["delay_s"]["value"])]
    if abs(fit.values[4]) > 3 * fit.std[4]:
        effects.append(Offset(parameters["offset"]["value"]))
    core = Oscillator(
        natural_frequency_hz=parameters["natural_frequency_hz"]["value"],
        damping_ratio=parameters["damping_ratio"]["value"],
        sensitivity=parameters["sensitivity"]["value"])
    model = SensorModel(core, effects, metadata={
        "uncertainties": {name: {"std": entry["std"], "unit": entry["unit"]}
                          for name, entry in parameters.items()},
        "covariance": {"parameters": list(PARAMETERS), "matrix": fit.covariance.tolist()},
        "band_hz": [low, high],
        "sampling_rate_hz": rate,
        "noise_std": _noise(fit.residual),
        "provenance": {"axis": axis, "structure": structure, **(provenance or {})},
        "validation": {"nrmse": nrmse, "held_out_nrmse": held_out, "notes": notes},
    })
    return Identification(model, parameters, nrmse, held_out, notes)


def _noise(residual):
    """White part of the residual: what is left above half the Nyquist frequency, spread evenly.

    Below, the residual also holds what the model gets wrong, which is not noise.
    """
    clean = np.nan_to_num(residual)
    power = np.abs(np.fft.rfft(clean * np.hanning(len(clean))))**2
    window = np.sum(np.hanning(len(clean))**2)
    # the median of a chi-squared of two degrees is ln 2 of its mean
    return float(np.sqrt(np.median(power[len(power) // 2:]) / np.log(2) / window))


def _held_out(pair, reference, sensor):
    energy = np.cumsum((reference - reference.mean())**2)
    split = int(np.searchsorted(energy, _LEARN * energy[-1]))
    rest = slice(split, None)
    if len(pair) - split < 256 or split < 256:
        return float("nan")
    try:
        learnt = fit_oscillator(reference[:split], sensor[:split], pair.sampling_rate_hz,
                                pair.valid[:split], pair.lag_s)
    except IdentificationError:
        return float("nan")
    core = Oscillator(natural_frequency_hz=learnt.values[1], damping_ratio=learnt.values[2],
                      sensitivity=learnt.values[0])
    model = SensorModel(core, [TimeDelay(learnt.values[3] - pair.lag_s), Offset(learnt.values[4])])
    # simulated over the whole record, so that the held-out part begins with its true history
    simulated = simulate(model, reference, pair.sampling_rate_hz, axis="x", initial="steady")
    error = (sensor - simulated)[rest][pair.valid[rest]]
    spread = np.std(sensor[rest][pair.valid[rest]])
    return float(np.sqrt(np.mean(error**2)) / spread) if spread > 0 else float("nan")


def _notes(parameters, nrmse, held_out, pair, fit, highest):
    notes = []
    for name in ("sensitivity", "natural_frequency_hz", "damping_ratio"):
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
    noise = _noise(fit.residual)
    if nrmse > 1e-3 and fit.rmse > 3 * noise:
        notes.append(f"the model leaves {nrmse:.2%} of the output unexplained, while its white "
                     f"noise is {noise / (fit.rmse / nrmse):.2%}: something real is missing from it")
    if np.isfinite(held_out) and held_out > max(2 * nrmse, 1e-3):
        notes.append(f"held-out data are predicted worse ({held_out:.2%}) than the fitted "
                     f"({nrmse:.2%})")
    missing = int(np.sum(~pair.valid))
    if missing:
        notes.append(f"{missing} of {len(pair)} instants have no sample in one of the topics")
    return notes
