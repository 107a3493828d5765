"""A structure fitted to a record, and judged on data that a second fit has not seen."""

import dataclasses
from collections.abc import Callable

import numpy as np

from ...errors import FracAccelError, IdentificationError
from ...model import AXES
from ...record import Record
from ...record.orientation import turned_away
from ...signals.metrics import octave_bands
from ..checks.direction import exchanged_instead, judge_direction
from ..checks.fit_checks import far_apart, require_time_to_answer
from ..checks.record_checks import RecordCheck, check_record, require_magnitude
from ..fit.arx import FEWEST_COEFFICIENTS, ArxFit, ArxStructure, fit_arx
from ..fit.output_error import Fit, fit_output_error
from ..fit.prediction import predicted
from ..fit.structures import (
    FractionalStructure,
    FractionalTransferFunctionStructure,
    GainStructure,
    OscillatorStructure,
)
from ..response.excitation import held_out, persistent_excitation, require_order
from .fit_validation import band_fits
from .measured_response import MeasuredResponse

# Fewest samples to learn from and to judge on.
_FEWEST = 256
# Residual from which on the two topics may belong together in another way.
_POOR = 0.7
# Likelihood ratio that two superfluous parameters reach in one of twenty records: chi-squared.
_LIKELIHOOD_RATIO = 6.0
STRUCTURES = {"arx": ArxStructure(), "oscillator": OscillatorStructure(),
              "fractional": FractionalStructure(), "gain": GainStructure(),
              "fractional_transfer_function": FractionalTransferFunctionStructure()}


@dataclasses.dataclass(frozen=True)
class Data:
    """One axis of a checked record, its frequency response without a model, and its excitation.

    `order` is that of persistent excitation, `lines_hz` are what gives it.
    """

    record: RecordCheck
    pair: Record
    reference: np.ndarray
    sensor: np.ndarray
    spread: float
    response: MeasuredResponse
    progress: Callable
    order: int
    lines_hz: list
    axis: str = "x"

    @classmethod
    def of(cls, pair, axis, progress):
        """Check a pair and measure its response."""
        column = AXES.index(axis)
        require_magnitude(pair, axis)
        excited = persistent_excitation(pair.reference[:, column], pair.sampling_rate_hz)
        require_order(*excited, pair.sampling_rate_hz, FEWEST_COEFFICIENTS)
        progress("checking the record")
        record = check_record(pair, axis)
        pair = record.pair
        # views where an axis lies in one piece
        reference, sensor = (np.ascontiguousarray(values[:, column])
                             for values in (pair.reference, pair.sensor))
        progress("measuring the frequency response")
        return cls(record, pair, reference, sensor,
                   float(np.std(sensor[pair.valid])), MeasuredResponse.of(pair, axis), progress,
                   *excited, axis)

    def fit(self, structure, start=None, uncertainty=True, held=None, without=None):
        """Fit of a structure to the record, `without` some samples (a mask) if given; options as
        in `fit_output_error`."""
        valid, part = self.pair.valid, slice(None)
        if without is not None:
            # what comes after all that counts would only take time
            valid, part = valid & ~without, slice(int(np.flatnonzero(~without)[-1]) + 1)
        record = (self.reference[part], self.sensor[part], self.pair.sampling_rate_hz,
                  valid[part], self.pair.lag_s)
        if isinstance(structure, ArxStructure):
            return fit_arx(*record, start, uncertainty)
        hint = self.response.start(structure) if start is None else None
        if self.response.stepped and hint is not None:
            start, hint = hint, None
        return fit_output_error(structure, *record, start, uncertainty, hint, held)

    def predicted(self, structure, fit, part):
        """Prediction of a part of the record by the model of a fit, offset included."""
        # over the whole record, so that the part begins with its true history
        simulated = predicted(structure, fit, self.reference, self.pair.sampling_rate_hz,
                              self.pair.lag_s)
        return Prediction(self.sensor[part], simulated[part], self.pair.valid[part])


@dataclasses.dataclass(frozen=True)
class Prediction:
    """Output of a part of a record, predicted by a model that has not seen it; or nothing."""

    measured: np.ndarray
    simulated: np.ndarray
    valid: np.ndarray

    @property
    def nrmse(self):
        """RMS of the error over the standard deviation of the output; NaN without either."""
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


_NOTHING = Prediction(np.empty(0), np.empty(0), np.empty(0, bool))


@dataclasses.dataclass(frozen=True)
class Candidate:
    """A structure fitted to all data, and judged on data that a second fit has not seen.

    Of several records `fits` holds each one's own, `fit` their mean.
    """

    structure: object
    name: str
    fit: Fit | ArxFit
    fits: tuple
    nrmse: float
    held_out_nrmse: float
    held_out: Prediction

    @classmethod
    def of(cls, name, data):
        """Fit the structure of that name to one record."""
        structure, fit = fitted(name, data)
        data.progress(f"judging the {name} structure on held-out data")
        held_out = _held_out(structure, fit, data)
        return cls(structure, name, fit, (fit,), fit.rmse / data.spread, held_out.nrmse, held_out)


def needed_order(structure):
    """Parameters that the excitation must suffice for: also sensitivity and delay."""
    return max(len(structure.names) + 2, FEWEST_COEFFICIENTS)


def fitted(name, data):
    """Structure of that name and its fit; or a simpler one's where the likelihoods hardly differ.

    Raises
    ------
    IdentificationError
        As `fit_of`.
    """
    structure = STRUCTURES[name]
    data.progress(f"fitting the {name} structure")
    fit = fit_of(structure, data)
    simpler = None if isinstance(fit, ArxFit) else structure.simpler(fit.unknowns)
    if simpler:
        other = data.fit(simpler[0], start=simpler[1])
        ratio = 2 * np.isfinite(fit.residual).sum() * np.log(other.rmse / fit.rmse)
        if ratio < _LIKELIHOOD_RATIO:
            return simpler[0], other
    return structure, fit


def fit_of(structure, data, start=None):
    """Fit of a structure to all of a record.

    Raises
    ------
    IdentificationError
        If there is none; says if there is one of exchanged topics or with other stamps.
    """
    require_order(data.order, data.lines_hz, data.pair.sampling_rate_hz, needed_order(structure))
    try:
        return data.fit(structure, start=start)
    except IdentificationError as error:
        record = data.reference, data.sensor, data.pair
        raise exchanged_instead(*record) or far_apart(*record) or _astray(data) or error from None


def suspicions(fit, data):
    """Notes on what is suspicious about a fit.

    Raises
    ------
    IdentificationError
        If no sensor can be behind it.
    """
    record = data.reference, data.sensor, data.pair
    if fit.rmse > _POOR * data.spread:
        apart = far_apart(*record) or _astray(data)
        if apart is not None:
            raise apart
    require_time_to_answer(fit, data.pair)
    data.progress("judging the direction from reference to sensor")
    return judge_direction(fit, *record)


def _astray(data):
    """Error of an axis that follows another one of the reference, or None."""
    words = turned_away(data.pair, data.axis)
    return IdentificationError(f"axis {data.axis}: the sensor does not follow the reference; "
                               f"{words}") if words else None


def _held_out(structure, fit, data):
    """Prediction of a part of the record by a model fitted to the rest alone."""
    valid = data.pair.valid
    rest = held_out(data.reference, valid).copy()
    # where the motion lies beyond the reference's ends, nothing can be predicted
    late = int(np.round(fit["delay_s"] * data.pair.sampling_rate_hz))
    rest[slice(late) if late > 0 else slice(len(rest) + late, None)] = False
    if min((valid & ~rest).sum(), (valid & rest).sum()) < _FEWEST:
        return _NOTHING
    try:
        learnt = data.fit(structure, start=fit.unknowns, uncertainty=False, without=rest)
        return data.predicted(structure, learnt, rest)
    except FracAccelError:
        return _NOTHING
