"""Competing causes: which smallest set describes the record."""

import dataclasses
import functools

import numpy as np

from ..errors import FracAccelError
from ..model import is_link
from ..model.core import Oscillator
from ..model.effects import IDENTIFIED, known_effects
from ..model.effects.fit_starts import EquationOfMotion
from ..model.parameters import fixed_values, parameter_fields
from ..shown import several
from .problem import acts_on_spring, follows_path
from .stages import SEARCHED, Stages

_BEAM = 3
# A start that fits so much worse than the set without its cause has its strength halved, at most so
# often: the strength that screening expects presumes that all else moves along.
_OVERSHOT = 1.5
_HALVINGS = 8
# Factors within which a finite change can be had by a nearby start.
_REACH = (0.6, 1.6)
_FITS = 8
_MOST = 4
# A third cause that takes away less of what is left, and leaves more than noise, ends the search:
# causes are being added up to imitate one that is not known.
_STUCK = 0.2
# Causes that are left out together, at least, where all of them may be none.
_TOGETHER = 2
# Share of the power that the model in use leaves below which what is left is little.
_HARDLY = 1e-3
# Share of the power that a reference's noise hides below which a cause may only mend the guess of
# the motion, by spectra that are estimates; and a frequency [Hz].
_GUESSED, _SOMEWHERE = 0.01, np.ones(1)
# Iterations of a first trial, the cost over the best one's with which it ends there, and that with
# which it goes on only as long as each iteration halves it.
_TRIAL = 4
_HOPELESS = 4.0
_BEHIND = 2.0
# Fits whose arrays are kept, of a record of so many samples or fewer; of longer ones fewer are, but
# two. Those of others are made again when asked for.
_AT_HAND = 8
_AT_HAND_SAMPLES = 20_000
# Samples by which causes are screened, where a record has more.
_SCREENED = 6000
# Share of the power of what a cause changes below which it is what the fit can do already.
_NOTHING_NEW = 1e-6
# Share of the largest gain that is expected in a round below which a cause is not tried.
_LITTLE = 0.25
# Share of a set's cost below which what is promised beside a linear one leaves no sense in a search
# beside a force or friction.
_FAR_LESS = 0.5
# Variances of the noise within which orders and kinds of a cause say the same.
_TIE = 10.0
# Share of a cost within which two are the same.
_ROUNDING = 1e-7
# Variances within which two sets say the same.
SAME = 1.0
# Of those that are compared once more, how far one may have strayed that takes another's place [of
# how far that has].
_STRAYED = 0.5
# Variances from the best fit of a round within which a fit must come if it goes on as it goes.
_NEAR = 200.0
# Times the excess that a smaller set may have over a larger one, from which on, to first order, it
# is not even fitted.
_BEYOND = 10.0
_NOT_TRIED = "some sets of causes were not tried"


@dataclasses.dataclass(frozen=True)
class View:
    """What a cause sees of the search when it says where its fit begins."""

    rate: float
    time: np.ndarray
    measured: np.ndarray
    simulated: np.ndarray
    residual: np.ndarray
    used: np.ndarray
    core: object
    since_start_s: float
    delay_s: float
    level: float
    warms: bool
    excited: dict
    axis: str
    mixing: tuple = None
    # names of the core's parameters that the fit moves
    open_core: frozenset = frozenset()
    # whether the output is the mass's motion, but for a gain, a constant and a delay
    is_motion: bool = False
    gain: float = 1.0
    offset: float = 0.0
    # whether a force or a path bends the motion
    is_bent: bool = False

    @functools.cached_property
    def equation(self):
        """`EquationOfMotion` along the measured output."""
        return EquationOfMotion(self)


class Search:
    """Fits sets of causes, each once."""

    def __init__(self, problem, base=None, candidates=(), stages=None):
        self.problem, self.base = problem, base or {}
        self.candidates = candidates
        # of the base, what has a course in time of its own, beside which all else is looked for
        self.courses = {}
        self.fits = {}
        # by set, the orders and kinds that were best of all
        self._compared = {}
        self.screens, self._starts = {}, {}
        self.stages = stages or Stages(None, problem.limit)

    def fit(self, effects):
        """Fitted set of causes, from the parameters given unless it is known; with other orders or
        kinds of these causes only where that is no worse.

        Where its motion is without bound, the best that is known of fewer.
        """
        known = self.fits.get(frozenset(effects))
        if known is not None and _kinds(known.effects) != _kinds(effects):
            self._forget_worse(effects)
            known = self.fits.get(frozenset(effects))
        if known is None or known.rough:
            try:
                self._keep(self.problem.finished(known) if known else self.problem.fit(effects))
            except FracAccelError:
                fewer = [fit for fit in self.fits.values()
                         if fit.causes < frozenset(effects) and not fit.rough]
                if not fewer:
                    raise
                return min(fewer, key=lambda fit: fit.cost)
        return self.fits[frozenset(effects)]

    @property
    def baseline(self):
        """The model in use, with what is free in every fit but for what was found before all else:
        courses in time, and what the record shows by itself."""
        return self.fit({cause: effect for cause, effect in self.base.items()
                         if cause not in self.courses
                         and (effect.of_reference or not effect.read_off)})

    def to_its_best(self, fitted):
        """A fit that what is reported rests on: trials end as soon as they cannot win."""
        better = self.problem.carried_on(self.fit(fitted.effects))
        if self._compared.get(better.causes) != _kinds(better.effects):
            # beside all others another order may be the right one
            better = self._varied(better, anew=True)
            self._compared[better.causes] = _kinds(better.effects)
        if better is not self.fits.get(better.causes):
            self._keep(better)
        return better

    def again(self, effects):
        """A known set fitted anew, from other parameters."""
        self._keep(self.problem.fit(effects))
        return self.fits[frozenset(effects)]

    def fit_from(self, effects):
        """Fit a set, anew where what is known of it is worse than these effects are. What is
        without bound is left."""
        self._forget_worse(effects)
        self.fit_all([effects])

    def _forget_worse(self, effects, goal=-np.inf):
        """Forget a fit above a goal (a cost) that is worse than these effects are: it had ended in
        another valley."""
        known = self.fits.get(frozenset(effects))
        if known is not None and known.cost > goal and self.problem.cost(effects) < known.cost:
            del self.fits[known.causes]

    def _keep(self, fit):
        self.fits.pop(fit.causes, None)
        self.fits[fit.causes] = fit
        most = min(_AT_HAND, max(_AT_HAND * _AT_HAND_SAMPLES // len(self.problem.record), 2))
        for older in list(self.fits.values())[-2 * _AT_HAND:-most]:
            older.let_go()

    def fit_all(self, sets, best=np.inf, goal=np.inf, needed=False):
        """Fitted sets by cost; none of those that fall far behind (a cost) is fitted to the end.

        Nor are those whose pace would not take them to a `goal` (a cost) or near the best, and,
        once the search has used up its time, none but the best; unless they are `needed`.
        """
        trials, best_before, first = {}, best, True
        for effects in sets:
            key = frozenset(effects)
            if not needed and self.problem.limit.ends_search(_NOT_TRIED):
                break
            try:
                known = self.fits.get(key)
                if known is None or _kinds(known.effects) != _kinds(effects):
                    # with an order that other sets found, a known set may do better
                    trial = self.problem.fit(effects, _TRIAL, True, _HOPELESS * best,
                                             _goal(effects, min(goal, self._near(best))))
                    known = trial if known is None or trial.cost < known.cost else known
                trials[key] = known
            except FracAccelError:
                continue  # a motion without bound describes no record
            best = min(best, trials[key].cost)
        for key, trial in sorted(trials.items(), key=lambda entry: entry[1].cost):
            if trial.rough and not first and self.problem.limit.ends_search(_NOT_TRIED):
                del trials[key]
                continue
            first = False
            if trial.rough and trial.cost <= _HOPELESS * best:
                try:
                    trial = self.problem.finished(trial, _BEHIND * best, goal)
                except FracAccelError:
                    # in finer steps it grows without bound
                    del trials[key]
                    best = min([best_before, *(other.cost for other in trials.values())])
                    continue
                best = min(best, trial.cost)
            # beside a force or friction each order takes long: only of what may be the best
            close = self._near(best) if is_nonlinear(trial) else _BEHIND * best
            if trial is not self.fits.get(key) and trial.cost <= close:
                trial = self._varied(trial)
                best = min(best, trial.cost)
            goal = min(goal, self._near(trial.cost))
            if trial is not self.fits.get(key):
                self._keep(trial)
        return sorted((self.fits[key] for key in trials), key=lambda fit: fit.cost)

    def varied(self, fit):
        """A known fit, or its like with another order or kind where that fits better."""
        better = self._varied(fit)
        if better is not fit:
            self._keep(better)
        return better

    def _varied(self, fit, anew=False):
        """The best of a fit and its like with another of what no fit varies, such as an order or
        which of two peaks is whose; `anew`: whatever has been compared in a smaller set."""
        fit, tried = self._exchanged(fit), set()
        # in a smaller set its like has been compared already
        known = set() if anew else {
                 cause for smaller in self.fits.values() if smaller.causes < fit.causes
                 for cause, effect in smaller.effects.items()
                 if fixed_values(effect) == fixed_values(fit.effects[cause])}
        while True:
            others = []
            for cause, effect in fit.effects.items():
                if cause in known:
                    continue
                for other in effect.alternatives():
                    kind = cause, *fixed_values(other).values()
                    if kind in tried or self.problem.limit.ends_search(
                            "some orders of filters were not tried"):
                        continue
                    tried.add(kind)
                    try:
                        effects = {**fit.effects, cause: other}
                        others.append(self.problem.fit(
                            effects, goal=_goal(effects, self._tied(fit.cost))))
                    except FracAccelError:
                        continue
            close = self._tied(min(other.cost for other in [fit, *others]))
            near = [other for other in [fit, *others] if other.cost <= close]
            if anew:
                # what only says the same does not take its place
                near = [fit, *(other for other in near
                               if self._strayed(other) <= _STRAYED * self._strayed(fit))]
            better = self._leanest(near)
            if better is fit:
                return fit
            fit = better

    def _leanest(self, fits):
        """The best of the fits that have strayed least; of those that are the same but for
        rounding, the one whose parameters are the smallest."""
        strayed = min(map(self._strayed, fits))
        fits = [fit for fit in fits if self._strayed(fit) == strayed]
        same = (1 + _ROUNDING) * min(fit.cost for fit in fits)
        return min((fit for fit in fits if fit.cost <= same), key=lambda fit: sum(
            abs(place) for unknown, place in zip(fit.unknowns, fit.theta)
            if not unknown.logarithmic))

    def _exchanged(self, fit):
        """The better of a fit and the same with two resonances exchanged."""
        free = [effect for cause, effect in fit.effects.items()
                if cause in self.base and effect.restates_core]
        for effect in [e for cause, e in fit.effects.items() if cause not in self.base]:
            for core in free:
                pair = effect.exchanged(core)
                if pair is None or self.problem.limit.ends_search(
                        "which of two resonances is the sensor's was not tried"):
                    continue
                effects = {**fit.effects, **{e.cause: e for e in pair}}
                try:
                    other = self.problem.fit(effects, goal=_goal(effects, fit.cost))
                except FracAccelError:
                    continue
                fit = other if other.cost < fit.cost else fit
        return fit

    def _strayed(self, fit):
        """How far what the model in use leaves open has moved from what it says."""
        return sum(abs(getattr(fit.effects[u.cause], u.name) - getattr(self.base[u.cause], u.name))
                   / u.scale for u in fit.unknowns if u.cause in self.base)

    def _tied(self, cost):
        """Cost up to which a fit ties with one."""
        return (1 + _TIE / self.problem.count) * cost

    def _near(self, cost):
        return (1 + _NEAR / self.problem.count) * cost

    def view(self, fitted):
        p = self.problem
        model = p.axis_model(fitted.effects)
        celsius = p.record.temperature_c
        delay, offset = (IDENTIFIED[name].cause for name in ("delay_s", "offset"))
        own = p.baseline.axis(p.axis).core
        is_bent = any(acts_on_spring(e) or follows_path(e) for e in model.effects)
        return View(p.rate, p.time, p.measured, fitted.simulated, fitted.residual, p.used,
                    model.effective_core, p.record.since_start_s,
                    sum(e.delay_s for e in model.effects if e.cause == delay),
                    # a gain of none leaves no motion that has a level
                    float(np.std(fitted.simulated[p.used])) or p.scales.level,
                    celsius is not None and np.ptp(celsius) > 0.1,
                    p.excited,
                    "xyz"[p.axis],
                    p.mixing(fitted.effects),
                    self._open_core(fitted, own),
                    isinstance(own, Oscillator) and not is_bent and not any(
                        is_link(e) and not e.is_constant for e in model.effects),
                    model.constant_gain,
                    sum(e.offset for e in model.effects if e.cause == offset),
                    is_bent)

    @staticmethod
    def _open_core(fitted, own):
        """Names of the parameters of a core that the effects which a fit moves may restate."""
        free = [fitted.effects[cause] for cause in {unknown.cause for unknown in fitted.unknowns}
                if fitted.effects[cause].restates_core]
        return frozenset(
            field.name for field in parameter_fields(type(own)) for effect in free
            if effect.restating(_other(own, field.name), own) != effect.restating(own, own))

    def screen(self, fitted):
        """List of (cost to be expected, cause, effect to begin with), best start of each cause."""
        if fitted.causes in self.screens:
            return self.screens[fitted.causes]
        view, found = self.view(fitted), []
        rows, share = self._screened_rows()
        known = _orthonormal(np.hstack([fitted.free.whole()[rows], fitted.jacobian[rows]]))
        for place, cause in enumerate(self.candidates):
            self.stages.within(place / len(self.candidates))
            if cause in fitted.effects:
                continue
            if self.problem.limit.ends_search("some causes were not screened"):
                break
            options = [(self._option(start, fitted, cause, known, rows, share), start)
                       for start in known_effects()[cause].starts(view)]
            best, start = min((entry for entry in options if entry[0]),
                              key=lambda entry: entry[0][0], default=(None, None))
            if best:
                found.append(best)
                self._starts[fitted.causes, cause] = start
        self.screens[fitted.causes] = sorted(found, key=lambda entry: entry[0])
        return self.screens[fitted.causes]

    def beside_held(self, effects, held, most):
        """What promises most beside some effects of which some are held where they are: list of
        (cost to be expected, cause, all effects to begin with)."""
        bare = self.problem.fit(effects, held=held)
        # what is screened beside the same causes, but free, is another question
        self.screens.pop(bare.causes, None)
        found = [(cost, cause, self.begun(bare, cause, begin))
                 for cost, cause, begin in self.screen(bare)[:most]]
        self.screens.pop(bare.causes)
        return found

    def begun(self, fitted, cause, begin):
        """Effects to begin with where a cause of `screen` joins a fit."""
        start = self._starts[fitted.causes, cause]
        effects = self._joined(fitted.effects, start, begin)
        for _ in range(_HALVINGS if start.parameter else 0):
            if self.problem.cost(effects, rough=True) < _OVERSHOT * fitted.cost:
                break
            half = getattr(effects[cause], start.parameter) / 2
            effects[cause] = dataclasses.replace(effects[cause], **{start.parameter: half})
        return self._centred(self._in_time(effects, fitted))

    def _in_time(self, effects, fitted):
        """Effects with their delay moved by as much as what joins a fit makes its output later,
        where that is nearer: a trial of a few steps would not come back from there."""
        p, cause = self.problem, IDENTIFIED["delay_s"].cause
        if cause not in effects or any(map(acts_on_spring, effects.values())):
            return effects
        cost = p.cost(effects, rough=True)
        if cost < _OVERSHOT * fitted.cost:
            return effects
        slope = np.gradient(fitted.simulated)[p.used]
        away = (p.simulate(effects) - fitted.simulated)[p.used]
        late_s = -float(away @ slope / max(slope @ slope, 1e-300)) / p.rate
        sooner = self._later(effects, -late_s)
        moved = {**effects, **sooner}
        return moved if sooner and p.cost(moved, rough=True) < cost else effects

    def _centred(self, effects):
        """Effects with their constant moved where it must be, if that is farther than a step of a
        fit: what joins a fit may take gravity away, or give it back."""
        p, cause = self.problem, IDENTIFIED["offset"].cause
        if cause not in effects or any(map(acts_on_spring, effects.values())):
            return effects
        away = float(np.mean((p.measured - p.simulate(effects))[p.used]))
        if not abs(away) > p.scales.level:
            return effects
        constant = effects[cause]
        return {**effects, cause: dataclasses.replace(constant, offset=constant.offset + away)}

    def _joined(self, effects, start, begin):
        """Some effects with that of a start, here `begin`, and what goes with it."""
        effects = {**effects, **self._later(effects, start.lag_s)}
        if start.core is not None:
            own = self.problem.baseline.axis(self.problem.axis).core
            effects = {name: effect.restating(start.core, own) if effect.restates_core else effect
                       for name, effect in effects.items()}
        return {**effects, begin.cause: begin}

    def _later(self, effects, lag_s):
        """The delay among some linear effects, by so much later; none where there is none."""
        cause = IDENTIFIED["delay_s"].cause
        if not lag_s or cause not in effects or any(map(acts_on_spring, effects.values())):
            return {}
        delay = effects[cause]
        return {cause: dataclasses.replace(delay, delay_s=delay.delay_s + lag_s)}

    def _screened_rows(self):
        """Samples by which causes are screened, and how many of those that count each stands for.

        All where they are few; otherwise some at random, which no period can mislead.
        """
        rows = np.flatnonzero(self.problem.used)
        count = len(rows)
        if count > _SCREENED:
            rows = np.sort(np.random.default_rng(0).choice(rows, _SCREENED, replace=False))
        return rows, count / len(rows)

    def _option(self, start, fitted, cause, known, rows, share):
        """(Cost to be expected, cause, effect to begin with) of one start, or None."""
        p, changes = self.problem, []
        if start.kind == "whole":
            cost = self._cost_of_whole(self._joined(fitted.effects, start, start.effect))
            return (cost, cause, start.effect) if cost < fitted.cost else None
        slow = _orthonormal(p.own_motions(start.effect).whole()[rows])
        own = _orthonormal(slow - known @ (known.T @ slow))
        known = np.hstack([known, own])
        residual = fitted.residual[rows]
        residual = residual - known @ (known.T @ residual)
        cost = share * float(residual @ residual)
        for effect in start.columns:
            later = self._later(fitted.effects, start.lag_s)
            try:
                change = p.simulate({**fitted.effects, **later, cause: effect}) - fitted.simulated \
                    if later else p.joined(fitted.effects, cause, effect)
            except FracAccelError:
                return None
            # a ramp of its own can be far larger than all that it changes besides
            change = change[rows] - slow @ (slow.T @ change[rows])
            changes.append(change - known @ (known.T @ change))
            if changes[-1] @ changes[-1] <= _NOTHING_NEW * (change @ change):
                return None
        if len(changes) > 1:
            basis = _orthonormal(np.stack(changes, axis=1))
            explained = share * float(np.sum((basis.T @ residual)**2))
            return cost - explained, cause, start.effect
        size, shared = changes[0] @ changes[0], changes[0] @ residual
        if not np.isfinite(size):
            return None
        factor = shared / size
        if start.kind in ("positive", "weak") and factor <= 0:
            return None
        if start.kind in ("finite", "weak"):
            factor = np.clip(factor, _REACH[0] if start.kind == "finite" else 0.0, _REACH[1])
        effect = start.effect
        if start.parameter:
            one = getattr(effect, start.parameter)
            scaled = p.within(effect, start.parameter, factor * one)
            factor = scaled / one
            effect = dataclasses.replace(effect, **{start.parameter: float(scaled)})
        cost += share * (factor**2 * size - 2 * factor * shared)
        return cost, cause, effect

    def _cost_of_whole(self, effects):
        """Cost of some effects, beside another gain where their motion is linear and the core's is
        free: that was found beside another response."""
        p = self.problem
        try:
            point = p.point(effects, True)
        except FracAccelError:
            return np.inf
        if not self._gain_is_free or any(map(acts_on_spring, effects.values())):
            return point.cost
        moving = p.clear(point.simulated, point.free)
        moving = moving - moving[p.used].mean() * p.used
        shared = moving @ point.residual
        return point.cost - shared**2 / max(moving @ moving, np.finfo(float).tiny)

    @functools.cached_property
    def _gain_is_free(self):
        """Whether a cause of the base says the core's sensitivity anew."""
        core = self.problem.baseline.axis(self.problem.axis).core
        return any(effect.is_constant and is_link(effect) for effect in self.base.values()) \
            and isinstance(core, Oscillator)

    def run(self, threshold, promises, done, seed=None, held=()):
        """Grow sets of causes until nothing is gained, and leave out what is not needed.

        Parameters
        ----------
        threshold : callable
            Cost by which a fit must be better than a smaller one.
        promises : callable
            Whether a cost that a screening expects is worth a fit.
        done : callable
            True for a fit that leaves nothing but noise.
        seed : dict of str to Effect, optional
            Causes to begin with, besides none.
        held : collection of str, optional
            What is free in every fit, but has moved farther than is likely: causes are tried
            beside where it was, too.
        """
        bare = self.fit(self.base)
        self.stages.enter_round("looking at all causes", SEARCHED)
        seeds = [{}, seed or {}]
        if held:
            begun = self.beside_held(self.base, held, _BEAM)
            seeds += [fit.effects for fit in self.fit_all(
                [effects for cost, _, effects in begun if promises(bare, cost)])]
        if not done(bare):
            seeds.append(self.everyday(bare))
        grown = self.grow([begin for i, begin in enumerate(seeds) if begin or not i],
                          threshold, promises, done, _MOST)
        best = self.prune(grown, threshold)
        other = self._with_one_filter(best)
        return best if other is best else self.prune(other, threshold)

    def _with_one_filter(self, best):
        """A set with one filter in place of several, where that describes the record as well.

        Each that joined took the most at its time: a delay, then a resonance for what the delay
        lacks, and so on, until together they imitate a filter of higher order.
        """
        filters = {cause for cause, effect in best.effects.items()
                   if cause not in self.base and acts_as_filter(effect)}
        if len(filters) < 2 or self.problem.limit.ends_search(
                "one filter in place of several was not tried"):
            return best
        rest = self.fit({c: effect for c, effect in best.effects.items() if c not in filters})
        alone = map(self.varied, self.with_a_filter(rest, _FITS)[:_BEAM])
        return min((fit for fit in alone
                    if fit.cost <= self._tied(best.cost)),
                   key=lambda fit: fit.cost, default=best)

    def with_a_filter(self, fitted, most, best=np.inf):
        """Fits with one filter more by cost, of the `most` that promise most; none of those that
        fall far behind the best cost is fitted to the end."""
        chosen = [(cause, begin) for _, cause, begin in self.screen(fitted)
                  if acts_as_filter(begin)][:most]
        return self.fit_all([self.begun(fitted, *join) for join in chosen], best)

    def grow(self, seeds, threshold, promises, done, most):
        """The best set that grows from any of some; `most` is the number of causes to be added."""
        beam = sorted((self.fit({**self.base, **begin}) for begin in seeds),
                      key=lambda fit: fit.cost)
        best = beam[0]
        for added in range(most):
            known = several(len(best.causes - self.base.keys()), "cause")
            if self.problem.limit.ends_search(f"sets of more than {known} were not tried"):
                break
            self.stages.enter_round(f"searching for cause {added + 1}", SEARCHED)
            wanted, unscreened = {}, []
            # beside noise only by what is clear whatever the spectrum of what would be left
            least = best.cost / (1 + threshold(best) / best.cost) if done(best) else np.inf
            for parent in sorted(beam, key=is_nonlinear):
                promised = min((cost for cost, *_ in wanted.values()), default=np.inf)
                if is_nonlinear(parent) and promised < _FAR_LESS * parent.cost:
                    unscreened.append(parent)  # beside a force or friction it takes long
                    continue
                for cost, cause, begin in self.screen(parent):
                    key = parent.causes | {cause}
                    if promises(parent, cost) and cost < least \
                            and (key not in wanted or cost < wanted[key][0]):
                        wanted[key] = cost, parent, cause, begin
            wanted |= self._as_beside_others(unscreened, wanted)
            chosen = _varied_choice(sorted(wanted.values(), key=lambda entry: entry[0]), best.cost)
            fits = self.fit_all([self.begun(*joins) for _, *joins in chosen])
            if not fits or best.cost - fits[0].cost < threshold(fits[0]):
                break
            before, best = best.cost, fits[0]
            gained = 1 - best.cost / before
            beam = self._that_differ([fit for fit in fits[:_BEAM]
                                      if fit.cost <= _HOPELESS * best.cost])
            if added >= 2 and gained < _STUCK and not done(best):
                break
            if best.cost < _HARDLY * self.baseline.cost and self.problem.limit.ends_growing(
                    f"what makes less than {_HARDLY:.1%} of the power that the model in use leaves "
                    "was not looked for"):
                break
            if before - best.cost < self._of_guesses(best) and self.problem.limit.ends_growing(
                    f"what makes less than {_GUESSED:.0%} of what the reference's noise hides was "
                    "not looked for"):
                break
        return best

    def _as_beside_others(self, unscreened, wanted):
        """What promises most beside other fits, for some that were not screened, as `wanted`."""
        found = {}
        for parent in unscreened:
            cost, other, cause, begin = min(wanted.values(), key=lambda entry: entry[0])
            key = parent.causes | {cause}
            if cause not in parent.causes and key not in wanted:
                self._starts[parent.causes, cause] = self._starts[other.causes, cause]
                found[key] = cost, parent, cause, begin
        return found

    def _of_guesses(self, fitted):
        """Cost that further filters may gain as the motion is only guessed from a noisy reference.
        """
        if not any(effect.of_reference and effect.unknown_density(_SOMEWHERE).any()
                   for effect in self.base.values()):
            return 0.0
        return _GUESSED * min(self.problem.count * self.problem.by_reference(fitted.effects),
                              fitted.cost)

    def _that_differ(self, fits):
        """Some fits, less those that say the same as one before them but for what mixes the axes:
        what joins one of them does the same beside the other."""
        found = []
        for fit in fits:
            if not any(mixes_otherwise(fit, other) and self._say_the_same(fit, other)
                       for other in found):
                found.append(fit)
        return found

    def _say_the_same(self, *fits):
        """Whether the costs of two fits are the same to within the noise of a sample or so."""
        costs = [fit.cost for fit in fits]
        return max(costs) - min(costs) < SAME * min(costs) / self.problem.count

    def everyday(self, fitted):
        """Causes that are common and cheap, each from its best start.

        What is odd must win beside them, lest it be taken for what they would have explained.
        """
        return {cause: begin for _, cause, begin in self.screen(fitted)
                if type(begin).everyday}

    def prune(self, best, threshold):
        """Leave out causes without which the record is described as well."""
        if is_nonlinear(best):
            best = self._of_needed(best, threshold(best))
        while True:
            goal = best.cost + threshold(best)
            smaller = [self.without(best, cause, goal) for cause in best.effects
                       if cause not in self.base and not self._is_needed(best, cause, goal)]
            smaller = [fit for fit in smaller if fit.cost < goal]
            if not smaller:
                return best
            best = min(smaller, key=lambda fit: fit.cost)

    def _of_needed(self, best, more):
        """A fit of what is beyond doubt needed, where each of all the others is worth less than
        this `more` of the cost: to leave them out one by one takes as many fits of a motion that
        is simulated step by step as there are pairs; else the fit as it is."""
        less = {cause: effect for cause, effect in best.effects.items() if cause in self.base
                or effect.restates_core or self._is_needed(best, cause, best.cost + more)}
        gone = len(best.effects) - len(less)
        if gone < _TOGETHER:
            return best
        goal = best.cost + gone * more
        found = next(iter(self.fit_all([less], best.cost, goal, needed=True)), None)
        return found if found and found.cost < goal else best

    def _is_needed(self, best, cause, goal):
        """Whether what is left without a cause, all others moved to first order, is beyond doubt
        above a goal (a cost)."""
        effects = {name: effect for name, effect in best.effects.items() if name != cause}
        if best.effects[cause].restates_core or not effects:
            return False
        p = self.problem
        try:
            left = best.residual + p.clear(best.simulated - p.simulate(effects), best.free)
        except FracAccelError:
            return False
        columns = best.jacobian[:, [unknown.cause != cause for unknown in best.unknowns]]
        basis = _orthonormal(columns)
        left = left - basis @ (basis.T @ left)
        return float(left @ left) > max(goal + _BEYOND * (goal - best.cost), _BEHIND * goal)

    def without(self, fitted, cause, goal=np.inf):
        """The same set without one cause, fitted anew; not to the end if no pace to a goal."""
        less = self._left_to_others(fitted, cause)
        self._forget_worse(less, goal)
        found = next(iter(self.fit_all([less], fitted.cost, goal, needed=True)), None)
        found = found or self.fit(less)
        gone = fitted.effects[cause]
        if goal < found.cost and not any(map(acts_on_spring, less.values())) and (
                gone.pure_delay_s() or gone.adds and any(
                    effect.adds and effect.alternatives() for effect in less.values())):
            # a filter of another order has another delay, and what settles elsewhere another zero
            found = self.varied(found)
        return found

    def _left_to_others(self, fitted, cause):
        """Effects of a fit without one cause; what it says of the core is left to the others that
        can say it, if that describes the record better."""
        less = {name: effect for name, effect in fitted.effects.items() if name != cause}
        if not fitted.effects[cause].restates_core:
            return less
        own = self.problem.baseline.axis(self.problem.axis).core
        core = self.problem.axis_model(fitted.effects).effective_core
        told = {name: effect.restating(core, own) if effect.restates_core else effect
                for name, effect in less.items()}
        return less if told == less else min(
            less, told, key=functools.partial(self.problem.cost, rough=True))


def acts_as_filter(effect):
    """Whether an effect changes different frequencies differently, if only by a delay."""
    return not effect.is_constant and bool(is_link(effect) or effect.pure_delay_s()
                                           or effect.restates_core)


def mixes_otherwise(fit, best):
    """Whether two sets differ by what mixes the axes, and by nothing else."""
    apart = [fits.effects[cause] for fits, other in ((fit, best), (best, fit))
             for cause in fits.causes - other.causes]
    return bool(apart) and all(effect.mixes_axes for effect in apart)


def _goal(effects, cost):
    """Cost to which a fit of some effects must come at its pace; none where the motion is linear,
    and cheap enough to be tried in any case."""
    return cost if any(map(acts_on_spring, effects.values())) else np.inf


def _other(core, name):
    """A core with another value of one parameter."""
    return dataclasses.replace(core, **{name: 0.9 * getattr(core, name)})


def is_nonlinear(fitted):
    """Whether the motion of a fit is simulated step by step."""
    return any(acts_on_spring(effect) or follows_path(effect)
               for effect in fitted.effects.values())


def _varied_choice(wanted, cost):
    """The most promising of some (cost, set, cause, start) by cost: each cause beside its best set,
    before any of them beside another one; none that promises little beside the best of them.

    `cost` is that of the best set so far.
    """
    enough = cost - _LITTLE * max(cost - wanted[0][0], 0.0) if wanted else cost
    seen, first, later = set(), [], []
    for entry in wanted:
        if entry[0] <= enough or wanted[0][0] >= cost:
            (later if entry[2] in seen else first).append(entry)
            seen.add(entry[2])
    return [*first, *later][:_FITS]


def _kinds(effects):
    """What no fit varies of some effects, by cause."""
    return {cause: fixed_values(effect) for cause, effect in effects.items()}


def _orthonormal(columns):
    if not columns.shape[1]:
        return columns
    vectors, sizes, _ = np.linalg.svd(columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300),
                                      full_matrices=False)
    return vectors[:, sizes > 1e-6]
