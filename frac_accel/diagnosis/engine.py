"""Diagnosis of one axis: from a record and a model to named causes."""

import dataclasses
import functools

import numpy as np
from scipy.fft import dct, next_fast_len
from scipy.ndimage import uniform_filter1d

from ..budget import Division, established_noise
from ..errors import FracAccelError
from ..identification.fit.uncertainty import by_blocks, sandwich
from ..identification.response.excitation import (
    STRETCHES,
    alternating_stretches,
    held_out_of,
    is_new,
)
from ..model import is_link
from ..model.effects import effect_of
from .gain import gain
from .leftover import SCATTER, leftover, rounding_errors
from .names import on_bound, special_case
from .noise_colour import lead, noise_peak
from .other_axes import UNLIKE, shows_turn
from .problem import Problem, acts_on_spring
from .search import SAME, Search, acts_as_filter, mixes_otherwise
from .seen import added, grows_with_motion
from .stages import COMPARED
from .stretches import Stretches, stretches_of
from .words import is_accounted

# Improvement, in variances of one sample's noise and for each parameter, that chance does not give.
_CHANCE = 30.0
# A cause must explain this many times the RMS of what is left that is no noise: tenfold in power.
WEIGHS = 3.0
# Causes that compete for the place of each one found.
_RIVALS = 4
# Records of more samples are searched in part first.
LONG = 40_000
# Samples that an error budget parts at most.
_PARTED = 40_000
# Parts of the record in which a cause's strength is compared.
_PARTS = 5
# Causes that the whole of a long record may add to those of its part.
_SLOW = 2
# Variances of the noise within which two sets that say nearly the same count as equal, and beyond
# which they are not compared more closely.
_CLOSE, _FAR = 30.0, 1000.0
# And by which another set must be ahead in noise that has a colour, or another cause to say more
# than a parameter of the model in use.
_AHEAD = 10.0
# Largest density of noise, over its mean, from which on it has a colour.
_COLOURED = 3.0
# Standard uncertainties, and share of its size, by which a parameter may differ between halves.
_AGREE = 5.0
_ALIKE = 0.1
# Standard uncertainties within which a parameter is where the model in use has it.
_UNMOVED = 3.0
# Share of what is left that a part of the error budget must have, and at least may have, to be no
# noise.
_PART = 0.1
_PART_AT_LEAST = 0.03
# Shares that noise has, too: of bursts by heavy tails (0.13 of Student's t with three degrees of
# freedom), and of slow ones where its density grows with one over the frequency (0.11 to 0.49).
_HEAVY_TAILS, _LONG_MEMORY = 0.3, 0.5
_OF_NOISE = {"bursts": _HEAVY_TAILS, "slow": _LONG_MEMORY}
# Parts that follow the motion.
OF_MOTION = ("linear", "across", "even", "odd", "time_varying")
# Share of what is left (power) within which a common cause says the same as a filter.
_PLAINLY = 0.02
# Share of what a set explains (power) that its core may leave to the others.
_CORE = 0.005
_NOT_MET = "not every cause met its rivals"
# Times what is left where it acts that a cause must take (RMS) to stand alone there.
_ALONE = 10.0
# Share of the power that a slow zero adds by whose frequencies it counts, and their share of all.
_NEARLY_ALL, _FEW_LINES = 0.99, 0.02
# Share of what is left that may be of a cause's own kind, where the error budget finds less.
_OF_ITS_KIND = 0.01
# Share of the residual's power for which a coarse lattice must account.
_COARSE = 0.2
# RMS of the error of the model in use where it is judged, over that before, below which it errs
# before.
_ERRS_THERE = 0.5
# The same of the error before, over that where it is judged, below which nothing is learnt before.
_ERRS_BEFORE = 0.25
# Parts of a record by whose means an error is slow, and the share of it (RMS) that counts.
_SLOW_PARTS, _ERRS_SLOWLY = 100, 0.2
# Error of a simulation, and of values put on other instants, over the output's spread.
_SIMULATED, _RESAMPLED = 3e-5, 1e-4


class Engine:
    """Search, competition and judgement for one record.

    The measured values may have a lattice with a known `step`.
    """

    def __init__(self, record, axis, baseline, used, base=None, candidates=(), stages=None,
                 step=None, limit=None, passed_on=None, loose=None, others=UNLIKE):
        slices, given = stretches_of(record, axis), (record, axis, baseline, used, limit)
        self.problem = Stretches(*given, slices, others) if slices[1:] else \
            Problem(*given, others)
        self.problem.passed_on = passed_on
        self.part = None
        # `Integrity` of the record, where what it shows by itself is looked for
        self.found = None
        self.uncontested, self.best = set(), None
        self._step = step
        # the record, and its samples that may count: of a very long one, more than are fitted
        self.record, self.wanted = record, used
        # common causes by name that were identified with the model in use
        self.identified = {}
        # why causes have no name that the sensor itself may be, in words by cause
        self.as_the_sensor = {}
        self.search = Search(self.problem, base, candidates, stages)
        # `Open` by cause: what is known of the parameters that are free in every fit
        self.loose = loose or {}
        # what counts in no fit, since a signal was at fault there
        self.aside = self.spikes = np.zeros(len(record), bool)
        # samples that say nothing of other causes, by what the record shows by itself: those at a
        # limit, and those in which it drowns all else
        self.at_limit = self.drowned = np.zeros(len(record), bool)
        self._learnt, self._budgets, self._structures, self._left = {}, {}, {}, {}
        self._audible, self._peaks, self._in_all = {}, {}, {}
        # what the numerics may still be wrong by: of the simulation, and of other instants
        self.floor = (_RESAMPLED if record.resampled else _SIMULATED) \
            * float(np.std(record.sensor[used, axis]))

    @property
    def silent(self):
        """Samples of the record that say nothing of other causes."""
        return self.at_limit | self.drowned

    @functools.cached_property
    def held_out_rows(self):
        """Samples that count and are not learnt from, but judged on, as a mask.

        Where the model in use, by itself or with what is common, errs before them, as beside a zero
        that has settled, every other stretch: nothing could be judged by them. The same where it
        errs in them only, as behind a step: nothing could be learnt before.
        """
        p = self.problem
        reference = p.record.reference[:, p.axis]
        last = held_out_of(reference, p.used)
        if all(self._errs_in_both(fit.residual, last)
               for fit in (self.search.baseline, self.everyday())):
            return p.used & last
        return p.used & alternating_stretches(reference, STRETCHES, p.used)

    def _errs_in_both(self, error, last):
        """Whether an error is about as large where a mask is set and where it is not."""
        used = self.problem.used
        slow = uniform_filter1d(error, max(len(error) // _SLOW_PARTS, 1))
        before, there = ([float(np.std(values[used & rows])) for values in (error, slow)]
                         for rows in (~last, last))

        def errs(most, least, share):
            slowly = most[1] > _ERRS_SLOWLY * most[0]
            return least[0] > share * most[0] and (not slowly or least[1] > share * most[1])
        return errs(before, there, _ERRS_THERE) and errs(there, before, _ERRS_BEFORE)

    def threshold(self, fitted):
        """Cost by which a further parameter must improve on a fit."""
        left = self.problem.count
        variance = fitted.cost / left
        return max(_CHANCE * variance * self._peak(fitted), self.floor**2 * left)

    def promises(self, fitted, cost):
        """Whether a cost that a screening expects is worth a fit."""
        return fitted.cost - cost > max(_CHANCE * cost / self.problem.count,
                                        self.floor**2 * self.problem.count)

    def run(self, seed=None):
        """The smallest set of causes that describes the record; of a long one, its `part`.

        Parameters
        ----------
        seed : dict of str to Effect, optional
            Causes to begin with.

        Returns
        -------
        Fitted
        """
        p = self.problem
        if len(p.record) > LONG:
            # where the motion is strongest is enough to find most causes, and to judge them
            rows = p.strongest(LONG // 2)
            self.part = Engine(p.part(rows), p.axis, p.baseline, p.taken(self.wanted)[rows],
                               self.search.base, self.search.candidates, self.search.stages,
                               self._step, p.limit.of_part(), p.passed_on, self.loose,
                               p.others)
            self.part.identified, self.part.found = self.identified, self.found
            self.part.search.courses = self.search.courses
            return self.part.run(seed)
        self.best = self.compete(self.search.run(
            self.threshold, self.promises, self.noise_only, seed,
            self._known() - set(self._unmoved(self.search.baseline))))
        return self.best

    def whole(self, effects):
        """The set that a part of a long record has shown, fitted to the whole.

        Only what takes time to show is added, and in a sweep what acts on slow motion.
        """
        p, known = self.problem, self._beside_base(effects)
        self.part.problem.let_go()
        reference, rows = p.record.reference[:, p.axis], p.strongest(LONG // 2)
        sweeps = is_new(reference[rows], np.delete(reference, rows))
        self.search.candidates = [cause for cause in self.search.candidates
                                  if effect_of(cause).shows_with_time
                                  or (sweeps and effect_of(cause).acts_on_slow_motion)]
        self.uncontested = self.part.uncontested
        best = self.search.grow([known], self.threshold, self.promises, self.noise_only, _SLOW)
        if best.causes > known.keys() | self.search.base.keys():
            # what the part has shown may have stood for what only the whole shows
            best = self.search.prune(best, self.threshold)
        dated = self.problem.dated(best)
        return best if dated == best.effects else self.search.again(dated)

    def on_whole(self, fitted):
        """A set as a part of a long record has shown it, fitted to the whole; else as it is."""
        return fitted if self.part is None else self.search.fit(self._beside_base(fitted.effects))

    def score(self, fitted, variance):
        """Cost with a penalty for each parameter, in units of the noise's variance."""
        return fitted.cost / variance + _CHANCE * fitted.size

    def compete(self, best, unwanted=frozenset()):
        """Let every cause's nearest rivals take its place; the winner of all without some."""
        for _ in range(4):
            with self.problem.limit.for_rivals():
                self._meet_rivals(best)
            variance = self._variance(best)
            for rival in [fit for fit in self.search.fits.values()
                          if mixes_otherwise(fit, best) and abs(
                              self.score(fit, variance) - self.score(best, variance)) < SAME]:
                # what says the same may do so with less beside it: a turn takes from the gain
                self.search.prune(rival, self.threshold)
            near = sorted((fit for fit in self.search.fits.values()
                           if len(fit.effects) <= len(best.effects)
                           and not fit.causes & unwanted),
                          key=lambda fit: self.score(fit, variance))
            winner = self._ahead_in_colour(near, self._general(near, variance), variance)
            winner = next((fit for fit in near if self._is_plainer(fit, winner) and self.score(
                fit, variance) < self.score(winner, variance) + _CLOSE), winner)
            if winner is best:
                return best
            best = winner
        return best

    def _meet_rivals(self, best):
        """Fit the nearest rivals of every cause of a set in its place, those of the strongest cause
        first: time may end. A constant gain or offset is last, and needs none to have a name."""
        unexplained, limit = self.unexplained(best), self.problem.limit
        strength = {cause: self.rms(self.added(best, cause)) for cause in best.effects}
        plain = {cause for cause, effect in best.effects.items()
                 if effect.everyday and not acts_as_filter(effect)}
        for cause in sorted(strength, key=lambda cause: (cause in plain, -strength[cause])):
            self.search.stages.enter_round(f"comparing {cause} with its rivals", COMPARED)
            # nothing takes the place of one that is too weak to be named
            if cause in self.search.base or strength[cause] < WEIGHS * unexplained:
                continue
            if not limit.ends_search(_NOT_MET):
                less = self.search.without(best, cause, best.cost + self.threshold(best))
                self.search.fit_all([self.search.begun(less, rival, begin) for _, rival, begin in
                                     self.search.screen(less)[:_RIVALS] if rival != cause]
                                    + [best.effects])
            if cause not in plain and limit.ends_search(_NOT_MET):
                self.uncontested.add(cause)

    def _general(self, near, variance):
        """The first of some fits by score; where it is a special case of one close behind, that."""
        first = near[0]
        if not self.hollow(first):
            return first
        limit = self.score(first, variance) + _CLOSE
        return next((fit for fit in near[1:] if self.score(fit, variance) < limit
                     and not self.hollow(fit)), first)

    def _ahead_in_colour(self, near, winner, variance):
        """Of the sets that are as near as a winner in white noise, the one that is ahead in noise
        of the colour that there is: what is quiet beside loud noise hardly shows in a score."""
        close = sorted((fit for fit in near if fit is not winner and not fit.rough
                        and fit.cost < winner.cost + _CLOSE * variance),
                       key=lambda fit: self.score(fit, winner.cost / self.problem.count))
        close = [(self._margin(fit, winner, variance), fit) for fit in close[:2 * _RIVALS]
                 if not self.hollow(fit) and self._leave_coloured_noise(winner, fit)]
        margin, ahead = min(close, key=lambda entry: entry[0], default=(0.0, winner))
        return ahead if margin < -_AHEAD else winner

    def _leave_coloured_noise(self, best, rival):
        """Whether two fits leave what has a colour, and the best nothing that follows the motion:
        what wanders, tones and bursts are no more than loud where they are."""
        return all(self._peak(fit) > _COLOURED for fit in (best, rival)) \
            and not any(part in OF_MOTION for _, part in self.structure(best))

    def hollow(self, fitted):
        """Whether a cause of a fit lies at the end of what was searched, or is, within its
        uncertainty, a simpler one's special case."""
        if any(on_bound(unknown, place) for unknown, place in zip(fitted.unknowns, fitted.theta)
               if unknown.cause not in self.search.base):
            return True
        if not any(effect.nested for effect in fitted.effects.values()):
            return False
        stds, core = self.uncertainties(fitted), self.problem.baseline.axis(self.problem.axis).core
        return any(special_case(effect, stds.get(cause, {}), core)
                   for cause, effect in fitted.effects.items())

    def instead(self, best, unwanted, before=frozenset()):
        """A set that another cause describes better where some are not wanted; or the rest.

        Parameters
        ----------
        best : Fitted
        unwanted : set of str
        before : set of str
            Those that were not wanted in the sets before it.
        """
        rest = self.search.fit({cause: effect for cause, effect in best.effects.items()
                                if cause not in unwanted})
        self.search.candidates = [c for c in self.search.candidates if c not in unwanted]
        if self.problem.limit.ends_search("causes in the place of doubtful ones were not tried"):
            return rest
        begun = [self.search.begun(rest, cause, begin) for cost, cause, begin in
                 self.search.screen(rest)[:_RIVALS]
                 if cause not in unwanted and self.promises(rest, cost)]
        found = self.search.varied(next(iter(self.search.fit_all(begun)), rest))
        if rest.cost - found.cost <= self.threshold(found):
            found = rest
        elif not any(map(acts_on_spring, found.effects.values())):
            # several linear ones may stand for several, or two common ones for one that is odd;
            # with forces that takes minutes
            worse = found.cost - best.cost > self.threshold(best)
            found = self.search.grow([self._beside_base(found.effects)], self.threshold,
                                     self.promises, self.noise_only, len(unwanted) - 1 + worse)
        # two causes may say only together what each of them hardly does
        known = min((fit for fit in self.search.fits.values()
                     if not fit.rough and self._beside_base(fit.effects).keys()
                     <= set(self.search.candidates)),
                    key=lambda fit: fit.cost, default=found)
        if found.cost - known.cost > self.threshold(known):
            found = self.search.prune(known, self.threshold)
        # what was found beside the unwanted has met its rivals beside them only
        return self.compete(found, unwanted | before)

    def everyday(self):
        """The smallest set of everyday causes."""
        search = self.search
        begin = {**search.everyday(search.baseline), **self.identified}
        return search.prune(search.fit({**search.base, **begin}), self.threshold)

    def _beside_base(self, effects):
        """Those of some effects that are not in every fit."""
        return {cause: effect for cause, effect in effects.items()
                if cause not in self.search.base}

    def _is_plainer(self, fit, other):
        """Whether a set says by shares of the other axes alone what another one says by a turn that
        these do not show."""
        return mixes_otherwise(fit, other) and any(
            fit.effects[cause].describes == "across" for cause in fit.causes - other.causes) \
            and not shows_turn(self.problem, other.effects)

    def rivals(self, best, cause, may_be_more=False, close=_CLOSE):
        """Sets without a cause, no larger than the best, by score; (margin, causes).

        Where what is left `may_be_more` than noise, of a lead that only shows where little is left
        no more counts than the loudest noise would let show: it may favour either. A margin up to
        which two say the same is `close`.
        """
        if self.comparing(cause) is not self:
            return self.part.rivals(self.part.best, cause, may_be_more, close)
        variance = self._variance(best)
        found = [(self._margin(fit, best, variance, may_be_more), fit.causes) for fit in
                 self.search.fits.values()
                 if cause not in fit.causes and len(fit.causes) <= len(best.causes)]
        # a hollow one that is close says the same in other words
        return [(margin, causes) for margin, causes in sorted(found, key=lambda entry: entry[0])
                if margin > close or not (self.hollow(self.search.fits[causes])
                                          or self._is_plainer(best, self.search.fits[causes]))]

    def margin_of_all(self, best, cause):
        """Margin by which a set is ahead of one that leaves twice the power; what is left and is no
        noise counts as if it were white: it may be any."""
        engine = self.comparing(cause)
        fitted = best if engine is self else engine.best
        peak = 1.0 if engine.structure(fitted) else engine._peak(fitted)
        return engine.problem.count / peak

    def margin(self, rival, best):
        """Variances of the noise by which a set is ahead of its rival."""
        return self._margin(rival, best, self._variance(best))

    def _peak(self, fitted):
        return _once(self._peaks, fitted, lambda fit: noise_peak(fit.residual))

    def _variance(self, best):
        """Variance of white noise as loud as the loudest that a set leaves."""
        return best.cost / self.problem.count * self._peak(best)

    def _margin(self, rival, best, variance, may_be_more=False):
        """Variances of the noise by which a set is ahead of its rival; no lead of a rival that has
        only come from a choice among more kinds of a cause."""
        ahead = (rival.cost - best.cost) / variance
        if ahead < _FAR and not rival.rough and self._leave_coloured_noise(best, rival):
            in_colour = lead(best, rival, self.problem.used)
            if in_colour is not None:
                peak = variance * self.problem.count / best.cost
                ahead = min(in_colour, max(ahead, in_colour / peak)) if may_be_more else in_colour
        margin = ahead + _CHANCE * (rival.varied - best.varied)
        return margin if margin >= 0 else min(ahead + _CHANCE * (rival.size - best.size), 0.0)

    def comparing(self, cause):
        """The engine in which a cause has met its rivals: that of a long record's part, or this."""
        return self.part if self.part and cause in self.part.best.effects else self

    def instead_of_moved(self, fitted, own):
        """A cause that says more than what the model in use leaves open does by moving, or None.

        Parameters
        ----------
        fitted : Fitted
        own : Effect
            What the model in use says.
        """
        try:
            trials = self.search.beside_held({**fitted.effects, own.cause: own}, (own.cause,),
                                             _RIVALS)
        except FracAccelError:
            return None
        limit = fitted.cost * (1 - _AHEAD / self.problem.count)
        for _, cause, effects in trials:
            try:
                if self.problem.fit(effects, held=(own.cause,)).cost < limit:
                    return cause
            except FracAccelError:
                continue
        return None

    def uncertainties(self, fitted):
        """Standard uncertainties by cause and parameter, for any spectrum of the residual, and
        however it goes with the motion."""
        if not fitted.unknowns:
            return {}
        jacobian = dataclasses.replace(fitted, exact=True).jacobian
        used = fitted.problem.used
        for i, unknown in enumerate(fitted.unknowns):
            value = getattr(fitted.effects[unknown.cause], unknown.name)
            jacobian[:, i] /= value if unknown.logarithmic else unknown.scale
        stds = np.full(len(fitted.unknowns), np.inf)
        # what does not change the output at all, the record leaves open
        felt = np.linalg.norm(jacobian, axis=0) > 0
        if felt.any():
            slopes, residual = jacobian[np.ix_(used, felt)], fitted.residual[used]
            stds[felt] = np.sqrt(np.max([np.diag(sandwich(slopes, residual, used)),
                                         np.diag(by_blocks(slopes, residual)),
                                         np.zeros(slopes.shape[1])], axis=0))
        result = {}
        peak = self._peak(fitted)
        for unknown, std in zip(fitted.unknowns, stds):
            if unknown.jumps:
                std = self.problem.jump_std(fitted, unknown, peak)
            by_stamps = fitted.effects[unknown.cause].std_by_stamps(self.record)
            result.setdefault(unknown.cause, {})[unknown.name] = float(
                np.hypot(std, by_stamps.get(unknown.name, 0.0)))
        return result

    @functools.cached_property
    def _division(self):
        """Of the record, or where it is very long of the part with the strongest motion; of a few
        samples less where transforms of so many are slow."""
        p = self.problem
        most = min(_PARTED, len(p.record))
        self._parted = p.strongest(
            next(count for count in range(most, 0, -1) if next_fast_len(count) == count))
        return Division(p.record.reference[self._parted], p.record.valid[self._parted], p.rate,
                        p.axis, quick=True)

    @property
    def words_of_budget(self):
        """What the budget cannot tell of this record, in words."""
        return self._division.words

    def established_noise(self, fitted, stated_std=None):
        """`EstablishedNoise` of the record, beside a fit."""
        p = self.problem
        period = self._division.period
        # what repeats does so without gaps only
        rows = p.coherent if period else slice(None)
        return established_noise(fitted.residual[rows], p.measured[rows], p.record.reference[rows],
                                 p.used[rows], p.rate, p.record.sensor_std, stated_std, None,
                                 period)

    def by_reference(self, fitted):
        """RMS [output units] of what a fit leaves because the reference does not show it."""
        return float(np.sqrt(self.problem.by_reference(fitted.effects)))

    def _no_fault(self, fitted):
        """Share of a residual's power that follows the motion and is no fault of the model:
        numerics, and noise of the reference that the model passes on; none of the latter where the
        reference counts behind a filter of that noise."""
        own = self.by_reference(fitted) if self.problem.passed_on else 0.0
        return (own**2 + self.floor**2) / max(self.rms(fitted.residual), 1e-300)**2

    def budget(self, fitted, hidden=None):
        """`Budget` of what a fit leaves, of all samples that are there but those of a mask."""
        p, valid = self.problem, self.problem.record.valid
        if hidden is None or not hidden.any():
            return _once(self._budgets, fitted,
                         lambda fitted: self.budget_between(p.measured, fitted.output, valid))
        return self.budget_between(p.measured, fitted.output, valid & ~p.taken(hidden))

    def budget_shown(self, fitted, hidden=None):
        """The same of the record as it is, with what was taken off it."""
        p = self.problem
        if p.record.taken_off is None:
            return self.budget(fitted, hidden)
        left_out = np.zeros(len(self.record), bool) if hidden is None else hidden
        return self.budget_between(p.recorded, fitted.output, p.record.valid & ~p.taken(left_out))

    def budget_between(self, measured, simulated, rows):
        """`Budget` of what differs between two signals in some rows."""
        edge = self.problem.edge
        residual = np.where(rows, measured - simulated, 0.0)
        residual[:edge] = residual[len(residual) - edge:] = 0.0
        division = self._division
        return division.of(*(values[self._parted] for values in (residual, measured, simulated)))

    def structure(self, fitted):
        """Parts of what a fit leaves that are no noise: (share, part), the largest first.

        What rounding to a coarse lattice makes of the simulated values is taken off: it follows the
        motion. Samples that say nothing of other causes do not count.
        """
        return _once(self._structures, fitted, self._structure_of)

    def _structure_of(self, fitted):
        parts, step = self._audible_parts(fitted), self.coarse_step(fitted)
        rounded = {}
        if step:
            p = self.problem
            error = next(rounding_errors(fitted.residual, fitted.output, p.used, step))
            rounded = {entry["part"]: SCATTER * entry["share"] for entry in self._division.of(
                *(values[self._parted] for values in
                  (error, fitted.output + error, fitted.output))).parts}
        own = self._no_fault(fitted)
        return self.standing_out(parts, {entry["part"]: rounded.get(entry["part"], 0.0) + own
                                         for entry in parts})

    def _audible_parts(self, fitted):
        """Parts of the budget of a fit without the samples that say nothing of other causes."""
        return _once(self._audible, fitted,
                     lambda fitted: self.budget(fitted, self.silent).parts)

    @staticmethod
    def standing_out(parts, less):
        """As `structure`, of a budget's parts, where some share of each is accounted for."""
        shares = [(entry["share"] - less.get(entry["part"], 0.0),
                   entry["ci95"][0] - less.get(entry["part"], 0.0), entry["part"])
                  for entry in parts if entry["part"] != "noise"]
        return sorted(
            ((share, part) for share, low, part in shares
             if share > _OF_NOISE.get(part, _PART) and low > _PART_AT_LEAST),
            reverse=True)

    def unexplained(self, fitted):
        """RMS of what a fit leaves that is no noise, as far as it shows [output units]."""
        left = self.left(fitted)
        shares = [left.share, *(share for share, _ in self.structure(fitted))]
        return float(np.sqrt(max(shares))) * left.rms

    def plainer(self, best, is_noise):
        """A set in which what is common does the same as a cause that is odd; or, where what is
        left is no noise and may favour either, nearly the same as a filter."""
        for cause, effect in best.effects.items():
            if effect.everyday or cause in self.search.base:
                continue
            plain = self.as_plain(best, cause)
            nearly = SAME / self.problem.count if is_noise or not is_link(effect) else _PLAINLY
            if plain and plain.cost < (1 + nearly) * best.cost:
                return plain
        return best

    def core(self, best):
        """The smallest set that explains nearly all that another one does, or None: what that has
        more may only make up for what neither says."""
        most = best.cost + _CORE * max(self.search.baseline.cost - best.cost, 0.0)
        return min((fit for fit in self.search.fits.values()
                    if fit.size < best.size and fit.causes - self.search.base.keys()
                    and fit.cost < most), key=lambda fit: (fit.size, fit.cost), default=None)

    def as_plain(self, best, cause):
        """The best fit, no larger, with what is common in the place of a cause; or None."""
        return min((fit for fit in self.search.fits.values()
                    if fit.size <= best.size and best.causes - fit.causes == {cause}
                    and all(fit.effects[name].everyday for name in fit.causes - best.causes)),
                   key=lambda fit: fit.cost, default=None)

    def stands_alone(self, fitted, cause, taken):
        """Whether what a cause takes (RMS) stands far out of what is left where it acts, whatever
        is left elsewhere."""
        beside = fitted.effects[cause].beside(fitted.residual, self.problem.time)
        return beside is not None and taken > _ALONE * beside

    def stands_among_slow(self, fitted, cause, taken):
        """The same, or whether what a cause takes of a slow zero stands far out of what is left
        that is as slow; another law of the zero may do the same."""
        if self.stands_alone(fitted, cause, taken):
            return True
        if not fitted.effects[cause].adds:
            return False
        lines = dct(self.added(fitted, cause), norm="ortho")[1:]**2
        count = 1 + int(np.searchsorted(np.cumsum(lines), _NEARLY_ALL * lines.sum()))
        if not lines.any() or count > _FEW_LINES * len(lines):
            return False
        slow = dct(fitted.residual, norm="ortho")[1:1 + count]
        return taken > _ALONE * np.linalg.norm(slow) / np.sqrt(self.problem.count)

    def stands_in_its_kind(self, fitted, cause, taken):
        """Whether what a cause takes (RMS) stands far out of all that may be left of its kind, of
        what comes across from other axes or changes with time: nothing of another kind does that.
        """
        effect = fitted.effects[cause]
        if effect.mixes_axes:
            kind = "across"
        elif effect.shows_with_time and not effect.adds:
            kind = "time_varying"
        else:
            return False
        most = max([_OF_ITS_KIND, *(entry["ci95"][1] for entry in self._audible_parts(fitted)
                                    if entry["part"] == kind)])
        return taken > _ALONE * np.sqrt(most) * self.rms(fitted.residual)

    def rms(self, values):
        """RMS of values where samples count."""
        return float(np.sqrt(np.mean(values[self.problem.used]**2)))

    def is_accounted(self, fitted, noise):
        """Whether what a fit leaves beside coarse rounding is little, or no more than
        `EstablishedNoise`."""
        p = self.problem
        return is_accounted(self.rms_beside_rounding(fitted), float(np.std(p.measured[p.used])),
                            noise)

    def rms_beside_rounding(self, fitted):
        """RMS [output units] of what a fit leaves beside coarse rounding."""
        rounding = (self.coarse_step(fitted) or 0.0)**2 / 12
        return float(np.sqrt(max(fitted.cost / self.problem.count - rounding, 0.0)))

    def learnt(self, fitted):
        """The same causes, fitted to the learning part of the record only, beside all that the
        model in use leaves open as the whole record has it; with all parameters held, as it is."""
        if not fitted.unknowns:
            return fitted
        return _once(self._learnt, fitted, self._learnt_of)

    def _learnt_of(self, fitted):
        part = self.problem.restricted(self.problem.used & ~self.held_out_rows)
        try:
            return part.fit(fitted.effects, iterations=6, held=self.search.base)
        except FracAccelError:
            return fitted  # the part's own motion has no bound: that of the whole record

    def predicts_better(self, fitted):
        """Whether a fit predicts the held-out part better than the model in use describes it."""
        bare = self.search.baseline
        return gain(*((self.problem.measured - fit.output)[self.held_out_rows]
                      for fit in (bare, self.learnt(fitted)))).is_relevant

    def coarse_step(self, fitted):
        """Step of the values' lattice where that accounts for much of a residual, or None."""
        much = self._step and self._step**2 / 12 > _COARSE * fitted.cost / self.problem.count
        return self._step if much else None

    def held_out(self, best, cause):
        """Gain of a fitted cause on the part of the record that its fit has not seen.

        On a coarse lattice the simulated values are put on it too: what rounding does to small
        signals is no other cause's merit.
        """
        errors, step, less = [], self.coarse_step(best), self.best_without(best, cause)
        known = self._unmoved(best)
        if known:
            less = self.problem.fit({**less.effects, **{name: best.effects[name]
                                                        for name in known}}, held=known)
        for fit in (less, best):
            output = self._learnt_of(fit).output if fit is less and known \
                else self.learnt(fit).output
            if step:
                output = step * np.round(output / step)
            errors.append((self.problem.measured - output)[self.held_out_rows])
        return gain(*errors)

    def _unmoved(self, best):
        """Causes of the model in use that are free, but known, and where they are known to be: what
        another cause says must not be put on them."""
        known = self._known()
        stds = self.uncertainties(best) if known else {}  # none of what a fit has held
        return [cause for cause in known if all(
            abs(getattr(best.effects[cause], name) - getattr(self.loose[cause].effect, name))
            < _UNMOVED * np.hypot(std, stds.get(cause, {}).get(name, 0.0))
            for name, std in self.loose[cause].std.items())]

    def _known(self):
        """Causes that are free in every fit, of which the model in use or the stamps state how far
        they may be off."""
        return {cause for cause, entry in self.loose.items() if entry.is_known}

    def unsteadiness(self, best, cause):
        """Largest deviation from 1 of a cause's strength in parts of the record.

        What a cause adds is scaled to the measured output in stretches of time and in classes of
        the output's size, all with an equal share of it. A cause that only resembles the true one
        is too strong in some and too weak in others.
        """
        added = self.added(best, cause)
        energy, shared = added**2, added * (best.residual + added)
        worst = 0.0
        for order in (np.arange(len(added)), np.argsort(np.abs(best.simulated))):
            total = np.cumsum(energy[order])
            part = np.minimum((total / total[-1] * _PARTS).astype(int), _PARTS - 1)
            held = np.bincount(part, energy[order], _PARTS)
            # one strong sample may hold more than a part's share: then a part has none
            strengths = np.bincount(part, shared[order], _PARTS)[held > 0] / held[held > 0]
            worst = max(worst, float(np.max(np.abs(strengths - 1))))
        return worst

    def added(self, best, cause):
        """What a cause adds to the output of a fit, all else as it is, where samples count.

        Without it the motion may have no bound: then all of the output.
        """
        p = self.problem
        less = {name: effect for name, effect in best.effects.items() if name != cause}
        try:
            return p.clear(best.simulated - p.simulate(less), best.free)
        except FracAccelError:
            return p.clear(best.simulated, best.free)

    def takes(self, best, cause, beside_a_constant=False):
        """RMS that a fit of all samples leaves less with a cause than without it, or than without
        it and a constant."""
        less, p = self.best_without(best, cause), self.problem
        constant = less.residual[p.used].mean() if beside_a_constant else 0.0
        return float(np.sqrt(max((less.cost - best.cost) / p.count - constant**2, 0.0)))

    def best_without(self, best, cause):
        """The best that is known of a set without a cause: a trial that was left, since it could
        not win, may lie above what fewer causes do."""
        less = self.search.without(best, cause)
        return min([less, *(fit for fit in self.search.fits.values()
                            if fit.causes < less.causes and not fit.rough)],
                   key=lambda fit: fit.cost)

    def odd_share(self, best, cause):
        """Share of the power that a cause adds which turns its sign with the motion."""
        p = self.problem
        back = p.mirrored()
        less = {name: effect for name, effect in best.effects.items() if name != cause}
        try:
            here, there = (q.clear(q.simulate(best.effects) - q.simulate(less), best.free)
                           for q in (p, back))
        except FracAccelError:
            return 1.0
        return float(np.sum((here - there)**2) / max(2 * np.sum(here**2 + there**2), 1e-300))

    def unstable(self, best):
        """Causes whose parameters differ between two halves of the record, with words.

        Those that take the whole record to show are left out.
        """
        p, halves = self.problem, []
        # as much of the motion in either
        energy = np.cumsum(np.where(p.used, best.simulated**2, 0.0))
        first = energy < energy[-1] / 2
        for rows in (first, ~first):
            part = p.restricted(p.used & rows)
            if part.count < 10 * max(len(best.unknowns), 1):
                return {}
            try:
                fit = part.fit(best.effects, iterations=4)
            except FracAccelError:
                return {}
            halves.append((fit.effects, self.uncertainties(fit)))
        found = {}
        for unknown in best.unknowns:
            if type(best.effects[unknown.cause]).shows_with_time:
                continue
            one, other = (getattr(effects[unknown.cause], unknown.name) for effects, _ in halves)
            spread = np.hypot(*(stds[unknown.cause][unknown.name] for _, stds in halves))
            size = abs(getattr(best.effects[unknown.cause], unknown.name))
            if abs(one - other) > max(_AGREE * spread, _ALIKE * size):
                found[unknown.cause] = (f"{unknown.name} is {one:.4g} in the first half of the "
                                        f"motion and {other:.4g} in the second")
        return found

    def agrees(self, best, stds, causes, other, alike=_ALIKE):
        """Whether causes have the same parameters in another fit (or None)."""
        return other is not None and all(
            cause in other.effects and abs(
                getattr(other.effects[cause], name) - getattr(best.effects[cause], name))
            <= max(_AGREE * std, alike * abs(getattr(best.effects[cause], name)))
            for cause in causes for name, std in stds[cause].items())

    def noise_only(self, fitted):
        """Whether a fit leaves nothing but noise."""
        return _unless_it_grows(self._left_in_all(fitted)).share == 0 == self.left(fitted).share

    def left(self, fitted):
        """What the residual still holds."""
        return _once(self._left, fitted, self._left_of)

    def _left_of(self, fitted):
        found = self._left_in_all(fitted)
        # what grows is asked for only where it decides
        if self.found is not None and found.share > _unless_it_grows(found).share \
                and grows_with_motion(self, fitted):
            return dataclasses.replace(found, level=0.0, level_score=0.0)
        return found

    def _left_in_all(self, fitted):
        """The same, with noise that grows with the motion."""
        return _once(self._in_all, fitted, self._left_in_all_of)

    def _left_in_all_of(self, fitted):
        p = self.problem
        across = [signal for axis, signal in enumerate(p.record.reference.T)
                  if axis != p.axis and np.ptp(signal)]
        found = self._leftover(fitted, fitted.residual, across)
        if found.share > 0 and self.found is not None:
            known = added(self, fitted)
            if known.any():
                rest = self._leftover(fitted, fitted.residual - known, across)
                of_all = (rest.rms / found.rms)**2
                found = dataclasses.replace(rest, rms=found.rms, linear=of_all * rest.linear,
                                            level=of_all * rest.level)
        own = self._no_fault(fitted)
        return dataclasses.replace(found, linear=max(found.linear - own, 0.0),
                                   level=max(found.level - own, 0.0))

    def left_beside_noise(self, fitted):
        """The same, where noise may grow with the motion: what comes and goes with that, and
        nothing predicts, bends no cause that is found."""
        found = self.left(fitted)
        predicted = [entry for entry in self._audible_parts(fitted) if entry["part"] != "noise"
                     and entry["share"] > _OF_NOISE.get(entry["part"], _PART)]
        return found if predicted else _unless_it_grows(found)

    def _leftover(self, fitted, residual, across):
        return leftover(residual, fitted.simulated, self.problem.used, across,
                        self.coarse_step(fitted))


def _unless_it_grows(left):
    """A `Leftover` without what only comes and goes with the motion."""
    return dataclasses.replace(left, level_score=0.0)


def _once(store, fitted, make):
    """What is made of a fit, again only where its parameters have changed."""
    known = store.get(fitted.causes)
    if known is None or known[0] != fitted.cost:
        known = store[fitted.causes] = fitted.cost, make(fitted)
    return known[1]
