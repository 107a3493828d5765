"""What the samples that are not clipped say of those that may be."""

import numpy as np
from scipy.interpolate import CubicSpline

from ...errors import IdentificationError
from ...record.clipping import clipped
from ..fit.output_error import fit_output_error
from ..fit.prediction import predicted
from ..fit.structures import OscillatorStructure
from ..response.frequency_response import bulk_delay

# Taps of the filter from sensor to reference on either side, and rows that it is fitted to.
_TAPS = 8
_ROWS_PER_TAP = 20
_ROWS = 20_000


def clipped_sensor(reference, sensor, valid, step, sampling_rate_hz, lag_s):
    """Clipped samples of the sensor, by a classical sensor identified without them.

    Parameters
    ----------
    reference, sensor : ndarray, shape (n,)
    valid : ndarray of bool, shape (n,)
    step : float or None
        Of the sensor's lattice.
    sampling_rate_hz, lag_s : float
        As in `Record`.

    Returns
    -------
    Clipping
    """
    def model(others):
        structure = OscillatorStructure()
        fit = fit_output_error(structure, reference, sensor, sampling_rate_hz, others, lag_s)
        return predicted(structure, fit, reference, sampling_rate_hz, lag_s)
    return clipped(sensor, valid, step, model)


def clipped_before_resampling(record, column, used, known):
    """Clipped samples of a sensor that was resampled: of its topic's, by a classical sensor
    identified without them from a slower reference. What is faster is noise there.

    Parameters
    ----------
    record : Record
    column : int
    used : ndarray of bool, shape (n,)
        Which of the record's instants count.
    known : tuple of float or None
        Limits that are certain by themselves: nothing is asked of what lies there.

    Returns
    -------
    Clipping
    """
    topic = record.topics[1]
    values = topic.values[:, column]
    place = record.place(topic.clock.instants_s(topic.stamps_ns))
    slot = np.clip(np.round(place).astype(int), 0, len(record) - 1)
    certain = np.any([values == limit for limit in known], axis=0)
    valid = used[slot] & (np.abs(place - slot) < 1) & ~certain

    def model(others):
        taken = values[valid & ~others | certain]
        free = used & ~record.instants_of(lambda own: np.isin(own, taken), column)
        seen, structure = record.comparable(column, free), OscillatorStructure()
        reference = seen.reference[:, column]
        fit = fit_output_error(structure, reference, seen.sensor[:, column],
                               record.sampling_rate_hz, free, record.lag_s)
        expected = predicted(structure, fit, reference, record.sampling_rate_hz, record.lag_s)
        return CubicSpline(np.arange(len(expected)), expected)(np.clip(place, 0, len(record) - 1))
    return clipped(values, valid, topic.step(column), model)


def clipped_reference(reference, sensor, valid, step):
    """Clipped samples of the reference, by what a filter says of them that is fed by the sensor.

    The acceleration is a combination of a seismic sensor's output and its derivatives, which a few
    taps on either side give. Parameters and result as in `clipped_sensor`.
    """
    def model(others):
        delay = bulk_delay(reference, sensor)
        rows = np.flatnonzero(others)
        if len(rows) < _ROWS_PER_TAP * (2 * _TAPS + 2):
            raise IdentificationError("too little is left of the reference")
        rows = rows[::max(1, len(rows) // _ROWS)]
        taps = np.linalg.lstsq(_columns(sensor, rows, delay), reference[rows], rcond=1e-10)[0]
        return _columns(sensor, np.arange(len(sensor)), delay) @ taps
    return clipped(reference, valid, step, model)


def _columns(sensor, rows, delay):
    """Sensor around each row, `delay` samples later, and a constant."""
    places = rows[:, None] + delay + np.arange(-_TAPS, _TAPS + 1)
    return np.c_[sensor[np.clip(places, 0, len(sensor) - 1)], np.ones(len(rows))]
