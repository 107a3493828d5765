"""The clock behind stamps: rate, whole instants, and how far the stamps scatter about it."""

import dataclasses
from typing import NamedTuple

import numpy as np

from ..errors import FracAccelError
from ..signals.sample_rate import estimate_rate
from ..signals.straight_line import straight_line

# Scatter of the stamps [intervals] with which rounding still finds the instants, and the share of
# samples that may have more.
_SCATTER = 0.3
_RARE = 1e-3
_NEIGHBOURS = 15
# Price of a gap in the count of lost samples, and most that one sample's stamp may cost [variances
# of the scatter]; samples by which the count may differ from that by the neighbours' median.
_GAP, _OUTLIER = 10.0, 25.0
_AWAY = 16
_FIRST_PART = 64
# Length of the mean of stamps on the circle of an interval from which there are instants: 0
# without, 0.3 where they scatter by a quarter of it.
_TOGETHER = 0.2
# Neighbours that must lie together where such a share of the instants has no sample.
_TOGETHER_IN, _LOST = 128, 0.02
# Intervals to which a rate is tuned first, and how far it may be off.
_TUNED, _DETUNED = 256, 0.15
# Scatter [intervals] of stamps that are as regular as clocks make them, and of those that look
# wrongly counted (0.29: as likely here as there).
_REGULAR = 1e-3
_SCATTERED = 0.2
# Sampling intervals per sample over which a record may be spread, and how many are never too many.
_SPREAD = 10
_ALWAYS = 10_000
_PARTS = 8
# Stamps of which so many [%] are further from the instants than this [intervals] are no uniform
# clock's: normal scatter of a third of an interval comes to 0.48.
_MOST = 85
_UNEVEN = 0.5
# Instants from most samples to the next above which these are the ticks of a clock that reads the
# samples now and then.
_TICKS = 2
# Scatter [intervals] about a line of stamps of which none is lost: a lost one in the middle, beside
# such a scatter that rounding fails, makes it 0.33.
_COMPLETE = 0.3
# Robust scatter [intervals] of those that are not late, and their share, where stamps are a uniform
# clock's with delays.
_PUNCTUAL = 0.1
_FEWEST_PUNCTUAL = 0.6
# Steps that are short [mean steps], and their share where samples come in batches.
_SHORT = 0.2
_BATCHES = 0.3
# Steps of two ticks that stamps need to be seen as rounded, and the range [ticks] in which rounding
# moves them.
_FEWEST_ROUNDED = 10
_ROUNDED = 1.1
# Rejections of late stamps from a clock line, and what counts as late [robust deviations].
_ROUNDS = 8
_LATE = 3.0
# Percentile of the steps between uneven stamps that sets the rate that they can show.
_LONG_STEP = 95
# Samples on each side of a jump of the stamps, and the share of the power of their scatter that it
# must make.
_ON_EACH_SIDE, _ONE_JUMP = 16, 0.99
# What a robust deviation is multiplied by to be a standard deviation of normal scatter.
_NORMAL = 1.4826


class Jump(NamedTuple):
    """Stamps that jump while the samples go on evenly.

    Attributes
    ----------
    at_s : float
        The first stamp behind it, after the record's first [s].
    size_s : float
        What is added to the stamps from there on [s].
    """

    at_s: float
    size_s: float

    def undone(self, seconds):
        """Stamps [s] after the first one, shape (n,), of samples that go on evenly."""
        return seconds - self.size_s * (seconds >= self.at_s)


@dataclasses.dataclass(frozen=True, eq=False)
class Clock:
    """A line through stamps.

    Attributes
    ----------
    kind : {"regular", "batches", "uneven"}
        Uniform instants that the stamps scatter about; uniform instants whose samples come several
        at a time; none, so that only the stamps say when a sample was taken.
    rate_hz : float
        Of the instants; of uneven stamps, the rate that 95 % of the steps can show.
    start_s : float
        Instant of slot 0 after the first stamp [s].
    slot : ndarray, shape (n,)
        Whole instants, ascending; empty where there are none.
    scatter_s : float
        Standard deviation of the stamps about the line [s], and about two where they jump once;
        0 of uneven ones.
    jump : Jump or None
        Where they jump once against the instants.
    """

    kind: str
    rate_hz: float
    start_s: float
    slot: np.ndarray
    scatter_s: float
    jump: Jump | None = None

    @classmethod
    def of(cls, stamps_ns):
        """Clock of at least three ascending stamps [ns] without a span that `require_span` refuses.

        Samples in batches carry the stamps of their arrival: the last one of each, which waited
        least, says when it was taken.
        """
        seconds = (stamps_ns - stamps_ns[0]) * 1e-9
        found = _batches(seconds) or _ticked(seconds)
        if found is not None:
            return found
        rate = long_term_rate(stamps_ns)
        place = seconds * rate
        # the first stamp may be the one that is off: the instants' phase is the mean one
        phase = float(np.angle(np.mean(np.exp(2j * np.pi * place)))) / (2 * np.pi)
        slot = slots_of(place - phase)
        place = place - slot
        if np.std(place) > _SCATTERED:
            found = _delayed(seconds)
            if found is not None:
                return found
        off = np.abs(place - np.median(place))
        if _is_without_instants(seconds * rate, slot) or np.percentile(off, _MOST) > _UNEVEN \
                or np.median(np.diff(slot)) > _TICKS:
            steps = np.diff(merged(seconds))
            return cls("uneven", float(1 / np.percentile(steps, _LONG_STEP)), 0.0,
                       np.empty(0), 0.0)
        slope, start = straight_line(slot, seconds)
        late = seconds - (slope * slot + start)
        scatter, jump = float(np.std(late)), _set_once(slot, seconds, late, slope)
        if jump is not None:
            before = jump.undone(seconds)
            slope, start = straight_line(slot, before)
            scatter = float(np.std(before - (slope * slot + start)))
            at = np.searchsorted(seconds, jump.at_s)
            # across a gap samples may be lost, or none: the stamps do not tell (`set_clock`)
            return cls("regular", float(1 / slope), float(start), slot, scatter,
                       jump if slot[at] - slot[at - 1] == 1 else None)
        return cls("regular", rate, float(np.median(place)) / rate, slot, scatter)

    def instants_s(self, stamps_ns):
        """Instants [s] of the samples with these stamps, after the first of them."""
        if self.kind == "uneven":
            return (stamps_ns - stamps_ns[0]) * 1e-9
        return self.start_s + self.slot / self.rate_hz

    def without_gap(self, stamps_ns):
        """The clock if none is lost in the longest gap between its samples, and the stamps jump
        there; None where there is none, or too little on a side of it."""
        lost = np.diff(self.slot) - 1
        at = 1 + int(np.argmax(lost)) if len(lost) else 0
        if self.kind != "regular" or not _ON_EACH_SIDE <= at <= len(self.slot) - _ON_EACH_SIDE \
                or lost[at - 1] < 1:
            return None
        after = np.arange(len(self.slot)) >= at
        slot = self.slot - lost[at - 1] * after
        seconds = (stamps_ns - stamps_ns[0]) * 1e-9
        columns = np.stack([slot, np.ones(len(slot)), after], axis=1)
        (slope, start, size), *_ = np.linalg.lstsq(columns, seconds, rcond=None)
        scatter = np.std(seconds - columns @ (slope, start, size))
        return Clock("regular", float(1 / slope), float(start), slot, float(scatter),
                     Jump(float(seconds[at]), float(size)))

    def even_s(self, stamps_ns):
        """Stamps [s] after the first of them, shape (n,), without a jump of theirs."""
        seconds = (stamps_ns - stamps_ns[0]) * 1e-9
        return seconds if self.jump is None else self.jump.undone(seconds)

    def independent_stamps(self, stamps_ns):
        """How many of its stamps scatter each for itself: one of each batch."""
        return len(merged(1e-9 * (stamps_ns - stamps_ns[0]))) if self.kind == "batches" \
            else len(stamps_ns)


def _is_without_instants(place, slot):
    """Whether stamps [intervals] lie anywhere between the instants that they are said to belong to,
    and many of these have none: not even neighbours lie on instants of their own."""
    if slot[-1] - slot[0] + 1 < (1 + _LOST) * len(slot) or len(place) < _TOGETHER_IN:
        return False
    blocks = place[:len(place) // _TOGETHER_IN * _TOGETHER_IN].reshape(-1, _TOGETHER_IN)
    return np.mean(np.abs(np.mean(np.exp(2j * np.pi * blocks), axis=1))) < _TOGETHER


def require_span(stamps_ns, where):
    """Refuse stamps between which there are far more instants than samples.

    A record is laid out on its instants; one stamp a year ahead would ask for all the memory.

    Raises
    ------
    FracAccelError
        Saying between which samples the gap is.
    """
    span, interval = float(int(stamps_ns[-1]) - int(stamps_ns[0])), typical_interval(stamps_ns)
    if span / interval <= max(_SPREAD * len(stamps_ns), _ALWAYS):
        return
    steps = np.diff(stamps_ns.astype(float))
    longest = int(np.argmax(steps))
    start = 1e-9 * (float(stamps_ns[longest]) - float(stamps_ns[0]))
    raise FracAccelError(
        f"{where}: {len(stamps_ns)} samples are spread over {span / interval:.6g} sampling "
        f"intervals; {start:.6g} s after the start the stamps jump by {1e-9 * steps[longest]:.6g} "
        "s: cut the record there, or leave out the samples whose stamps are wrong")


def typical_interval(stamps):
    """Mean step in a part of the record without long gaps, in the stamps' unit: a median of parts.

    It holds where samples come in batches, and most steps are too short.
    """
    edges = np.unique(np.linspace(0, len(stamps) - 1, _PARTS + 1).astype(int))
    # a float holds today's nanoseconds to 256 of them only
    return float(np.median(np.diff(stamps[edges]) / np.diff(edges)))


def usable(samples):
    """Mask of the samples whose stamps advance and whose values are finite.

    Where they come several at a time with one stamp, and most have other values, all of a batch.
    """
    stamps = samples.stamps_ns
    good = np.isfinite(samples.values).all(axis=1)
    latest = np.maximum.accumulate(stamps)[:-1]
    advances, repeats = good.copy(), good.copy()
    advances[1:] &= stamps[1:] > latest
    repeats[:1] = False
    repeats[1:] &= stamps[1:] == latest
    differs = np.any(samples.values[1:] != samples.values[:-1], axis=1)
    if np.sum(repeats[1:] & differs) > _BATCHES * np.sum(good):
        every = advances | repeats
        if _batches((stamps[every] - stamps[0]) * 1e-9) is not None:
            return every
    return advances


def merged(seconds, *columns):
    """Ascending stamps without such that are almost the same, and columns with them: means."""
    steps = np.diff(seconds)
    first = np.r_[0, np.flatnonzero(steps >= _SHORT * typical_interval(seconds)) + 1]
    if len(first) == len(seconds):
        return (seconds, *columns) if columns else seconds
    count = np.diff(np.r_[first, len(seconds)])
    means = [np.add.reduceat(values, first, axis=0) / count.reshape(-1, *[1] * (values.ndim - 1))
             for values in (seconds, *columns)]
    return means if columns else means[0]


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
        instant, what is lost between the samples is counted by the median of neighbours, and near
        the losses by what is likeliest of all neighbours together.
    """
    nearest = np.round(place)
    scatter = place - nearest
    scatter = scatter - np.median(scatter)
    if np.mean(np.abs(scatter) > _SCATTER) < _RARE:
        return nearest
    from scipy.ndimage import median_filter
    ahead = place - np.arange(len(place))
    middle = median_filter(ahead, _NEIGHBOURS, mode="nearest")
    lost = np.maximum.accumulate(np.round(middle - middle[0]) + np.round(middle[0]))
    off = ahead - lost
    unclear = np.r_[False, np.diff(lost) > 0] | (np.abs(off - np.median(off)) > 0.5)
    near = np.convolve(unclear, np.ones(2 * _NEIGHBOURS + 1), "same") > 0.5
    near[[0, -1]] = False
    edges = np.flatnonzero(np.diff(near)) + 1
    together = np.abs(np.mean(np.exp(2j * np.pi * place)))
    if together < max(_TOGETHER, 4 / np.sqrt(len(place))):
        edges = edges[:0]  # the rate is another one, or there is none
    scatter = max(_deviation(off), 1e-3)
    counted = lost.copy()
    for start, stop in zip(edges[::2], edges[1::2]):
        if lost[stop] > lost[start - 1]:
            counted[start:stop] = _likeliest_losses(
                ahead[start:stop], lost[start:stop], (lost[start - 1], lost[stop]), scatter)
    return np.arange(len(place)) + counted


def _likeliest_losses(ahead, about, ends, scatter):
    """How much is lost before each sample: whole numbers near others, `about`, that never fall.

    From the first of the `ends` to the second, they leave the least of what the stamps are `ahead`
    [intervals] of the count of samples, beside a price for each gap (dynamic programming: the
    Viterbi algorithm).
    """
    near = np.arange(-_AWAY, _AWAY + 1)
    levels = about[:, None] + near
    price = np.minimum(((ahead[:, None] - levels) / scatter)**2, _OUTLIER)
    price[(levels < ends[0]) | (levels > ends[1])] = np.inf
    total, came, place = price[0] + _GAP * (levels[0] > ends[0]), [], near + _AWAY
    for row, rise in zip(price[1:], np.diff(about).astype(int)):
        least = np.minimum.accumulate(total)
        where = np.maximum.accumulate(np.where(total == least, place, 0))
        below = np.minimum(place + rise, len(near)) - 1
        lower = np.where(below >= 0, least[below], np.inf) + _GAP
        same = np.append(total[rise:], np.full(min(rise, len(near)), np.inf))
        came.append(np.where(lower < same, where[below], place + rise))
        total = np.minimum(lower, same) + row
    best = [int(np.argmin(total + _GAP * (levels[-1] < ends[1])))]
    for step in reversed(came):
        best.append(int(step[best[-1]]))
    return levels[np.arange(len(levels)), best[::-1]]


def long_term_rate(stamps):
    """Rate over the whole record [Hz], by lines fitted to ever longer parts of it.

    Each line says to which instants the stamps [ns] of the next part belong, however they scatter.
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
    else:
        found.append(_tuned(seconds, interval))
    scatter, interval, place = min(found, key=lambda entry: entry[0])
    if scatter < _REGULAR:
        # the ends say it to the last digit
        return 1e9 * (np.round(place[-1]) - np.round(place[0])) / float(stamps[-1] - stamps[0])
    return 1e9 / interval


def _tuned(seconds, interval):
    """Scatter [intervals], interval and places of the instants on which most stamps lie, however
    many are lost: the highest peak of the stamps' spectrum near that of another interval
    (Rayleigh's statistic; K. V. Mardia, P. E. Jupp, *Directional Statistics* (2000), section 6.3).
    """
    span, low, high = _TUNED * interval, (1 - _DETUNED) / interval, (1 + _DETUNED) / interval
    while True:
        part = seconds[seconds <= span]
        tried = np.arange(low, high, 0.25 / span)
        sums = np.array([np.mean(np.exp(2j * np.pi * rate * part)) for rate in tried])
        best = int(np.argmax(np.abs(sums)))
        if span >= seconds[-1]:
            place = seconds * tried[best] - np.angle(sums[best]) / (2 * np.pi)
            line = straight_line(np.round(place), seconds)
            place = (seconds - line[1]) / line[0]
            return np.std(place - np.round(place)), line[0], place
        low, high = tried[best] + np.array([-0.5, 0.5]) / span
        span = min(4 * span, seconds[-1])


def _grown(seconds, slots):
    """Line through the first stamps, over ever more of them."""
    length = len(slots)
    line = straight_line(slots, seconds[:length])
    while length < len(seconds):
        length = min(2 * length, len(seconds))
        place = (seconds[:length] - line[1]) / line[0]
        line = straight_line(np.round(place), seconds[:length])
    return line


def _set_once(slot, seconds, late, interval):
    """`Jump` of stamps that scatter little but for it, or None, from how `late` they are on a line.

    Of all instants, the one at which a step beside a line leaves least of the stamps; from their
    sums, since a fit for each would take for ever.
    """
    count = len(slot)
    if count <= 3 * _ON_EACH_SIDE or np.std(late) < _REGULAR * interval:
        return None
    away = slot - slot.mean()
    # of each sample, what lies from it on
    number = np.arange(count, 0, -1.0)
    sums, places = np.cumsum(late[::-1])[::-1], np.cumsum(away[::-1])[::-1]
    power = number - number**2 / count - places**2 / (away @ away)
    inner = slice(_ON_EACH_SIDE, count - _ON_EACH_SIDE)
    taken = np.where(power > 0, sums**2 / np.maximum(power, 1e-300), 0.0)[inner]
    at = _ON_EACH_SIDE + int(np.argmax(taken))
    if taken.max() < _ONE_JUMP * (late @ late):
        return None
    return Jump(float(seconds[at]), float(sums[at] / power[at]))


def _batches(seconds):
    """Clock of samples that come several at a time and none of which is lost, or None."""
    steps = np.diff(seconds)
    interval = typical_interval(seconds)
    short = steps < _SHORT * interval
    if np.mean(short) < _BATCHES:
        return None
    last = np.r_[np.flatnonzero(~short), len(steps)]
    place, stamps = last.astype(float), seconds[last]
    line, late, kept = _robust_line(place, stamps, interval)
    size = len(seconds) / len(last)
    if kept.sum() < _FIRST_PART // 8 or _deviation(late) > _SCATTER * size * line[0] \
            or np.mean(kept) < 0.5:
        return None
    least = float(np.percentile(late[kept], 5))
    return Clock("batches", float(1 / line[0]), float(line[1]) + least,
                 np.arange(len(seconds), dtype=float), float(np.std(late[kept])))


def _ticked(seconds):
    """Clock of stamps that were rounded to long ticks and none of which is lost; or None.

    Rounding makes some steps two ticks long, evenly; losses do so at random, and add up.
    """
    steps = np.diff(seconds)
    tick = steps.min()
    ticks = np.round(steps / tick)
    if np.max(np.abs(steps - ticks * tick)) > _REGULAR * tick or ticks.max() > 2 \
            or np.sum(ticks == 2) < _FEWEST_ROUNDED:
        return None
    count = np.arange(len(seconds), dtype=float)
    line = np.polyfit(count, seconds, 1)
    off = seconds - np.polyval(line, count)
    if np.ptp(off) > _ROUNDED * tick:
        return None
    return Clock("regular", float(1 / line[0]), float(line[1]), count, float(np.std(off)))


def _delayed(seconds):
    """Clock of stamps of which many are late or scatter much, but no sample is lost; or None."""
    interval, count = typical_interval(seconds), np.arange(len(seconds), dtype=float)
    line, late, kept = _robust_line(count, seconds, interval)
    if np.mean(kept) < _FEWEST_PUNCTUAL or _deviation(late[kept]) > _PUNCTUAL * line[0]:
        line = np.polyfit(count, seconds, 1)
        late, kept = seconds - np.polyval(line, count), slice(None)
        if np.std(late) > _COMPLETE * line[0]:
            return None
    return Clock("regular", float(1 / line[0]), float(line[1] + np.median(late[kept])), count,
                 float(np.std(late[kept])))


def _robust_line(place, stamps, interval):
    """Line through stamps without those that are late, the rest that it leaves, and who counts."""
    kept = np.ones(len(place), bool)
    for _ in range(_ROUNDS):
        line = np.polyfit(place[kept], stamps[kept], 1)
        late = stamps - np.polyval(line, place)
        limit = _LATE * max(_deviation(late[kept]), 1e-3 * interval)
        if np.array_equal(kept, kept := np.abs(late - np.median(late[kept])) < limit):
            break
    return line, late, kept


def _deviation(values):
    """Standard deviation by the median of the deviations from the median."""
    return float(_NORMAL * np.median(np.abs(values - np.median(values))))
