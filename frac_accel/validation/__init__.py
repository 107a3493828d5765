"""How good a model is on a measured pair: its simulation, and the correction that it gives."""

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np

from ..correction.design import NYQUIST_SHARE, plateau, require_wishes
from ..errors import FracAccelError
from ..identification.response.excitation import excited_band
from ..io.samples import Samples
from ..model import AXES, AxisModel, SensorModel
from ..model.effects.axis_mixing import turn_back
from ..model.effects.base import QUANTIZATION
from ..record import Record
from ..record.resampling import within
from ..record.sources import pair_of
from ..shown import Shown, above
from ..signals.metrics import ErrorMetrics, error_metrics, interpolate, octave_bands
from ..signals.thinning import envelope
from ..simulation import EDGE, simulate
from ..simulation.free_motion import free_motions, shares_within
from ..streaming import Corrector
from ..streaming.batches import restamped
from .reference import restored

# A stamp that has been moved by a skew and back.
_ROUNDING_NS = 2
# Share of an upper end below which another is less.
_NEARLY = 0.95
_WISHES = ("bandwidth_hz", "max_delay_s", "lowest_hz", "tolerance")


@dataclasses.dataclass(frozen=True)
class Comparison:
    """Errors of raw and corrected samples of one axis against the reference.

    Attributes
    ----------
    raw, scaled, corrected : ErrorMetrics
        Of the raw samples as they are, divided by the model's sensitivity, and corrected.
    stamps_ns, reference, before, after : ndarray, shape (n,)
        What was compared: instants, the reference there, scaled raw and corrected samples.
    std : ndarray, shape (n,)
        Standard uncertainty that the corrected samples state; NaN where they state none.
    """

    raw: ErrorMetrics
    scaled: ErrorMetrics
    corrected: ErrorMetrics
    stamps_ns: np.ndarray
    reference: np.ndarray
    before: np.ndarray
    after: np.ndarray
    std: np.ndarray


@dataclasses.dataclass(frozen=True)
class Validation(Shown):
    """Errors of a model and of its correction on one axis of a measured pair.

    Attributes
    ----------
    simulation : ErrorMetrics
        Of the simulated against the measured output, where the sensor follows the reference; of a
        sensor that its model says lies turned, of both turned into the reference's axes.
    turned : bool
        Whether they were.
    comparison : Comparison or None
        Of raw and corrected samples against the reference, in the band of the correction.
    filters : dict
        Summary of the inverse filters; empty without a correction.
    counters : dict of str to int
        Fate of the samples; empty without a correction.
    no_correction : str
        Why there is none: the model's simulation can be judged all the same. Else empty.
    words : tuple of str
        What was done to put reference and sensor together (rates, band, offset of the clocks), and
        why the correction is judged in a narrower band than the simulation.
    whole_nrmse : float
        RMS of simulated less measured output over the measured one's standard deviation, at all
        frequencies, where both have samples, without `simulation.EDGE` samples at both ends and
        without what the time before the record may have left of the sensor's motion, which nobody
        knows.
    whole_hz : float or None
        Frequency up to which that counts, where rates differ; None where all do.
    signals : tuple of ndarray
        What the simulation was judged on: time [s], measured and simulated output.
    """

    simulation: ErrorMetrics
    comparison: Comparison | None
    filters: dict
    counters: dict
    words: tuple = ()
    whole_nrmse: float = float("nan")
    whole_hz: float | None = None
    turned: bool = False
    no_correction: str = ""
    signals: tuple = dataclasses.field(default=(), repr=False)

    def __repr__(self):
        found = f"<Validation: simulation {self.simulation.total.nrmse:.3%}"
        return f"{found} (NRMSE), no correction>" if self.comparison is None else \
            f"{found}, correction {self.comparison.corrected.total.nrmse:.3%} (NRMSE)>"

    def _draw(self, figure):
        seen = self.comparison
        if seen is None:
            self._draw_simulation(figure)
            return
        time = (seen.stamps_ns - seen.stamps_ns[0]) * 1e-9
        upper, lower = figure.subplots(2, sharex=True)
        for axes, signals in ((upper, {"reference": seen.reference, "corrected": seen.after}),
                              (lower, {"raw / sensitivity": seen.before - seen.reference,
                                       "corrected": seen.after - seen.reference})):
            for name, values in signals.items():
                axes.plot(*envelope(time, values), label=name, linewidth=0.8)
            above(axes)
        upper.set_ylabel("acceleration [m/s²]")
        lower.set(xlabel="time [s]", ylabel="error [m/s²]")

    def _draw_simulation(self, figure):
        time, measured, simulated = self.signals
        upper, lower = figure.subplots(2, sharex=True)
        for name, values in (("measured", measured), ("simulated", simulated)):
            upper.plot(*envelope(time, values), label=name, linewidth=0.8)
        above(upper)
        upper.set_ylabel("output")
        lower.plot(*envelope(time, simulated - measured), linewidth=0.8)
        lower.set(xlabel="time [s]", ylabel="simulated - measured")

    def as_dict(self):
        """Plain numbers, without the compared signals."""
        return {"simulation": self.simulation.as_dict(), "whole_nrmse": self.whole_nrmse,
                "whole_hz": self.whole_hz,
                "turned": self.turned,
                **{name: self.comparison and getattr(self.comparison, name).as_dict()
                   for name in ("raw", "scaled", "corrected")},
                "no_correction": self.no_correction,
                "filters": self.filters, "counters": self.counters, "words": list(self.words)}


def validate(source: Any, model: SensorModel, axis: str = "x",
             temperature_at: Callable | None = None, sampling_rate_hz: float | None = None,
             **wishes: Any) -> Validation:
    """Judge a model on a measured pair, the reference without the model's `reference_faults`.

    Parameters
    ----------
    source : str, Path or tuple
        A bag, or (reference, sensor) as `Samples` or as arrays of shape (n,) or (n, 3).
    model : SensorModel
    axis : {"x", "y", "z"}
    temperature_at : callable, optional
        Temperature [°C] at an array of stamps [ns], for models that depend on it.
    sampling_rate_hz : float, optional
        Of arrays [Hz].
    **wishes
        ``bandwidth_hz``, ``max_delay_s``, ``lowest_hz``, ``tolerance`` as for `Corrector`.

    Returns
    -------
    Validation
        Of the simulation alone where no correction can be designed, or judged.

    Raises
    ------
    FracAccelError
        If the pair cannot be compared, or a wish is no number above 0.

    Examples
    --------
    >>> import frac_accel
    >>> model = frac_accel.SensorModel.load("bags/soft_mount.yaml")
    >>> judged = frac_accel.validate("bags/soft_mount.mcap", model)
    >>> judged.simulation.total.nrmse > 0.1  # the model in use lacks two effects
    True
    """
    reference, sensor, pair, turned, outputs = _simulated_of(
        source, model, axis, temperature_at, sampling_rate_hz)
    measured, simulated = outputs.longest
    require_wishes(**{name: value for name, value in wishes.items() if name in _WISHES})
    band, rate = _judged_band(pair, AXES.index(axis)), pair.sampling_rate_hz
    words, why, comparison, filters, counters = pair.words, "", None, {}, {}
    try:
        corrector, comparison = _correction(reference, sensor, model, axis, temperature_at, wishes)
        filters, counters = corrector.design.summary(), corrector.counters
        words = [*words, *_band_words(comparison, band, corrector.design, axis, wishes)]
    except FracAccelError as error:
        why = str(error)
    return Validation(
        simulation=error_metrics(measured, simulated, rate, octave_bands(*band)),
        comparison=comparison, filters=filters, counters=counters, words=tuple(words),
        whole_nrmse=outputs.nrmse(pair), whole_hz=pair.band_hz, turned=turned,
        no_correction=why, signals=(np.arange(len(measured)) / rate, measured, simulated))


def _judged_band(pair, column):
    """Where the sensor follows the reference [Hz], and both can be compared."""
    low, high = excited_band(pair.reference[:, column], pair.sensor[:, column],
                             pair.sampling_rate_hz)
    high = min(high, pair.band_hz or np.inf)
    if low >= high:
        raise FracAccelError(f"the reference has no power below {high:.4g} Hz, up to which the "
                             "records can be compared")
    return low, high


def _correction(reference, sensor, model, axis, temperature_at, wishes):
    """The corrector after it has run over the record, and what it made of it."""
    corrector = Corrector(model, **wishes)
    parts, taken = zip(*_corrected(corrector, sensor, temperature_at))
    stamps, values, variance = (np.concatenate([getattr(part, name) for part in parts])
                                for name in ("stamps_ns", "values", "variance"))
    if corrector.design is None:
        raise FracAccelError("the stamps of the sensor's samples tell no rate: most samples are "
                             "missing between them")
    if not len(stamps):
        raise FracAccelError(f"{len(sensor.stamps_ns)} samples are fewer than the filter needs to "
                             f"warm up ({corrector.design.warm_up_samples})")
    seen = restamped(sensor, [each for each in taken if each])
    return corrector, compare(reference, seen, Samples.of(stamps, values, variance),
                              corrector.design, axis)


def _band_words(comparison, band, design, axis, wishes):
    """Why the correction is judged up to a lower frequency than the simulation."""
    high, known = comparison.corrected.total.band_hz[1], design.model.band_hz
    end = design.axes[AXES.index(axis)].band_hz[1]
    if wishes.get("bandwidth_hz") is not None or high >= _NEARLY * band[1] or high < end:
        return []
    if known and end >= known[1]:
        why = "where the band in which the model was identified ends"
    elif end >= _NEARLY * NYQUIST_SHARE * design.sampling_rate_hz / 2:
        why = f"{NYQUIST_SHARE:g} of the Nyquist frequency"
    else:
        why = "where the sensor has lost 80 % of its gain"
    return [f"the correction is judged up to {end:.4g} Hz only, {why}; the sensor follows the "
            f"reference up to {band[1]:.4g} Hz"]


def whole_nrmse(source, model, axis="x", temperature_at=None):
    """`Validation.whole_nrmse` alone: no correction is designed for it.

    Parameters and errors as those of `validate`.
    """
    *_, pair, _, outputs = _simulated_of(source, model, axis, temperature_at)
    return outputs.nrmse(pair)


@dataclasses.dataclass(frozen=True)
class _Outputs:
    """Measured and simulated output, shape (n,) each; the samples that count of all, and their
    longest run without a gap."""

    measured: np.ndarray
    simulated: np.ndarray
    counted: np.ndarray
    run: slice

    @property
    def longest(self):
        return self.measured[self.run], self.simulated[self.run]

    @property
    def mean_square(self):
        return np.mean(np.square((self.measured - self.simulated)[self.counted]))

    def nrmse(self, pair):
        """As far as both can be compared: beyond it, what one of them cannot show is no error."""
        error, measured = self.measured - self.simulated, self.measured
        if pair.band_hz:
            first, last = np.flatnonzero(self.counted)[[0, -1]]
            within_rows = slice(first, last + 1)
            counted = self.counted[within_rows]
            error, measured = (
                within(np.where(counted, values[within_rows], 0.0), pair.sampling_rate_hz,
                       pair.band_hz, ~counted)[counted]
                for values in (error, measured))
        else:
            error, measured = error[self.counted], measured[self.counted]
        return float(np.sqrt(np.mean(error**2)) / np.std(measured))


def _simulated_of(source, model, axis, temperature_at, sampling_rate_hz=None):
    """Restored reference, sensor, their `Record`, whether the signals were turned, and
    `_Outputs`."""
    reference, sensor = pair_of(source, sampling_rate_hz, axis)
    reference = restored(reference, sensor, model, axis, temperature_at)
    pair = Record.of(reference, sensor, axis)
    back = turn_back(model.axes, AXES.index(axis))
    return reference, sensor, pair, back is not None, _simulated(
        model, pair, AXES.index(axis), temperature_at, back)


def compare(reference, sensor, corrected, design, axis="x"):
    """Errors of raw and corrected samples against the reference.

    Parameters
    ----------
    reference, sensor, corrected : Samples
    design : FilterDesign
        That of the correction.
    axis : {"x", "y", "z"}

    Returns
    -------
    Comparison

    Raises
    ------
    FracAccelError
        If the records have too little in common.
    """
    column = AXES.index(axis)
    pair = Record.of(reference, sensor, axis)
    *known, known_rate = _known_reference(pair)
    rate = pair.topics[1].clock.rate_hz if "sensor" in pair.resampled else pair.sampling_rate_hz
    # the raw sample of a corrected one still has the sensor's delay and skew in its stamp
    raw_stamps = corrected.stamps_ns + design.sensor_delay_ns
    since_start = raw_stamps - sensor.stamps_ns[0]
    skew = 1 / design.model.axes[0].clock_ratio - 1
    raw_stamps = raw_stamps + np.round(skew * since_start).astype(np.int64)
    place = np.minimum(np.searchsorted(sensor.stamps_ns, raw_stamps - _ROUNDING_NS),
                       len(sensor.stamps_ns) - 1)
    ahead = round(1e9 * pair.taken_out_s)
    truth = interpolate(*known, corrected.stamps_ns - ahead, known_rate)[:, column]
    truth_raw = interpolate(*known, raw_stamps - ahead, known_rate)[:, column]
    run = _longest_run(np.isfinite(truth) & np.isfinite(truth_raw)
                       & (np.abs(sensor.stamps_ns[place] - raw_stamps) <= _ROUNDING_NS),
                       corrected.stamps_ns, rate)
    truth, truth_raw, stamps = truth[run], truth_raw[run], corrected.stamps_ns[run]
    raw, after = sensor.values[place[run], column], corrected.values[run, column]
    low, high = excited_band(pair.reference[:, column], pair.sensor[:, column], rate)
    band = design.axes[column].band_hz
    low, high = max(low, band[0]), min(high, band[1], pair.band_hz or np.inf)
    if low >= high:
        raise FracAccelError("the reference has no power in the band of the correction, "
                             f"{band[0]:.4g} Hz to {band[1]:.4g} Hz")
    bands = octave_bands(low, high)
    scaled = raw / plateau(design.model.axis(axis), design.model.band_hz)
    return Comparison(
        raw=error_metrics(truth_raw, raw, rate, bands),
        scaled=error_metrics(truth_raw, scaled, rate, bands),
        corrected=error_metrics(truth, after, rate, bands),
        stamps_ns=stamps, reference=truth, before=scaled, after=after,
        std=np.sqrt(corrected.variance[run, column]))


def _known_reference(pair):
    """Stamps and values of the reference, and their rate: as published, or as resampled."""
    if "reference" not in pair.resampled:
        topic = pair.topics[0]
        return topic.stamps_ns, topic.values, topic.clock.rate_hz
    grid = np.round(np.arange(len(pair)) * 1e9 / pair.sampling_rate_hz).astype(np.int64)
    return pair.start_ns + grid, pair.reference, pair.sampling_rate_hz


def _corrected(corrector, sensor, temperature_at):
    """Parts of the corrected record, and what was taken for them; the temperature follows the
    stamps once a second."""
    step = len(sensor.stamps_ns)
    if temperature_at is not None:
        step = max(1, round(step / max(1.0, 1e-9 * np.ptp(sensor.stamps_ns))))
    for start in range(0, len(sensor.stamps_ns), step):
        stamps, values, variance = (column[start:start + step] for column in sensor[:3])
        if temperature_at is not None:
            corrector.set_temperature(float(temperature_at(stamps).mean()))
        yield corrector.process(stamps, values, variance), corrector.taken
    yield corrector.finish(), corrector.taken


def _simulated(model, pair, column, temperature_at, back):
    """`_Outputs` at the same instants; of a turned sensor turned `back`."""
    rows = np.eye(3)[column] if back is None else back[column]
    measured = pair.sensor @ rows
    temperature = None
    if temperature_at is not None:
        seconds = pair.taken_out_s + np.arange(len(pair)) / pair.sampling_rate_hz
        temperature = temperature_at(pair.start_ns + 1e9 * seconds)
    at = np.arange(len(pair)) / pair.sampling_rate_hz
    instants = np.round(1e9 * at).astype(np.int64)
    if pair.is_on_other_instants("sensor"):
        # these values lie on no lattice, and would only be rounded once more
        model = _without_stage(model, QUANTIZATION)
    model = pair.as_laid_out(model)
    inside, edge = pair.valid.copy(), min(EDGE, len(pair) // 16)
    inside[:edge] = inside[len(pair) - edge:] = False
    own = model.axis(AXES[column])

    def begun(initial):
        simulated = simulate(model, pair.reference, pair.sampling_rate_hz, initial=initial,
                             temperature_c=temperature,
                             start_time_s=pair.start_time_s)
        shifted = interpolate(instants, simulated, instants + round(1e9 * pair.lag_s),
                              pair.sampling_rate_hz) @ rows
        counted = np.isfinite(shifted) & inside
        run = _longest_run(counted, instants, pair.sampling_rate_hz)
        return _Outputs(measured, shifted + _begun_before(
            own, measured, shifted, counted, pair.sampling_rate_hz), counted, run)
    # how it moved before the record is not known: a free mass does not move on by itself
    return min((begun(initial) for initial in ("steady", "rest")),
               key=lambda outputs: outputs.mean_square)


def _without_stage(model, stage):
    """A model without its effects at one stage."""
    axes = {name: AxisModel(own.core, tuple(e for e in own.effects if e.stage != stage))
            for name in AXES for own in [model.axis(name)]}
    return SensorModel(model.core, (), axes, model.metadata, model.reference_faults)


def _begun_before(own, measured, shifted, counted, rate):
    """What the time before the record has left of an axis' slow motion: as nobody knows it, that
    which fits best where samples count."""
    free, most = free_motions(own, np.arange(len(measured)) / rate, counted)
    level = np.sqrt(np.mean(measured[counted]**2))
    return free @ shares_within(free[counted], most, level, (measured - shifted)[counted])


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
