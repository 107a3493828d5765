"""Two topics on one time base: sample by sample, or by their stamps."""

from typing import NamedTuple

import numpy as np

from ..errors import FracAccelError
from . import resampling

# Common instants of two topics that make a record.
FEWEST = 32
# Drift of one topic's instants along the other's over the record that is none [samples], and how
# many standard uncertainties of it, by the stamps' scatter.
_NO_DRIFT = 0.02
_UNSURE = 6.0
# Rates this far apart are of two devices, whatever the drift: no short record leaves it open.
_SAME_RATE = 1e-3
# Share of the samples that must stay for those near gaps to be left out.
_CLEAR = 0.5
# Sampling intervals by which most stamps of two uneven topics differ at most, beside a common lag,
# where their samples were taken together.
_TOGETHER = 0.1
# Ratio of the rates up to which the sensor keeps its own instants though it is the faster one.
_ALIKE = 1.01


class Paired(NamedTuple):
    """See `Record`."""

    sampling_rate_hz: float
    reference: np.ndarray
    sensor: np.ndarray
    present: tuple
    valid: np.ndarray
    lag_s: float
    start_ns: int
    band_hz: float | None = None
    resampled: tuple = ()
    words: tuple = ()


def same_clock(one, two):
    """Whether each sample of one topic belongs to a sample of the other, all along."""
    clocks = one.clock, two.clock
    if any(clock.kind != "regular" for clock in clocks):
        return False
    ratio = abs(clocks[0].rate_hz / clocks[1].rate_hz - 1)
    count = min(len(one), len(two))
    # standard uncertainty of a fitted line's slope times its length
    unsure = np.sqrt(12 / count) * np.hypot(*(clock.scatter_s * clock.rate_hz for clock in clocks))
    return ratio < _SAME_RATE and ratio * count <= _NO_DRIFT + _UNSURE * unsure


def share_instants(one, two):
    """Have topics with the same stamps share a clock, and uneven samples that were taken together,
    one by one, lie on the first topic's instants: what their stamps differ by, beside a common lag,
    is the writing of them."""
    if np.array_equal(one.stamps_ns, two.stamps_ns):
        two.clock, two.stamps_ns = one.clock, one.stamps_ns
        return
    if len(one) != len(two) or any(topic.clock.kind != "uneven" for topic in (one, two)):
        return
    apart = two.stamps_ns - one.stamps_ns
    lag = int(np.median(apart))
    if np.percentile(np.abs(apart - lag), 95) < _TOGETHER * np.median(np.diff(one.stamps_ns)):
        two.stamps_ns = one.stamps_ns + lag


def by_slots(one, two):
    """Pair topics of one clock sample by sample."""
    interval, rate = 1e9 / one.clock.rate_hz, one.clock.rate_hz
    start = int(one.stamps_ns[0])
    places = [(topic.stamps_ns[0] - start + 1e9 * topic.clock.even_s(topic.stamps_ns)) / interval
              for topic in (one, two)]
    slots = [topic.clock.slot + np.round(np.median(place - topic.clock.slot))
             for topic, place in zip((one, two), places)]
    # jitter averages out of the mean; a common clock offset between the two topics stays
    lag = interval * float(np.median(places[1] - slots[1]) - np.median(places[0] - slots[0]))
    first = int(max(slots[0][0], slots[1][0]))
    last = int(min(slots[0][-1], slots[1][-1]))
    if last - first + 1 < FEWEST:
        raise _apart(one, two)
    gridded, present = zip(*(_on_slots(slot, topic.values, first, last)
                             for slot, topic in zip(slots, (one, two))))
    return Paired(rate, *gridded, present, present[0] & present[1], lag * 1e-9,
                  int(start + first * interval))


def by_stamps(one, two):
    """Put the faster topic on the slower one's instants, or both on new ones."""
    origin = int(one.stamps_ns[0])
    starts = [(int(topic.stamps_ns[0]) - origin) * 1e-9 for topic in (one, two)]
    rates = [topic.clock.rate_hz for topic in (one, two)]
    uniform = [topic.clock.kind != "uneven" for topic in (one, two)]
    if uniform[1] and rates[1] <= _ALIKE * rates[0]:
        base = 1
    else:
        base = 0 if uniform[0] and rates[0] <= rates[1] else None
    rate = min(rates) if base is None else rates[base]
    signals = [_uniform(topic, start, rate) for topic, start in zip((one, two), starts)]
    # the resampled ones are known a filter's length from their ends
    reach = [0.0 if i == base else resampling.REACH / min(rate, signal.rate_hz)
             for i, signal in enumerate(signals)]
    first = max(s.start_s + r for s, r in zip(signals, reach))
    last = min(s.start_s + (len(s.values) - 1) / s.rate_hz - r for s, r in zip(signals, reach))
    if base is not None:
        # on the base's own instants
        begin = signals[base].start_s
        first = begin + np.ceil((first - begin) * rate - 1e-6) / rate
    count = int(np.floor((last - first) * rate + 1e-6)) + 1
    said = " and the ".join(f"{topic.name} {_rate_words(topic.clock)}" for topic in (one, two))
    if count < FEWEST:
        if last < first - 2 * max(reach):
            raise _apart(one, two)
        raise FracAccelError(f"the {said}: {max(count, 0)} instants in common are left at "
                             f"{rate:.6g} Hz, expected at least {FEWEST}: record longer")
    gridded, present = [], []
    for i, signal in enumerate(signals):
        if i == base:
            place = round((first - signal.start_s) * rate)
            gridded.append(signal.values[place:place + count])
            present.append(signal.present[place:place + count])
            continue
        frame = signal.rate_hz, signal.start_s, rate, first, count
        gridded.append(resampling.band_limited(signal.values, *frame))
        present.append(resampling.untouched(signal.present, *frame))
    valid = present[0] & present[1]
    if base is not None:
        # what is beyond the band is taken from the base, too: near a gap that is a guess
        clear = valid & resampling.untouched(present[base], rate, 0.0, rate, 0.0, count)
        valid = clear if clear.sum() > _CLEAR * valid.sum() else valid
    changed = tuple(name for i, name in enumerate(("reference", "sensor")) if i != base)
    band = resampling.BAND * rate
    return Paired(rate, *gridded, tuple(present), valid, 0.0, origin + round(first * 1e9), band,
                  changed, (f"the {said}: compared at {rate:.6g} Hz up to {band:.4g} Hz",))


class _Signal(NamedTuple):
    """Values on uniform instants, and which of them are a sample's own."""

    values: np.ndarray
    present: np.ndarray
    rate_hz: float
    start_s: float


def _uniform(topic, start_s, target_hz):
    clock = topic.clock
    if clock.kind != "uneven":
        values, present = resampling.filled(clock.slot, topic.values)
        return _Signal(values, present, clock.rate_hz,
                       start_s + clock.start_s + clock.slot[0] / clock.rate_hz)
    seconds = (topic.stamps_ns - topic.stamps_ns[0]) * 1e-9
    # fine enough for the steps that are shorter than most
    rate = 2 * max(target_hz, len(seconds) / seconds[-1])
    values, present = resampling.on_grid(seconds, topic.values, rate)
    return _Signal(values, present, rate, start_s)


def _rate_words(clock):
    return f"has {clock.rate_hz:.6g} Hz" + {"uneven": " (uneven)", "batches": " (in batches)"}.get(
        clock.kind, "")


def _on_slots(slot, values, first, last):
    """Values on all instants between two, bridged linearly; which of them are a sample's own."""
    begin = int(slot[0])
    if begin <= first and last <= slot[-1] == begin + len(slot) - 1 and (np.diff(slot) == 1).all():
        # as they are: of a long record, a copy would take most memory
        return values[first - begin:last - begin + 1], np.ones(last - first + 1, bool)
    grid = np.arange(first, last + 1)
    place = np.clip(np.searchsorted(slot, grid), 0, len(values) - 1)
    here = slot[place] == grid
    if here.all():
        return values[place], here
    result = np.stack([np.interp(grid, slot, values[:, i]) for i in range(3)], 1)
    result[here] = values[place[here]]
    return result, here


def _apart(one, two):
    spans = (f"{topic.stamps_ns[0] * 1e-9:.3f} s to {topic.stamps_ns[-1] * 1e-9:.3f} s"
             for topic in (one, two))
    return FracAccelError("reference and sensor have no time in common: the reference's stamps run "
                          "from {}, the sensor's from {}".format(*spans))
