"""A measured pair: one axis of a reference and of a sensor on the same uniform instants."""

import dataclasses

import numpy as np
from scipy.ndimage import median_filter

from .bag import RAW_TOPIC, REFERENCE_TOPIC, read_bag
from .correction.timing import estimate_rate
from .errors import FracAccelError
from .model import AXES

# Rates of the two topics may differ by this share: what stamps of a short record leave open.
_SAME_RATE = 1e-3
_FEWEST = 32
# Scatter of the stamps [intervals] with which rounding still finds the instants, and the share of
# samples that may have more.
_SCATTER = 0.3
_RARE = 1e-3
_NEIGHBOURS = 15
_FIRST_PART = 64
# Scatter [intervals] of stamps that are as regular as clocks make them, and of those that look
# wrongly counted (0.29: as likely here as there).
_REGULAR = 1e-3
_SCATTERED = 0.2


@dataclasses.dataclass(frozen=True)
class Pair:
    """Reference and sensor on uniform instants.

    Attributes
    ----------
    sampling_rate_hz : float
    reference : ndarray, shape (n, 3)
        Acceleration [m/s²]; bridged linearly where a sample is missing.
    sensor : ndarray, shape (n, 3)
        Output in the sensor's units.
    valid : ndarray of bool, shape (n,)
        False where either of the two is missing.
    lag_s : float
        Time [s] by which the sensor's instants are later than the reference's; within half a
        sampling interval.
    start_ns : int
        Stamp of the first reference sample.
    sensor_std : float
        Standard deviation that the messages themselves state for the sensor's noise; NaN without.
    """

    sampling_rate_hz: float
    reference: np.ndarray
    sensor: np.ndarray
    valid: np.ndarray
    lag_s: float
    start_ns: int
    sensor_std: float

    def __len__(self):
        return len(self.valid)


def load_pair(bag, reference=REFERENCE_TOPIC, sensor=RAW_TOPIC, axis="x"):
    """Pair of two topics of a bag; parameters and errors as in `make_pair` and `read_bag`."""
    topics = read_bag(bag, [reference, sensor])
    try:
        return make_pair(topics[reference], topics[sensor], axis)
    except FracAccelError as error:
        raise type(error)(f"{bag}: {error}") from None


def make_pair(reference, sensor, axis="x"):
    """Put two runs of samples on the same uniform instants.

    Parameters
    ----------
    reference, sensor : Samples
    axis : {"x", "y", "z"}
        The axis that must hold a signal.

    Returns
    -------
    Pair

    Raises
    ------
    FracAccelError
        If a topic has too few samples, no signal on the axis, stamps that do not advance, another
        rate than the other or no time in common with it.
    """
    column = AXES.index(axis)
    usable = {"reference": clean(reference), "sensor": clean(sensor)}
    rates = {}
    for name, (stamps, values) in usable.items():
        if len(stamps) < _FEWEST:
            raise FracAccelError(f"{name}: {len(stamps)} usable sample(s), expected at least "
                                 f"{_FEWEST} whose stamps advance and whose values are finite")
        rates[name] = _long_term_rate(stamps)
        if np.ptp(values[:, column]) == 0:
            others = [other for other in AXES if np.ptp(values[:, AXES.index(other)]) > 0]
            hint = f"; there is signal on {' and '.join(others)}" if others else ""
            raise FracAccelError(f"{name}: axis {axis} is constant at {values[0, column]:g}{hint}")
    rate, other = rates["reference"], rates["sensor"]
    if abs(rate / other - 1) > _SAME_RATE:
        raise FracAccelError(f"the reference has {rate:.6g} Hz and the sensor {other:.6g} Hz, "
                             "expected the same rate: resample one of them first")
    interval = 1e9 / rate
    start = int(usable["reference"][0][0])
    slots = {name: slots_of((stamps - start) / interval) for name, (stamps, _) in usable.items()}
    # jitter averages out of the mean; a common clock offset between the two topics stays
    lag = float(np.median(usable["sensor"][0] - start - slots["sensor"] * interval)
                - np.median(usable["reference"][0] - start - slots["reference"] * interval))
    first = int(max(slots["reference"][0], slots["sensor"][0]))
    last = int(min(slots["reference"][-1], slots["sensor"][-1]))
    if last - first + 1 < _FEWEST:
        raise FracAccelError("reference and sensor have no time in common: the reference's stamps "
                             f"run from {_seconds(usable['reference'][0])}, the sensor's from "
                             f"{_seconds(usable['sensor'][0])}")
    grid = np.arange(first, last + 1)
    gridded, present = {}, np.ones(len(grid), bool)
    for name, (_, values) in usable.items():
        place = np.clip(np.searchsorted(slots[name], grid), 0, len(values) - 1)
        here = slots[name][place] == grid
        present &= here
        gridded[name] = np.stack([np.interp(grid, slots[name], values[:, i]) for i in range(3)], 1)
        gridded[name][here] = values[place[here]]
    std = np.sqrt(np.nanmean(sensor.variance[:, column])) \
        if np.isfinite(sensor.variance[:, column]).any() else np.nan
    return Pair(rate, gridded["reference"], gridded["sensor"], present, lag * 1e-9,
                int(start + first * interval), float(std))


@dataclasses.dataclass(frozen=True)
class UniformRecord:
    """Samples on uniform instants.

    Attributes
    ----------
    sampling_rate_hz : float
    values : ndarray, shape (n, 3)
        Bridged linearly where a sample is missing.
    index : ndarray of int, shape (m,)
        Samples of the record that are usable.
    slot : ndarray of int, shape (m,)
        Their places among the uniform instants.
    bridged : int
        Number of instants without a sample.
    """

    sampling_rate_hz: float
    values: np.ndarray
    index: np.ndarray
    slot: np.ndarray
    bridged: int


def uniform(samples, where):
    """Put one run of samples on uniform instants.

    Parameters
    ----------
    samples : Samples or None
    where : str
        What the samples are, for messages.

    Returns
    -------
    UniformRecord

    Raises
    ------
    FracAccelError
        If there are too few samples whose stamps advance and whose values are finite.
    """
    good = _good(samples) if samples is not None else np.zeros(0, bool)
    index = np.flatnonzero(good)
    if len(index) < 2:
        raise FracAccelError(f"{where}: {len(index)} usable sample(s), expected at least 2 whose "
                             "stamps advance and whose values are finite")
    stamps, values = samples.stamps_ns[index], samples.values[index]
    rate = _long_term_rate(stamps)
    slot = np.round((stamps - stamps[0]) * rate * 1e-9).astype(np.int64)
    # stamps that scatter so much that two samples share an instant: the first one counts
    first = np.r_[True, np.diff(slot) > 0]
    index, slot, values = index[first], slot[first], values[first]
    grid = np.arange(slot[-1] + 1)
    if len(grid) > 100 * len(slot):
        raise FracAccelError(f"{where}: {len(slot)} samples are spread over {len(grid)} sampling "
                             "intervals, expected a record without such gaps")
    filled = np.stack([np.interp(grid, slot, values[:, i]) for i in range(3)], axis=1)
    return UniformRecord(rate, filled, index, slot, len(grid) - len(slot))


def clean(samples):
    """Stamps and values of the samples whose stamps advance and whose values are finite."""
    good = _good(samples)
    return samples.stamps_ns[good], samples.values[good]


def _good(samples):
    ahead = np.maximum.accumulate(samples.stamps_ns)
    good = np.isfinite(samples.values).all(axis=1)
    good[1:] &= samples.stamps_ns[1:] > ahead[:-1]
    return good


def slots_of(place):
    """Whole instants that samples belong to.

    Parameters
    ----------
    place : ndarray, shape (n,)
        Stamps in sampling intervals, ascending.

    Returns
    -------
    ndarray, shape (n,)
        Whole numbers. Where stamps scatter so much that rounding would put two samples on one
        instant, what is lost between the samples is counted by the median of neighbours.
    """
    nearest = np.round(place)
    scatter = place - nearest
    scatter = scatter - np.median(scatter)
    if np.mean(np.abs(scatter) > _SCATTER) < _RARE:
        return nearest
    count = np.arange(len(place))
    ahead = median_filter(place - count, _NEIGHBOURS, mode="nearest")
    lost = np.round(ahead - ahead[0]) + np.round(ahead[0])
    return count + np.maximum.accumulate(lost)


def _long_term_rate(stamps):
    """Rate over the whole record, by lines fitted to ever longer parts of it.

    Each line says to which instants the stamps of the next part belong, however they scatter.
    """
    interval = 1e9 / estimate_rate(stamps)
    seconds = (stamps - stamps[0]).astype(float)
    first = seconds[:_FIRST_PART] / interval
    # interval by interval, since the estimate's error adds up; where one stamp is so late that its
    # interval looks like two, the places themselves; or no sample is lost
    counted = np.cumsum(np.r_[0, np.maximum(np.round(np.diff(first)), 1)])
    found = []
    for slots in (counted, slots_of(first), np.arange(len(first))):
        line = _grown(seconds, slots)
        place = (seconds - line[1]) / line[0]
        found.append((np.std(place - np.round(place)), line[0], place))
        if found[-1][0] < _SCATTERED:
            break
    scatter, interval, place = min(found, key=lambda entry: entry[0])
    if scatter < _REGULAR:
        # the ends say it to the last digit
        return 1e9 * (np.round(place[-1]) - np.round(place[0])) / float(stamps[-1] - stamps[0])
    return 1e9 / interval


def _grown(seconds, slots):
    """Line through the first stamps, over ever more of them."""
    length = len(slots)
    line = np.polyfit(slots, seconds[:length], 1)
    while length < len(seconds):
        length = min(2 * length, len(seconds))
        place = (seconds[:length] - line[1]) / line[0]
        line = np.polyfit(np.round(place), seconds[:length], 1)
    return line


def _seconds(stamps):
    return f"{stamps[0] * 1e-9:.3f} s to {stamps[-1] * 1e-9:.3f} s"
