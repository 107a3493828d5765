"""The error budget: what is left of a sensor's signal, parted by kind."""

import dataclasses
import functools

import numpy as np
from scipy.fft import irfft, rfft

from ..identification.response.recognise import recognise
from ..record.resampling import BAND
from . import memory, repeats, shapes, unrelated
from .blocks import Blocks, intervals
from .filters import SAMPLES, Filters, can_be_judged, lag_step
from .modulated import Modulated

# In the order in which they are taken from the residual.
PARTS = ("bursts", "lines", "linear", "across", "even", "odd", "time_varying", "slow", "distortion",
         "reference", "noise")
# The same where one part is taken in several pieces, each from what the others leave.
_PIECES = {"lines": "lines", "linear": "linear", "across": "across", "even": "even", "odd": "odd",
           "even_of_input": "even", "odd_of_input": "odd", "time_varying": "time_varying",
           "level": "time_varying", "periodic": "time_varying", "slow": "slow",
           "distortion": "distortion"}
# Pieces of which other candidates are tried when longer ones of one kind no longer gain.
_WHOLE_LISTS = ("linear", "time_varying")
# Pieces that are none where they take nothing for sure: another of the same part has its share.
_ONLY_SURE = ("even_of_input", "odd_of_input", "level", "periodic")
# Pieces that a gain which follows the level resembles.
_LIKE_LEVEL = ("odd", "odd_of_input")
WORDS = {
    "linear": "a linear filter of this axis would take it",
    "across": "a linear filter of the other axes would take it",
    "even": "nonlinear, the same for both directions",
    "odd": "nonlinear, turns its sign with the motion",
    "time_varying": "gain or timing changes along the record",
    "lines": "tones that the reference does not have",
    "bursts": "short and strong, unrelated to the motion",
    "slow": "the offset, and its drift and steps",
    "distortion": "repeats with the excitation's period, so no noise",
    "reference": "shared with the second sensor: reference or fixture",
    "noise": "nothing in the record predicts it"}
# Lags [samples] of the filters that are tried: ahead, behind.
_LENGTHS = ((0, 0), (-1, 2), (-4, 8), (-12, 24), (-32, 96), (-64, 448), (-64, 960))
_ALWAYS = 5
# The same, and how many of those lengths there are, where it must be quick.
_ALWAYS_QUICK = 2
_QUICK_LENGTHS = 5
_SHAPE_LENGTHS = ((0, 0), (-1, 2), (-4, 12))
# A filter of the likeliest shapes that may ring as the sensor does.
_RINGING = (2, (-16, 112))
# A filter beside integrals of the motion, which does what they do not.
_BESIDE = (-4, 8)
# Shapes of what drives the sensor are filtered as the motion is; correlation of both from which
# they are those of the output.
_DRIVEN_LENGTHS = ((0, 0), (-1, 2), (-4, 12))
_SAME = 0.995
# Power of an axis, of the strongest one's, from which it moves.
_MOVES = 1e-10
# Tones with which a gain may change, at most.
_MODULATIONS = 4
# Orders of the courses of slowly changing weights.
_COURSES = (1, 2, 4, 8, 16)
# Standard errors by which a longer filter must take more of the judged blocks, and by which the
# first must take any.
_BETTER = 1.0
_ANY = 2.0
# Times the share that other axes have by chance of what has few independent frequencies, which the
# first filter of theirs must take, and the most that this is.
_BEYOND_CHANCE, _CHANCE_AT_MOST = 2.0, 0.5
# Error of a fit to coloured noise, over that of one to white noise.
_COLOURED = 4.0
# Share of what a part is taken from that is worth a longer filter.
_WORTH = 1e-4
# A clipped prediction before anything is known of outliers.
_CLIPPED = 5.0
# Samples at both ends in which no burst is looked for.
_ENDS = 128
# Share of the samples that must stay when the ends are not judged.
_STAYS = 0.7
_STRETCHES = 10
_OCTAVES = 6
# Energy of the reference below which lies what counts as slower than it, and that of a tone's
# peaks from which the reference is made of tones.
_LOWEST = 0.01
# Energy below which all of the reference's band lies, and samples of its fastest cycle that are
# enough for a filter of it and its harmonics.
_HIGHEST = 0.995
_FASTER = 8


@dataclasses.dataclass(frozen=True)
class Budget:
    """Parts of a residual.

    Attributes
    ----------
    parts : list of dict
        ``part``, ``share`` of the residual's power, ``ci95``, and ``of_output``, the RMS of the
        part over the standard deviation of the sensor's signal. The shares add up to 1.
    rms, output_rms : float
        Of the residual, and standard deviation of the measured signal [output units].
    band_edges_hz : ndarray, shape (bands + 1,)
    in_bands : dict of str to ndarray, shape (bands,)
        Power of each part in each band, of the residual's whole power.
    stretch_edges_s : ndarray, shape (11,)
    along : dict of str to ndarray, shape (10,)
        Power of each part in each stretch of the record, of the residual's whole power.
    """

    parts: list
    rms: float
    output_rms: float
    band_edges_hz: np.ndarray
    in_bands: dict
    stretch_edges_s: np.ndarray
    along: dict

    def share(self, part):
        """Share of one part; 0 where it was not looked for."""
        return next((entry["share"] for entry in self.parts if entry["part"] == part), 0.0)

    def as_list(self, of=None):
        """As a result file has it: part, share and ci95, and of which model."""
        return [{"part": entry["part"], **({"of": of} if of else {}), "share": entry["share"],
                 "ci95": entry["ci95"]} for entry in self.parts]

    def picture(self):
        """Bands and stretches as plain numbers, for a report."""
        return {"band_edges_hz": self.band_edges_hz.tolist(),
                "in_bands": {part: values.tolist() for part, values in self.in_bands.items()},
                "stretch_edges_s": self.stretch_edges_s.tolist(),
                "along": {part: values.tolist() for part, values in self.along.items()}}


def error_budget(residual, measured, simulated, reference, used, sampling_rate_hz, axis,
                 other_sensor_residual=None):
    """Part what a model leaves of a sensor's signal; see `Division`."""
    return Division(reference, used, sampling_rate_hz, axis).of(
        residual, measured, simulated, other_sensor_residual)


class Division:
    """Error budgets of several models on one record; what hangs on the record only is kept.

    Parameters
    ----------
    reference : ndarray, shape (n, 3)
        Acceleration [m/s²] at uniform instants, finite.
    used : ndarray of bool, shape (n,)
        False where a sample does not count.
    sampling_rate_hz : float
    axis : {0, 1, 2}
    quick : bool
        Whether long filters are tried only where shorter ones keep gaining.
    """

    def __init__(self, reference, used, sampling_rate_hz, axis, quick=False):
        self.quick = quick
        self.used = np.asarray(used, bool)
        if not self.used.any():
            self.used = np.ones(len(self.used), bool)
        self.rate = float(sampling_rate_hz)
        power = np.var(reference[self.used], axis=0)
        # an offset and gravity's share of a gain cannot be told apart: the mean is no excitation
        self.axes = [np.ascontiguousarray(reference[:, i] - reference[self.used, i].mean())
                     for i in (axis, *(i for i in range(3) if i != axis))
                     if power[i] > _MOVES * power.max() or i == axis]
        self.moves = bool(power[axis] > 0)
        self.x = self.axes[0]
        self.n = len(self.x)
        self.blocks = Blocks.of(self.x)
        self._filters = {}
        self._period = None
        energy = np.cumsum(np.abs(rfft(self.x * np.hanning(self.n)))**2)
        self.lowest = max(np.searchsorted(energy, _LOWEST * energy[-1]), 1) / self.n
        self._lines_of_reference()

    @property
    def period(self):
        """Samples after which the reference repeats; 0 where it does not."""
        if self._period is None:
            self._period = recognise(self.x, self.rate).period_samples if self.moves \
                and self.n >= 64 else 0
        return self._period

    def of(self, residual, measured, simulated, other_sensor_residual=None):
        """Budget of one model.

        Parameters
        ----------
        residual, measured, simulated : ndarray, shape (n,)
            Measured less simulated, and both [output units].
        other_sensor_residual : ndarray, shape (n,), optional
            Residual of a second sensor on the same body against the same reference, at the same
            instants, divided by its gain and multiplied by this sensor's.

        Returns
        -------
        Budget
        """
        return _One(self, np.where(self.used, residual, 0.0), measured, simulated,
                    other_sensor_residual).budget()

    def _lines_of_reference(self):
        """Its spectrum over its floor, and its tones where it has few."""
        self.ratio, self.tones = np.zeros(self.n // 2 + 1), np.empty(0)
        for values in self.axes:
            if not values.any():
                continue
            place, _, ratio = unrelated.spectrum_peaks(values)
            self.ratio = np.maximum(self.ratio, ratio)
            if len(place) <= unrelated.FEW_TONES:
                self.tones = np.r_[self.tones, place / self.n]

    def fits(self, coefficients, span, step):
        """Whether the record is long enough for a filter."""
        return can_be_judged(self.blocks, self.used, coefficients, span, step)

    @property
    def usual_lags(self):
        """Samples that the longest filter remembers which is tried in any record."""
        return _LENGTHS[_QUICK_LENGTHS - 1][1]

    @property
    def words(self):
        """What is to be said where most of the motion is so short that a usual filter, for which
        the record is long enough, cannot be learnt and judged on different parts of it."""
        size, span = _span(_LENGTHS[_QUICK_LENGTHS - 1])
        if not self.moves or self.fits(size, span, 1) or not self.fits(size, 1, 1):
            return []
        longest = max((length[1] for length in _LENGTHS if self.fits(*_span(length), 1)),
                      default=0)
        return ["most of the motion lies in so short a time that no filter which remembers more "
                f"than {longest / self.rate:.2g} s could be judged on other data: what a longer "
                "one would take counts as noise"]

    def filters(self, key, make):
        """Filters of the reference, kept for the next budget."""
        if key not in self._filters:
            self._filters[key] = make()
        return self._filters[key]


class _One:
    """One budget in the making."""

    def __init__(self, record, residual, measured, simulated, other):
        self.r, self.e, self.other = record, residual, other
        self.measured = np.asarray(measured, float)
        self.simulated = np.asarray(simulated, float)
        self.flagged = np.zeros(record.n, bool)
        self.inside = np.ones(record.n, bool)
        self.step = self._step()
        self.predicted, self.kept, self.chosen, self.sizes = {}, {}, {}, {}
        # power that each piece takes of what is judged
        self.taken = {}

    def _step(self):
        """Samples of a lag: more than one where motion and residual are far slower than that."""
        r = self.r
        return lag_step((r.x, self.e - self.e[r.used].mean()), r.used, _HIGHEST, _FASTER)

    def budget(self):
        r = self.r
        power = float(np.mean(self.e[r.used]**2))
        # what is far below the output's own digits is nothing
        if not power > 1e-28 * max(float(np.mean(self.measured[r.used]**2)), 1e-300):
            return self._made([], np.zeros((0, r.n)), power)
        # an offset is no other part's
        self.predicted["slow"] = np.full(r.n, np.median(self.e[r.used]))
        self._bursts_first()
        self._pass()
        self._leave_out_ends()
        self._find_bursts(self.e - sum(self.predicted.values()))
        self._pass()
        return self._summed(power)

    def _bursts_first(self):
        """Bursts, before any other part is known: beside a fit to clipped values."""
        r = self.r
        moving = np.where(r.used, self.e - self.predicted["slow"], 0.0)
        size = _CLIPPED * unrelated.scale(moving, self._motion(), r.used)
        clipped = np.clip(moving, -size, size)
        predicted = np.zeros(r.n)
        if r.moves:
            lengths = [length for length in _LENGTHS[:4] if r.fits(*_span(length), self.step)]
            lengths = lengths or _LENGTHS[:1]
            predicted = self._reference_filters(lengths[-1]).predict(clipped)
            if np.sum((clipped - predicted)[r.used]**2) > np.sum(clipped[r.used]**2):
                predicted = np.zeros(r.n)
        self._find_bursts(moving - predicted)

    def _leave_out_ends(self):
        """Do not judge where the filter found would have to know what lies beyond the record."""
        length = self.chosen.get("linear")
        if not isinstance(length, tuple):
            return
        low, high = (lag * self.step for lag in length[:2])
        inside = np.zeros(self.r.n, bool)
        inside[max(high, 0):self.r.n + min(low, 0)] = True
        if np.sum(inside & self.r.used) > _STAYS * self.r.used.sum():
            self.inside = inside

    def _find_bursts(self, rest):
        found = unrelated.bursts(rest, self._motion(), self.r.used)
        # what lies before the record and after it rings on in it
        found[:_ENDS] = found[-_ENDS:] = False
        self.flagged = found & self.inside

    def _motion(self):
        return self.simulated if np.ptp(self.simulated) else self.r.x

    def _reference_filters(self, length):
        r = self.r
        return r.filters(("linear", length, self.step), lambda: Filters(
            [r.x], [length], r.blocks, r.used, self.step))

    def _pass(self):
        """Each part from what the others leave, in their order."""
        self.again = dict(self.predicted)
        first = "level" not in self.chosen
        for piece in _PIECES:
            if piece == "even" and first:
                level = self._taken_by("level")
            self._fit(piece)
            if piece == _LIKE_LEVEL[-1] and first and level > sum(
                    self.taken.get(name, 0.0) for name in _LIKE_LEVEL):
                # what follows the level more than the instant is no curve
                for name in _LIKE_LEVEL:
                    self._forget(name)
                for name in ("level", *_LIKE_LEVEL):
                    self._fit(name)

    def _taken_by(self, piece):
        """Power that a piece takes alone; nothing of it is kept."""
        self._fit(piece)
        taken = self.taken.get(piece, 0.0)
        self._forget(piece)
        return taken

    def _forget(self, piece):
        for known in (self.predicted, self.kept, self.chosen, self.sizes, self.taken):
            known.pop(piece, None)

    def _fit(self, piece):
        # what repeats contains every other part of a repeated motion
        others = [values for name, values in self.predicted.items()
                  if name not in (piece, "distortion") or piece == "distortion" != name]
        target = self.e - sum(others) if others else self.e.copy()
        target[self.flagged] = 0.0
        for known in (self.predicted, self.kept, self.taken):
            known.pop(piece, None)
        made = self._best(piece, target)
        if made is not None:
            self.predicted[piece], self.kept[piece] = made

    @property
    def counted(self):
        return self.r.used & ~self.flagged & self.inside

    def _best(self, part, target):
        """Prediction of the simplest candidate that no other clearly beats.

        And the one that the share is estimated with, where none takes anything.
        """
        judged = self.counted
        best = first = self.leading = None
        best_gain, left = np.zeros(len(self.r.blocks)), float(target @ target)
        worse, self.enough = 0, False
        least = max(_WORTH, self._by_chance(target) if part == "across" else 0.0)
        for place, (name, size, make) in enumerate(self._candidates(part, target)):
            if part in self.chosen and name != self.chosen[part]:
                continue
            predicted = np.where(judged, make(), 0.0)
            gains = self._gains(part, target, predicted)
            if first is None:
                first = name, predicted, size
            more = gains - best_gain
            error = np.sqrt(len(more)) * np.std(more)
            if more.sum() > max((_BETTER if best else _ANY) * error,
                                (_WORTH if best else least) * left):
                best, best_gain, worse = (name, predicted, size), gains, 0
                self.leading = name
            else:
                worse += 1
                self.enough = worse > 1 and place >= (
                    _ALWAYS_QUICK if self.r.quick else _ALWAYS)
                if self.enough and part not in _WHOLE_LISTS:
                    break
        if first is None:
            return None
        if part not in self.chosen:
            self.chosen[part] = (best or first)[0]
        if not best and part in _ONLY_SURE:
            return None
        _, estimate, self.sizes[part] = best or first
        self.taken[part] = float(best_gain.sum())
        return (estimate if best else np.zeros(self.r.n)), estimate

    def _by_chance(self, target):
        """Share of a target that other axes may have by chance: one weight each of the numbers that
        its few strong frequencies are. Blocks of what wanders are not independent."""
        power = np.abs(rfft(target))**2
        numbers = 2 * power.sum()**2 / max(np.sum(power**2), 1e-300)
        return min(_BEYOND_CHANCE * len(self.r.axes[1:]) / max(numbers, 1e-300), _CHANCE_AT_MOST)

    def _gains(self, part, target, predicted):
        """Power that a prediction takes of each block; of shapes, of what neither a slow course nor
        folding at the Nyquist frequency would make as well."""
        if _PIECES[part] in ("even", "odd"):
            target, predicted = (self._shaped(values) for values in (target, predicted))
        return self.r.blocks.sums((2 * target - predicted) * predicted)

    def _shaped(self, values):
        """Values without what is slower than the motion or resembles a drift, or where faster
        motion may fold."""
        lines = rfft(memory.without_drift(values))
        lines[:int(self.r.lowest * self.r.n)] = 0.0
        lines[int(BAND * self.r.n):] = 0.0
        return irfft(lines, self.r.n)

    def _candidates(self, part, target):
        """Names, numbers of coefficients and makers of predictions of one part, the simplest ones
        first."""
        return getattr(self, f"_{part}_candidates")(target)

    def _lines_candidates(self, target):
        r = self.r
        if "lines" not in self.chosen:
            rest = np.where(self.counted, target, 0.0)
            self.frequencies = unrelated.tones(rest, r.ratio, r.tones, r.period, self.counted)
        if len(self.frequencies):
            waves = Modulated(unrelated.tone_waves(self.frequencies), target, self.counted,
                              r.blocks)
            for count, orders in enumerate(unrelated.LINE_COURSES):
                if 2 * orders <= len(r.blocks):
                    size = 2 * orders * len(self.frequencies)
                    yield count, size, lambda orders=orders: waves.predict(range(orders))

    def _linear_candidates(self, target):
        r = self.r
        if not r.moves:
            return
        for place, length in enumerate(_LENGTHS):
            # a longer one is worth its time only where the one before is the best so far
            if self.enough or r.quick and place >= _QUICK_LENGTHS and "linear" not in self.chosen \
                    and self.leading != _LENGTHS[place - 1]:
                break
            if r.fits(*_span(length), self.step):
                yield length, _span(length)[0], lambda length=length: self._reference_filters(
                    length).predict(target, self.flagged)
        else:
            yield from self._with_the_output(target)
        beside = [_BESIDE, self.leading] if "linear" not in self.chosen else _LENGTHS
        for length in dict.fromkeys(beside):
            if length not in _LENGTHS or not r.fits(*_span(length), self.step):
                continue
            size = _span(length)[0] + memory.count(length[1] * self.step, r.n)
            yield (*length, "integrals"), size, lambda length=length: self._with_integrals(
                length).predict(memory.without_drift(target), self.flagged)

    def _with_the_output(self, target):
        r = self.r
        alike = np.corrcoef(self.simulated[r.used], r.x[r.used])[0, 1] \
            if np.ptp(self.simulated[r.used]) else 1.0
        length = ((-1, 2), (-4, 8))
        if abs(alike) < 0.9999 and r.fits(17, 13, self.step):
            yield "both", 17, lambda: Filters(
                [r.x, shapes.standardised(self.simulated, r.used)], length, r.blocks, r.used,
                self.step).predict(target, self.flagged)

    def _with_integrals(self, length):
        """A filter of the reference beside integrals of it with longer memories."""
        r = self.r

        def make():
            inputs = memory.integrals(r.x, length[1] * self.step)
            return Filters([shapes.standardised(memory.without_drift(r.x), r.used), *inputs],
                           [length] + [(0, 0)] * len(inputs), r.blocks, r.used, self.step)
        return r.filters(("integrals", length, self.step), make)

    def _across_candidates(self, target):
        r = self.r
        others = r.axes[1:]
        if not others:
            return
        for length in _LENGTHS[:5]:
            size, span = _span(length)
            if r.fits(size * len(others), span, self.step):
                yield length, size * len(others), lambda length=length: r.filters(
                    ("across", length, self.step), lambda: Filters(
                        others, [length] * len(others), r.blocks, r.used, self.step)).predict(
                            target, self.flagged)

    def _even_candidates(self, target):
        return self._shape_candidates("even", shapes.even, target)

    def _odd_candidates(self, target):
        return self._shape_candidates("odd", shapes.odd, target)

    def _shape_candidates(self, part, make, target):
        r = self.r
        if not r.moves:
            return
        # what follows the output with its distortion; or, where that is rough, without
        for output in self._outputs():
            inputs = make(output, r.used)
            trials = [(count, length) for length in _SHAPE_LENGTHS for count in (1, len(inputs))]
            for count, length in (*trials, _RINGING):
                size, span = _span(length)
                if r.fits(count * size, span, self.step):
                    yield (count, length), count * size, functools.partial(
                        self._filtered, inputs[:count], length, target)

    def _even_of_input_candidates(self, target):
        return self._driven_candidates(shapes.even_of_input, target)

    def _odd_of_input_candidates(self, target):
        return self._driven_candidates(shapes.odd_of_input, target)

    def _driven_candidates(self, make, target):
        """Shapes of the reference through the filter that makes the output of it."""
        r = self.r
        output = self._outputs()[0]
        if not r.moves or abs(np.corrcoef(output[r.used], r.x[r.used])[0, 1]) > _SAME:
            return
        lengths = [length for length in _LENGTHS[:_QUICK_LENGTHS]
                   if r.fits(*_span(length), self.step)]
        if not lengths:
            return
        inputs = self._reference_filters(lengths[-1]).passed(output, make(r.x, r.used))
        for length in _DRIVEN_LENGTHS:
            size, span = _span(length)
            if r.fits(len(inputs) * size, span, self.step):
                yield length, len(inputs) * size, functools.partial(
                    self._filtered, inputs, length, target)

    def _filtered(self, inputs, length, target):
        return Filters(inputs, [length] * len(inputs), self.r.blocks, self.r.used,
                       self.step).predict(target, self.flagged)

    def _outputs(self):
        """The output as the linear part has it and, in the second pass, with its distortion."""
        linear = self.simulated + self.predicted.get("linear", 0.0)
        if not np.ptp(linear):
            linear = self.r.x
        more = sum((values for piece, values in self.again.items()
                    if _PIECES[piece] in ("even", "odd")), np.zeros(self.r.n))
        return [linear, linear + more] if more.any() else [linear]

    def _time_varying_candidates(self, target):
        r = self.r
        if not r.moves:
            return
        bases = self._bases()

        def columns(start, stop):
            return np.stack([base[start:stop] for base in bases], axis=1)
        waves = Modulated(columns, target, self.counted, r.blocks)
        for count in _COURSES:
            if count * len(bases) * SAMPLES <= r.used.sum() and 2 * count <= len(r.blocks):
                yield count, count * len(bases), lambda count=count: waves.predict(
                    range(1, count + 1))

    def _bases(self):
        """What a gain, a timing and the dynamics that change are multiplied with."""
        r = self.r
        y = shapes.standardised(self._outputs()[0], r.used)
        v = shapes.standardised(np.gradient(y), r.used)
        bases = [y, v, shapes.standardised(np.gradient(v), r.used)]
        if abs(np.corrcoef(y[r.used], r.x[r.used])[0, 1]) < 0.999:
            bases.append(shapes.standardised(r.x, r.used))
        return bases

    def _level_candidates(self, target):
        """Gain that follows the motion's level, whose past counts."""
        r = self.r
        if not r.moves:
            return
        inputs = memory.levels(self._outputs()[0], r.used)
        if not inputs:
            return
        for count, length in ((len(inputs) // 2, (0, 0)), (len(inputs), (0, 0)),
                              (len(inputs), (-1, 2))):
            size, span = _span(length)
            if r.fits(count * size, span, self.step):
                yield (count, length), count * size, functools.partial(
                    self._filtered, inputs[:count], length, target)

    def _periodic_candidates(self, target):
        """Gain or timing that changes with tones which the motion does not have."""
        r = self.r
        if not r.moves:
            return
        bases = self._bases()
        if "periodic" not in self.chosen:
            self.modulation = self._modulation(target, bases[:2])
        if not len(self.modulation):
            return
        waves = unrelated.tone_waves(self.modulation)

        def columns(start, stop):
            turns = waves(start, stop)
            return np.concatenate([base[start:stop, None] * turns for base in bases], axis=1)
        size = 2 * len(self.modulation) * len(bases)
        modulated = Modulated(columns, target, self.counted, r.blocks)
        for orders in unrelated.LINE_COURSES[:2]:
            if size * orders * SAMPLES <= r.used.sum() and 2 * orders <= len(r.blocks):
                yield orders, size * orders, lambda orders=orders: modulated.predict(range(orders))

    def _modulation(self, target, bases):
        """Tones [cycles per sample] of what is left times the motion, which its square has not."""
        r = self.r
        rest = np.where(self.counted, self._shaped(np.where(self.counted, target, 0.0)), 0.0)
        ratio = unrelated.spectrum_peaks(np.where(r.used, bases[0]**2, 1.0) - 1.0)[2]
        found = []
        for base in bases:
            for tone in unrelated.tones(rest * base, ratio, r.tones, r.period, self.counted):
                if all(abs(tone - other) > 3 / r.n for other in found):
                    found.append(tone)
        return np.array(found[:_MODULATIONS])

    def _slow_candidates(self, target):
        for place, (count, values) in enumerate(unrelated.slow_candidates(
                target, self.counted, self.r.lowest, target)):
            yield place, count, lambda values=values: values

    def _distortion_candidates(self, target):
        r = self.r
        if r.period and r.n >= 2 * r.period:
            yield 0, r.period, lambda: repeats.repeating(target, self.counted, r.period)

    def _summed(self, power):
        """Shares from the held-out products of what is left and what is predicted."""
        r = self.r
        counted = self.counted
        sure = np.where(counted, self.e, 0.0)
        # bursts stand on the power that the others have there, too
        usual = np.mean(sure[counted]**2)
        burst = np.where(self.flagged, self.e**2 - usual, 0.0)
        background = np.where(counted, sure**2, 0.0)
        background[self.flagged] = usual
        names, products, reductions = ["bursts"], [burst], [burst]
        spectra = {"bursts": (np.where(self.flagged, self.e, 0.0),) * 2}
        left = sure.copy()
        pieces = list(_PIECES)
        for part in pieces:
            if part not in self.kept:
                continue
            later = sum((self.predicted[name] for name in pieces[pieces.index(part) + 1:]
                         if name in self.predicted and name != "distortion"), np.zeros(r.n))
            estimate = np.where(counted, self.kept[part], 0.0)
            # what is taken is taken from what the earlier ones left: so do the shares add up
            alone = np.where(counted, left - later, 0.0)
            target = left if self.predicted[part].any() else alone
            for name, piece in self._by_parity(part, estimate):
                reductions.append((2 * target - piece) * piece)
                names.append(name)
                products.append(reductions[-1] + self._error(alone, piece, self.sizes[part]))
                spectra[name + str(len(names))] = target, piece
            left = left - np.where(counted, self.predicted[part], 0.0)
        if self.other is not None:
            other = np.where(counted, self.other - np.mean(self.other[counted]), 0.0)
            names.append("reference")
            products.append(left * other)
            reductions.append(left * other)
            spectra["reference" + str(len(names))] = left, other
        return self._made(names, np.array(products), power, np.array(reductions),
                          burst + background, list(spectra.values()))

    def _error(self, target, predicted, size):
        """Power of a fit's own error, by which held-out data lose less than it explains.

        Per sample. It is what the prediction has more than it shares with the target, but no more
        than a few times what as many coefficients fit to noise.
        """
        counted = self.counted
        error = np.sum((predicted - target) * predicted)
        left = np.sum((target - predicted)[counted]**2)
        most = _COLOURED * min(size / counted.sum(), 1.0) * left
        return counted * (np.clip(error, 0.0, most) / counted.sum())

    def _by_parity(self, part, estimate):
        """Distortion on even and odd lines, where these can be told apart."""
        if part == "distortion":
            parted = repeats.by_parity(estimate, self.r.x, self.r.period)
            if parted is not None:
                return list(zip(("even", "odd"), parted))
        return [(_PIECES[part], estimate)]

    def _made(self, names, products, power, reductions=None, weights=None, spectra=()):
        r = self.r
        output = float(np.std(self.measured[r.used]))
        edges = np.r_[0.0, r.rate / 2 * 2.0**np.arange(-_OCTAVES, 1)]
        stretches = np.linspace(0, r.n, _STRETCHES + 1).astype(int)
        parts, in_bands, along = [], {}, {}
        if len(names):
            whole = weights.sum()
            raw = products.sum(axis=1) / whole
            merged = {name: [i for i, other in enumerate(names) if other == name]
                      for name in dict.fromkeys(names)}
            raw = np.array([raw[rows].sum() for rows in merged.values()])
            blocks = r.blocks.sums(np.array([reductions[rows].sum(axis=0)
                                             for rows in merged.values()]))
            # a prediction that makes things worse takes nothing, and is not made up for by noise
            takes = raw > 0
            raw, blocks = raw * takes, blocks * takes[:, None]
            # last of all what none takes
            raw = np.r_[raw, 1 - raw.sum()]
            sums = r.blocks.sums(weights)
            blocks = np.r_[blocks, [sums - blocks.sum(axis=0)]]
            bounds = intervals(blocks, raw, sums)
            shares = np.clip(raw, 0.0, None)
            shares /= max(shares.sum(), 1e-300)
            bounds[:, 0] = np.minimum(bounds[:, 0], shares)
            bounds[:, 1] = np.maximum(bounds[:, 1], shares)
            left = self.r.blocks.sums(weights).sum()
            judged = np.where(self.inside, self.e, 0.0)
            band_rest = _band_power(judged, judged, edges, r.rate) / left
            time_rest = np.add.reduceat(weights, stretches[:-1]) / left
            for name, rows in merged.items():
                in_bands[name] = sum(_band_power(*spectra[i], edges, r.rate) for i in rows) / left
                along[name] = np.add.reduceat(products[rows].sum(axis=0), stretches[:-1]) / left
                band_rest, time_rest = band_rest - in_bands[name], time_rest - along[name]
            in_bands["noise"], along["noise"] = band_rest, time_rest
            rms = np.sqrt(power)
            order = [*merged, "noise"]
            for name in PARTS:
                if name in order:
                    i = order.index(name)
                    parts.append({
                        "part": name, "share": float(shares[i]), "ci95": bounds[i].tolist(),
                        "of_output": float(rms * np.sqrt(shares[i]) / max(output, 1e-300))})
        return Budget(parts, float(np.sqrt(power)), output, edges, in_bands, stretches / r.rate,
                      along)


def _span(length):
    """Coefficients of a filter, and the samples that it spans."""
    return (length[1] - length[0] + 1,) * 2


def _band_power(one, other, edges, rate):
    """Sum of the product of two signals, by bands."""
    shared = np.real(np.conj(rfft(one)) * rfft(other)) / len(one)
    shared[1:] *= 2
    if len(one) % 2 == 0:
        shared[-1] /= 2
    place = np.searchsorted(edges, np.arange(len(shared)) * rate / len(one), "right") - 1
    return np.bincount(np.minimum(place, len(edges) - 2), shared, len(edges) - 1)
