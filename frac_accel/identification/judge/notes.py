"""What a user must know before trusting an identified model."""

import numpy as np

from ..fit.arx import ArxFit
from .open_parameters import open_combinations

# A standard uncertainty above this share of its value: the data do not determine the parameter.
_UNDETERMINED = 0.2
# Held-out residual, of the output (RMS), above which little of the sensor is understood.
MOST_LEFT = 0.5


def candidate_notes(parameters, chosen, data, band_hz):
    """Notes on a candidate's parameters and on how it predicts.

    Parameters
    ----------
    parameters : dict
        As of `Identification`.
    chosen : Candidate
    data : Data
    band_hz : tuple of float
        Band that is excited.

    Returns
    -------
    list of str
    """
    fit, nrmse, held_out = chosen.fit, chosen.nrmse, chosen.held_out_nrmse
    notes = fit.notes() if isinstance(fit, ArxFit) else [
        *_bound_notes(chosen),
        *_seismic_notes(parameters, chosen, band_hz[1]),
        *open_combinations(fit, band_hz, data.pair.sampling_rate_hz)]
    if np.isfinite(held_out) and held_out > max(2 * nrmse, 1e-3):
        notes.append(f"held-out data are predicted worse ({held_out:.2%}) than the fitted "
                     f"({nrmse:.2%})")
    if np.isfinite(held_out) and held_out > MOST_LEFT:
        notes.append(f"the model misses {min(held_out, 1):.0%} of held-out data: something else "
                     "acts, and no parameter is the sensor's with the uncertainty stated")
    return notes


def _bound_notes(chosen):
    """What the search would have taken further than it may go."""
    reached = {name: fit for fit in chosen.fits for name in fit.at_bounds}
    return [f"the fit stopped at the limit of {name}, {fit[name]:.4g}: the data do not determine "
            "it, or the sensor is of another kind; its uncertainty includes how far beyond the "
            "limit they reach"
            for name, fit in reached.items()]


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
    if "natural_frequency_hz" not in parameters:
        return notes
    resonance = parameters["natural_frequency_hz"]["value"]
    if highest < resonance / 3:
        notes.append(f"the sensor follows the reference up to {highest:.4g} Hz, far below the "
                     f"resonance at {resonance:.4g} Hz; the model holds only up to there")
    return notes
