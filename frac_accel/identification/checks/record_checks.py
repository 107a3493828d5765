"""What is wrong with a record before anything is identified from it."""

import dataclasses

import numpy as np

from ...errors import IdentificationError
from ...model import AXES
from ...record import Record
from ...shown import listed
from ..response.frequency_response import bulk_delay
from .clipped import clipped_reference, clipped_sensor

# Fewest instants with a sample in both topics, as `make_pair` wants of each.
_FEWEST_SHARED = 32
# Difference between two copies of one signal, of its peak: the rounding of 32-bit numbers.
_SAME = 1e-6
# Steps of a rounded copy, of its standard deviation, below which a sensor of its own would show.
_FINE = 0.01
# Steps by which rounding, and the uncertainty of the factor between two copies, set them apart.
_ROUNDING = 0.55
_DIGITS = 8
# Least eigenvalue of the axes' correlation matrix: 1 - r for two axes of correlation r.
_COLLINEAR = 1e-4
# Equal samples in a row that make a standstill, and the other topic's motion meanwhile: of its
# usual motion, and in steps of the one that stands still.
_STANDSTILL = 32
_BESIDE = 128
_MOVING = 0.5
_STEPS = 3
# A reference may rest while the sensor rings: it is lost where it jumps to its standstill or from
# it by this share of its standard deviation, or stands so far from its median.
_JUMP = 0.3
# Shares of clipped samples that can be left out. A sensor's are only fewer equations; the
# reference's are motion that nobody knows, which the sensor answers to for a while.
_CLIPPED_SENSOR = 0.3
_CLIPPED_REFERENCE = 1e-3
_LEFT = 0.1
# Sizes of which the squares of squares are still numbers; no unit leads out of here.
_SMALLEST, _LARGEST = 1e-30, 1e30


@dataclasses.dataclass(frozen=True)
class RecordCheck:
    """A record without the samples that would mislead.

    Attributes
    ----------
    pair : Record
        The pair with those samples marked as not valid.
    missing, clipped, standing : int
        Instants without a sample, with a clipped one, and at which one of the topics stood still
        while the other moved.
    notes : list of str
    """

    pair: Record
    missing: int
    clipped: int
    standing: int
    notes: list


def check_record(pair, axis="x"):
    """Refuse records that hold no sensor's answer to a known motion; mark misleading samples.

    Parameters
    ----------
    pair : Record
    axis : {"x", "y", "z"}

    Returns
    -------
    RecordCheck

    Raises
    ------
    IdentificationError
        If the sensor's topic is a copy of the reference, one of the topics stands still nearly all
        the time, or too much is clipped.
    """
    shared = np.count_nonzero(pair.valid)
    if shared < _FEWEST_SHARED:
        raise IdentificationError(f"{shared} instant(s) have a sample in both topics, expected at "
                                  f"least {_FEWEST_SHARED}")
    column = AXES.index(axis)
    reference, sensor = pair.reference[:, column], pair.sensor[:, column]
    _require_no_copy(reference, sensor, pair.valid, pair.step("sensor", column))
    missing = int(np.sum(~pair.valid))
    notes = [f"{missing} of {len(pair)} instants have no sample in one of the topics"] \
        if missing else []
    notes += [*pair.words, *_collinear(pair)]
    moving, standing_notes = moving_samples(pair, column)
    valid, clipping_notes = _unclipped(reference, sensor, moving, pair, column)
    return RecordCheck(dataclasses.replace(pair, valid=valid), missing,
                       int(np.sum(moving & ~valid)), int(np.sum(pair.valid & ~moving)),
                       notes + standing_notes + clipping_notes)


def require_magnitude(pair, axis="x"):
    """Refuse values of a size that no acceleration has in any unit.

    Raises
    ------
    IdentificationError
        Naming the topic and its largest value.
    """
    for name in ("reference", "sensor"):
        values = getattr(pair, name)
        largest = max(values.max(), -values.min())
        moved = np.ptp(values[:, AXES.index(axis)])
        if largest >= _LARGEST or 0 < moved <= _SMALLEST:
            words = f"go up to {largest:.3g}" if largest >= _LARGEST else f"vary by {moved:.3g}"
            raise IdentificationError(
                f"the {name}'s values {words}, expected something between {_SMALLEST:g} and "
                f"{_LARGEST:g}: no unit of acceleration makes them so; is the topic corrupt?")


def _require_no_copy(reference, sensor, valid, lattice):
    delay = bulk_delay(reference, sensor)
    n = len(sensor) - abs(delay)
    first, second = (slice(start, start + n) for start in (max(-delay, 0), max(delay, 0)))
    both = valid[first] & valid[second]
    if not both.any():
        return
    x, y = reference[first][both], sensor[second][both]
    x, middle = x - x.mean(), y - y.mean()
    power = x @ x
    factor = x @ middle / power if power > 0 else 0.0
    largest, spread = np.max(np.abs(middle - factor * x)), np.std(y)
    if largest > _FINE * spread:
        return
    step = max(lattice or 0.0, _decimal_step(y, _FINE * spread))
    if largest <= max(_SAME * np.max(np.abs(y)), _ROUNDING * step * (step < _FINE * spread)):
        later = f", {delay} sample(s) later" if delay else ""
        raise IdentificationError(
            "the sensor's topic is a copy of the reference: apart from rounding, each of its "
            f"samples is {factor:.6g} times the reference's{later}; give the topic of the sensor")


def _decimal_step(values, largest):
    """Power of ten below `largest` to multiples of which the values are rounded; 0 if none."""
    first = int(np.ceil(-np.log10(largest)))
    for digits in range(first, first + _DIGITS):
        if np.all(np.abs(values - np.round(values, digits)) < 1e-6 * 10.0**-digits):
            return 10.0**-digits
    return 0.0


def _collinear(pair):
    """What cannot be told where axes move in proportion."""
    reference, sensor = (values if pair.valid.all() else values[pair.valid]
                         for values in (pair.reference, pair.sensor))
    together = _dependent(reference)
    if together:
        return [f"the reference's axes {together} do not move independently of each other: "
                "cross-axis sensitivity cannot be told from these data"]
    together = _dependent(sensor)
    # axes that all answer to the only one that moves are no wonder
    if together and len(_excited(reference)) == len(AXES):
        return [f"the sensor's axes {together} depend on each other although the reference's do "
                "not: they are no outputs of separate axes"]
    return []


def _dependent(values):
    """Names of axes that are a linear combination of each other; empty if there are none."""
    excited = _excited(values)
    if len(excited) < 2:
        return ""
    strength, direction = np.linalg.eigh(np.corrcoef(np.ascontiguousarray(values[:, excited].T)))
    if strength[0] > _COLLINEAR:
        return ""
    dependent = np.any(np.abs(direction[:, strength <= _COLLINEAR]) > 0.1, axis=1)
    return listed([AXES[i] for i in excited[dependent]])


def _excited(values):
    spread = np.std(np.ascontiguousarray(values.T), axis=1)
    return np.flatnonzero(spread > 1e-6 * spread.max())


def moving_samples(pair, column):
    """Valid instants without those at which one topic stands still while the other moves."""
    reference, sensor = pair.reference[:, column], pair.sensor[:, column]
    steps = [pair.step(name, column) or 0.0 for name in ("reference", "sensor")]
    moving, notes = pair.valid.copy(), []
    sensor_runs = _standstills(sensor, reference, pair.valid, steps[1])
    reference_runs = [run for run in _standstills(reference, sensor, pair.valid, steps[0])
                      if _off_its_rest(reference, run, pair.valid, steps[0])]
    for name, other, values, runs in (("sensor", "reference", sensor, sensor_runs),
                                      ("reference", "sensor", reference, reference_runs)):
        if not runs:
            continue
        still = sum(stop - start for start, stop in runs)
        start, stop = (place / pair.sampling_rate_hz for place in runs[0])
        more = f" and {len(runs) - 1} more time(s)" if len(runs) > 1 else ""
        words = (f"the {name} stands still at {values[runs[0][0]]:.6g} from {start:.4g} s to "
                 f"{stop:.4g} s{more} while the {other} moves")
        for start, stop in runs:
            moving[start:stop] = False
        if moving.sum() < _LEFT * len(pair):
            raise IdentificationError(f"{words}: {moving.sum()} of {len(pair)} samples are left; "
                                      f"was the {name} connected?")
        notes.append(f"{words}: these {still} samples do not count")
    return moving, notes


def _standstills(values, other, valid, step):
    """Where values stand still while the other topic moves: list of (start, stop)."""
    places = np.flatnonzero(valid)
    changes = np.flatnonzero(np.diff(values[places]) != 0) + 1
    edges = np.r_[0, changes, len(places)]
    long = np.flatnonzero(np.diff(edges) >= _STANDSTILL)
    if not len(long):
        return []
    usual = np.std(other[places])
    extremes = values[places].min(), values[places].max()
    runs = [(int(places[edges[i]]), int(places[edges[i + 1] - 1]) + 1) for i in long]
    runs = [run for run in runs if (motion := _motion(other[slice(*run)])) > _MOVING * usual
            and _gain_beside(values, other, *run) * motion > _STEPS * step]
    # what comes to the same extreme again and again is clipped
    at = [values[start] for start, _ in runs]
    return [run for run, value in zip(runs, at) if value not in extremes or at.count(value) == 1]


def _motion(values):
    """Standard deviation, by the median: a shock's onset at the end is no motion all along."""
    return 1.4826 * np.median(np.abs(values - np.median(values)))


def _gain_beside(values, other, start, stop):
    """Ratio of the motions before a run, or after it: a swept sensor answers less and less."""
    before = slice(max(start - _BESIDE, 0), start)
    after = slice(stop, stop + _BESIDE)
    window = before if start >= _STANDSTILL else after
    motion = np.std(other[window]) if len(other[window]) else 0.0
    return np.std(values[window]) / motion if motion > 0 else 0.0


def _off_its_rest(values, run, valid, step):
    """Whether values jump to a standstill or from it, or stand apart from their median."""
    start, stop = run
    before, after = np.flatnonzero(valid[:start]), stop + np.flatnonzero(valid[stop:])
    steps = [abs(values[start] - np.median(values[valid])),
             *(abs(values[start] - values[place]) for place in (*before[-1:], *after[:1]))]
    return max(steps) > max(_JUMP * np.std(values[valid]), _STEPS * step)


def unclipped_reference(pair, column, valid, most=_CLIPPED_REFERENCE):
    """Valid instants without those at which the reference is clipped, and words about these.

    Raises
    ------
    IdentificationError
        If they are more than `most` of the record: the sensor's motion after each is not known.
    """
    found = clipped_reference(pair.reference[:, column], pair.sensor[:, column], valid,
                              pair.step("reference", column))
    count = int(found.samples.sum())
    if not count:
        return valid, []
    words = f"the reference is clipped at {found.words} in {count} of {len(pair)} samples"
    if count > most * len(pair):
        raise IdentificationError(f"{words}: what the sensor answered to there is unknown; "
                                  "excite less or use a reference with a larger range")
    return valid & ~found.samples, [f"{words}, which do not count"]


def _unclipped(reference, sensor, valid, pair, column):
    """Valid instants without the clipped ones."""
    valid, notes = unclipped_reference(pair, column, valid)
    found = clipped_sensor(reference, sensor, valid, pair.step("sensor", column),
                           pair.sampling_rate_hz, pair.lag_s)
    count = int(found.samples.sum())
    if count:
        words = f"the sensor is clipped at {found.words} in {count} of {len(pair)} samples"
        if count > _CLIPPED_SENSOR * valid.sum():
            raise IdentificationError(f"{words}: too little is left to identify it from; excite "
                                      "less, or set a larger range")
        notes.append(f"{words}, which do not count")
        valid = valid & ~found.samples
    return valid, notes
