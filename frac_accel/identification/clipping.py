"""Samples that a converter or an amplifier has clipped."""

import dataclasses

import numpy as np

from ..errors import IdentificationError
from .frequency_response import bulk_delay
from .output_error import fit_output_error
from .prediction import predicted
from .structures import OscillatorStructure

# Samples at the extreme, at least, and how much more than at any of the next distinct values. The
# crests of a quantised sine come to 2.4 times the next level, too: the model tells them apart.
_FEWEST = 8
_PILE_UP = 1.5
# What stands at one value for a larger share of the record rests there.
_RESTING = 0.4
_NEXT_VALUES = 2
# How far beyond the limit the model goes in the middle of the clipped samples: steps of the
# lattice (half a step is rounding), standard deviations of what it leaves of the others, and of
# the channel (a slightly nonlinear sensor stays below the model at its crests).
_BEYOND_STEPS = 0.55
_BEYOND_NOISE = 0.5
_BEYOND = 0.05
# Taps of the filter from sensor to reference on either side, and rows that it is fitted to.
_TAPS = 8
_ROWS_PER_TAP = 20
_ROWS = 20_000


@dataclasses.dataclass(frozen=True)
class Clipping:
    """What is clipped of one channel.

    Attributes
    ----------
    samples : ndarray of bool, shape (n,)
    limits : tuple of float
        Values at which the samples stand, the lower one first.
    """

    samples: np.ndarray
    limits: tuple

    @property
    def words(self):
        """Where the limits are."""
        return " and ".join(f"{limit:.6g}" for limit in self.limits)


def clipped_sensor(reference, sensor, valid, sampling_rate_hz, lag_s):
    """Clipped samples of the sensor, by what a model of the other samples says of them.

    Samples pile up at the extreme in other ways too (a sensor at rest, the crests of a coarsely
    quantised sine, a long dwell). Only where a classical sensor identified without them would have
    gone beyond the limit are they clipped.

    Parameters
    ----------
    reference, sensor : ndarray, shape (n,)
    valid : ndarray of bool, shape (n,)
    sampling_rate_hz, lag_s : float
        As in `Pair`.

    Returns
    -------
    Clipping
    """
    def model(others):
        structure = OscillatorStructure()
        fit = fit_output_error(structure, reference, sensor, sampling_rate_hz, others, lag_s)
        return predicted(structure, fit, reference, sampling_rate_hz, lag_s)
    return _clipped(sensor, valid, model)


def clipped_reference(reference, sensor, valid):
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
    return _clipped(reference, valid, model)


def lattice_step(values):
    """Step of quantised values; 0 where they are not all on one lattice, or hardly ever repeat."""
    distinct = np.unique(values)
    if len(distinct) < 2 or len(distinct) > len(values) / 2:
        return 0.0
    gaps = np.diff(distinct)
    step = float(gaps.min())
    if step < 1e-9 * (distinct[-1] - distinct[0]):
        return 0.0
    multiples = gaps / step
    on_lattice = np.all(np.abs(multiples - np.round(multiples)) < 1e-3 * multiples)
    return step if on_lattice else 0.0


def _clipped(values, valid, model):
    """Piled-up samples beyond whose limit the model goes."""
    suspect = {side: valid & (values == side * limit) for side in (-1, 1)
               if (limit := _pile_up(side * values[valid])) is not None}
    none = np.zeros(len(values), bool)
    if not suspect:
        return Clipping(none, ())
    others = valid & ~np.any(list(suspect.values()), axis=0)
    try:
        expected = model(others)
    except IdentificationError:
        # what the other samples cannot tell stays unknown; the fit of all of them will say why
        return Clipping(none, ())
    least = max(_BEYOND_STEPS * lattice_step(values[valid]),
                _BEYOND_NOISE * np.std((values - expected)[others]),
                _BEYOND * np.std(values[valid]))
    found = {side: samples for side, samples in suspect.items()
             if np.median(side * (expected - values)[samples]) > least}
    return Clipping(np.any([none, *found.values()], axis=0),
                    tuple(float(values[samples][0]) for samples in found.values()))


def _pile_up(values):
    """Greatest value if suspiciously many samples have it, else None."""
    if np.count_nonzero(values == values.max()) < _FEWEST:
        return None
    distinct, counts = np.unique(values, return_counts=True)
    if len(distinct) <= _NEXT_VALUES:
        return None
    next_count = counts[-1 - _NEXT_VALUES:-1].max()
    suspicious = max(_FEWEST, _PILE_UP * next_count) <= counts[-1] < _RESTING * len(values)
    return distinct[-1] if suspicious else None


def _columns(sensor, rows, delay):
    """Sensor around each row, `delay` samples later, and a constant."""
    places = rows[:, None] + delay + np.arange(-_TAPS, _TAPS + 1)
    return np.c_[sensor[np.clip(places, 0, len(sensor) - 1)], np.ones(len(rows))]
