"""How good a model is on a measured pair: its simulation, and the correction that it gives."""

import dataclasses

import numpy as np

from .correction import Corrector
from .correction.design import reference_gain
from .errors import FracAccelError
from .identification.excitation import excited_band
from .metrics import error_metrics, interpolate, octave_bands
from .model import AXES
from .pair import clean, make_pair
from .simulation import simulate


@dataclasses.dataclass(frozen=True)
class Validation:
    """Errors of a model and of its correction on one axis of a measured pair.

    Attributes
    ----------
    simulation : ErrorMetrics
        Of the simulated against the measured output.
    raw, scaled, corrected : ErrorMetrics
        Against the reference: of the raw samples as they are, divided by the model's sensitivity,
        and corrected.
    stamps_ns, reference, before, after : ndarray, shape (n,)
        What was compared: instants, reference, scaled raw samples and corrected samples.
    filters : dict
        Summary of the inverse filters.
    counters : dict of str to int
        Fate of the samples.
    """

    simulation: object
    raw: object
    scaled: object
    corrected: object
    stamps_ns: np.ndarray
    reference: np.ndarray
    before: np.ndarray
    after: np.ndarray
    filters: dict
    counters: dict

    def as_dict(self):
        """Plain numbers, without the compared signals."""
        return {**{name: getattr(self, name).as_dict()
                   for name in ("simulation", "raw", "scaled", "corrected")},
                "filters": self.filters, "counters": self.counters}


def validate(reference, sensor, model, axis="x", **wishes):
    """Judge a model on a measured pair.

    Parameters
    ----------
    reference, sensor : Samples
    model : SensorModel
    axis : {"x", "y", "z"}
    **wishes
        ``sample_rate_hz``, ``bandwidth_hz``, ``max_delay_s``, ``lowest_hz`` as for `Corrector`.

    Returns
    -------
    Validation

    Raises
    ------
    FracAccelError
        If the pair cannot be compared.
    """
    column = AXES.index(axis)
    pair = make_pair(reference, sensor, axis)
    rate = pair.sampling_rate_hz
    corrector = Corrector(model, **{"sample_rate_hz": 0.0, **wishes})
    parts = [corrector.process(sensor.stamps_ns, sensor.values, sensor.variance),
             corrector.finish()]
    stamps, after, index = (np.concatenate([getattr(part, name) for part in parts])
                            for name in ("stamps_ns", "values", "index"))
    design = corrector.design
    if not len(stamps):
        raise FracAccelError(f"{len(sensor.stamps_ns)} samples are fewer than the filter needs to "
                             f"warm up ({design.warm_up_samples})")
    known = clean(reference)
    truth = interpolate(*known, stamps, rate)[:, column]
    truth_raw = interpolate(*known, sensor.stamps_ns[index], rate)[:, column]
    raw = sensor.values[index, column]
    run = _longest_run(np.isfinite(truth) & np.isfinite(truth_raw), stamps, rate)
    truth, truth_raw, raw, after, stamps = (
        part[run] for part in (truth, truth_raw, raw, after[:, column], stamps))
    low, high = excited_band(pair.reference[:, column], pair.sensor[:, column], rate)
    band = design.axes[column].band_hz
    low, high = max(low, band[0]), min(high, band[1])
    if low >= high:
        raise FracAccelError("the reference has no power in the band of the correction, "
                             f"{band[0]:.4g} Hz to {band[1]:.4g} Hz")
    bands = octave_bands(low, high)
    scaled = raw / (reference_gain(model.axis(axis)) * np.sign(_sign(model, axis)))
    return Validation(
        simulation=error_metrics(*_simulated(model, pair, column), rate, bands),
        raw=error_metrics(truth_raw, raw, rate, bands),
        scaled=error_metrics(truth_raw, scaled, rate, bands),
        corrected=error_metrics(truth, after, rate, bands),
        stamps_ns=stamps, reference=truth, before=scaled, after=after,
        filters=design.summary(), counters=corrector.counters)


def _simulated(model, pair, column):
    """Measured and simulated output at the same instants."""
    simulated = simulate(model, pair.reference, pair.sampling_rate_hz, initial="steady")
    at = np.arange(len(pair)) / pair.sampling_rate_hz
    instants = np.round(1e9 * at).astype(np.int64)
    shifted = interpolate(instants, simulated, instants + round(1e9 * pair.lag_s),
                          pair.sampling_rate_hz)[:, column]
    run = _longest_run(np.isfinite(shifted) & pair.valid, instants, pair.sampling_rate_hz)
    return pair.sensor[run, column], shifted[run]


def _sign(model, axis):
    """Polarity of the model's plateau."""
    core = model.axis(axis).effective_core
    return getattr(core, "sensitivity", 1.0)


def _longest_run(good, stamps_ns, rate):
    """Slice of the longest run of good samples without a gap."""
    follows = np.r_[False, np.diff(stamps_ns) < 1.5e9 / rate]
    breaks = np.flatnonzero(~(good & follows & np.r_[False, good[:-1]]))
    edges = np.r_[breaks, len(good)]
    longest = int(np.argmax(np.diff(edges)))
    if not good.any():
        raise FracAccelError("no sample of the sensor lies within the time of the reference")
    start = edges[longest]
    return slice(int(start) if good[start] else int(start) + 1, int(edges[longest + 1]))
