"""Measured points of a frequency response, with their uncertainties."""

import dataclasses

import numpy as np

from ...errors import IdentificationError
from ...model import AXES
from . import local_polynomial, periodic, stepped_sine
from .recognise import Recognised, recognise

# Run of samples without a gap that bands of a spectrum need.
_FEWEST_SAMPLES = 256


@dataclasses.dataclass(frozen=True)
class ResponsePoints:
    """Frequency response of a measured pair at single frequencies.

    Attributes
    ----------
    frequency_hz : ndarray, shape (m,)
        In rising order.
    response : ndarray of complex, shape (m,)
        Sensor's output per acceleration [output units per m/s²], the pair's delay included.
    std_amplitude : ndarray, shape (m,)
        Relative standard uncertainty of the amplitude.
    std_phase_rad : ndarray, shape (m,)
        Standard uncertainty of the phase [rad].
    method : str
        How the points were found.
    excitation : Recognised
        Kind of excitation found in the record.
    distortion : dict or None
        What the record shows of nonlinear distortion, and ``words`` for it.
    segments : list of dict
        Parts of the record that the points come from: ``start_s``, ``stop_s`` and more.
    notes : list of str
        What was left out, and why.
    """

    frequency_hz: np.ndarray
    response: np.ndarray
    std_amplitude: np.ndarray
    std_phase_rad: np.ndarray
    method: str
    excitation: Recognised
    distortion: dict | None
    segments: list
    notes: list

    def __len__(self):
        return len(self.frequency_hz)

    def as_dict(self):
        """Plain numbers, lists and words."""
        return {"frequency_hz": self.frequency_hz.tolist(),
                "amplitude": np.abs(self.response).tolist(),
                "phase_rad": np.angle(self.response).tolist(),
                "std_amplitude": self.std_amplitude.tolist(),
                "std_phase_rad": self.std_phase_rad.tolist(),
                "method": self.method, "distortion": self.distortion,
                "segments": self.segments, "notes": self.notes}


def response_points(pair, axis="x"):
    """Frequency response of a measured pair, by the method that suits its excitation.

    A stepped sine gets sine fits in its dwells (`stepped_sine`), a multisine averages over its
    periods (`periodic`), and everything else local polynomials in bands (`local_polynomial`) over
    its longest run without a gap.

    Parameters
    ----------
    pair : Record
    axis : {"x", "y", "z"}

    Returns
    -------
    ResponsePoints

    Raises
    ------
    IdentificationError
        If the record gives no point; says why.
    """
    column = AXES.index(axis)
    reference, sensor = pair.reference[:, column], pair.sensor[:, column]
    excitation = recognise(reference, pair.sampling_rate_hz)
    record = (reference, sensor, pair.valid, pair.sampling_rate_hz)
    if excitation.tones:
        points = _from_dwells(excitation, *record)
    elif excitation.period_samples and _whole_periods(pair.valid, excitation.period_samples) > 1:
        points = _from_periods(excitation, *record)
    else:
        points = _from_bands(excitation, *record)
    if not len(points):
        raise IdentificationError("the sensor's output follows the reference at no frequency well "
                                  "enough to give a point of its frequency response")
    # the sensor's samples are later than the instants of the reference
    lag = np.exp(-2j * np.pi * points.frequency_hz * pair.lag_s)
    return dataclasses.replace(points, response=points.response * lag)


def _from_dwells(excitation, reference, sensor, valid, rate):
    dwells = [stepped_sine.fit_dwell(reference, sensor, valid, rate, tone)
              for tone in excitation.tones]
    dropped = sum(dwell is None for dwell in dwells)
    dwells = sorted((dwell for dwell in dwells if dwell is not None),
                    key=lambda dwell: dwell.frequency_hz)
    notes = [f"{dropped} of {dropped + len(dwells)} dwells have too short a steady part for a sine "
             "fit"] if dropped else []
    segments = [{"start_s": dwell.start / rate, "stop_s": dwell.stop / rate,
                 "frequency_hz": dwell.frequency_hz, "amplitude": dwell.amplitude,
                 "harmonics": dwell.harmonics, "reference_harmonics": dwell.reference_harmonics}
                for dwell in dwells]
    distortion = None
    if dwells:
        worst = max(dwells, key=lambda dwell: dwell.harmonics)
        distortion = {
            "harmonics": worst.harmonics, "reference_harmonics": worst.reference_harmonics,
            "frequency_hz": worst.frequency_hz,
            "words": f"harmonics of at most {worst.harmonics:.2%} of the fundamental, at "
                     f"{worst.frequency_hz:.4g} Hz; reference there "
                     f"{worst.reference_harmonics:.2%}"}

    def gathered(name):
        return np.array([getattr(dwell, name) for dwell in dwells])
    return ResponsePoints(gathered("frequency_hz"), gathered("response"), gathered("std"),
                          gathered("std"), stepped_sine.METHOD, excitation, distortion, segments,
                          notes)


def _whole_periods(valid, period):
    count = len(valid) // period
    return int(valid[len(valid) - count * period:].reshape(count, period).all(axis=1).sum())


def _from_periods(excitation, reference, sensor, valid, rate):
    found = periodic.periodic_response(reference, sensor, valid, rate, excitation.period_samples)
    notes = [f"{count} of the multisine's periods left out: {why}" for count, why in
             ((found.transient, "transient"), (found.holed, "samples missing")) if count]
    segments = [{"start_s": found.start / rate, "stop_s": found.stop / rate,
                 "periods": found.periods}]
    return ResponsePoints(found.frequency_hz, found.response, found.std, found.std,
                          periodic.METHOD, excitation, found.distortion, segments, notes)


def _from_bands(excitation, reference, sensor, valid, rate):
    start, stop = _longest_run(valid)
    if stop - start < _FEWEST_SAMPLES:
        raise IdentificationError(
            f"the longest run without a missing sample has {stop - start} samples, expected at "
            f"least {_FEWEST_SAMPLES} for a frequency response from {excitation.words}")
    part = slice(start, stop)
    frequency, response, std = local_polynomial.local_polynomial_response(
        reference[part], sensor[part], rate, transient=excitation.kind != "shock")
    notes = [] if stop - start == len(valid) else [
        f"frequency response from the longest run without a gap, {start / rate:.4g} s to "
        f"{stop / rate:.4g} s"]
    return ResponsePoints(frequency, response, std, std, local_polynomial.METHOD, excitation, None,
                          [{"start_s": start / rate, "stop_s": stop / rate}], notes)


def _longest_run(valid):
    edges = np.flatnonzero(np.diff(np.r_[False, valid, False].astype(int)))
    starts, stops = edges[::2], edges[1::2]
    longest = int(np.argmax(stops - starts))
    return int(starts[longest]), int(stops[longest])
