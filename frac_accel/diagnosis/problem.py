"""Fit of named causes to a record by simulation error."""

import dataclasses
import functools
from typing import NamedTuple

import numpy as np
from scipy.optimize import lsq_linear

from ..errors import FracAccelError
from ..identification.response.excitation import strongest_stretch
from ..model import AXES, AxisModel, is_link
from ..model.core.static_force import StaticForce
from ..model.effects.axis_mixing import mix
from ..model.effects.base import CORE, DEAD_ZONE, GAIN, INTERFERENCE, Effect
from ..model.parameters import Scales, fixed_values, parameter_fields
from ..signals.kept import kept
from ..simulation import EDGE, AxisSimulator
from ..simulation.free_motion import fading, free_motions
from .in_band import InBand
from .other_axes import UNLIKE, acts_before
from .short_columns import ShortColumns
from .time_limit import TimeLimit

# Iterations of a fit, and steps that are tried in each.
_ITERATIONS = 12
_TRIES = 6
_STEP = 1e-3
# Share of the largest eigenvalue of the scaled products of derivatives that counts as none.
_SINGULAR = 1e-10
# Steps of a nonlinear core in each sampling interval: for the output, share of what the cause adds
# by which it is wrong at most, where measured, and steps for its derivatives (wrong by ten times
# that, which bends no fit).
_STEPS, WRONG_BY_STEPS = 4, 3e-4
_STEPS_OF_SLOPES = 2
# Turns of the sensor whose motion stays in memory: a fit tries each angle in both directions.
_TURNS = 4
# Frequencies over which a density is integrated.
_LINES = 2049
# Times the largest measured value from which a simulated one counts as without a bound.
_UNBOUND = 1e6
# Sum of the other axes' shares below which a first order leaves out how that changes.
_CROSSED = 0.1
# Share of what a step promises that it gains where derivatives leave nothing out that counts.
_TRUE = 0.8, 1.25
# The same, differing from 1 by less than this, where derivatives serve another step of what
# takes long to simulate.
_AS_PROMISED = 0.1
# Largest step, in scales, where those before have gained what they promised.
_FARTHEST = 8.0
# A gain of this share of one sample's error changes nothing that the data can tell.
_SMALL_GAIN = 1e-2


@dataclasses.dataclass(frozen=True)
class Unknown:
    """One parameter of one cause, as the search sees it."""

    cause: str
    name: str
    logarithmic: bool
    scale: float
    low: float
    high: float
    step: float
    jumps: bool = False


class Point(NamedTuple):
    """Output and error with certain parameters.

    Attributes
    ----------
    effects : dict of str to Effect
    simulated : ndarray, shape (n,)
        Output with them, without what the time before the record may have left.
    columns, free : ShortColumns, shape (n, m)
        Free motions that this may be, and an orthonormal basis of them where samples count.
    left : ndarray, shape (m,)
        Size of each column in the record.
    residual : ndarray, shape (n,)
        Measured less simulated and free motions [output units]; 0 where a sample does not count.
    cost : float
        Sum of the squares of the residual, and of the reference's noise that is kept from it.
    """

    effects: dict
    simulated: np.ndarray
    columns: ShortColumns
    free: ShortColumns
    left: np.ndarray | None
    residual: np.ndarray
    cost: float


class Kept(NamedTuple):
    """What stays of a `Point` whose arrays are let go, until they are asked for again."""

    effects: dict
    cost: float


@dataclasses.dataclass(eq=False)
class Fitted:
    """Causes with the parameters that describe a record best.

    Attributes
    ----------
    problem : Problem
    point : Point or Kept
        Its attributes are those of the fit, too.
    unknowns : tuple of Unknown
    theta : ndarray, shape (p,)
    settled : bool
        Whether more iterations would gain nothing that counts.
    rough : bool
        Whether steps and iterations were spared.
    exact : bool
        Whether derivatives leave nothing out.
    trust : float
        How much of what it promised the last step has gained; 1 before the first.
    reach : float
        Largest step of an unknown that has a scale.
    updated : bool
        Whether its derivatives are those before its last step, with what that has shown.
    """

    problem: "Problem"
    point: Point | Kept
    unknowns: tuple
    theta: np.ndarray
    settled: bool = False
    rough: bool = False
    exact: bool = False
    trust: float = 1.0
    reach: float = 1.0
    updated: bool = False

    effects = property(lambda self: self.point.effects)
    cost = property(lambda self: self.point.cost)
    simulated = property(lambda self: self.whole.simulated)
    output = property(lambda self: self.whole.columns.add_to(self.simulated.copy(),
                                                            self.whole.left))
    free = property(lambda self: self.whole.free)
    residual = property(lambda self: self.whole.residual)

    @property
    def whole(self):
        """The `Point`, made again where its arrays were let go."""
        if not isinstance(self.point, Point):
            self.point = self.problem.point(self.point.effects, self.rough)
        return self.point

    def let_go(self):
        """Keep no arrays; they are made again when asked for."""
        self.point = Kept(self.effects, self.cost)
        self.__dict__.pop("jacobian", None)

    @property
    def causes(self):
        """Names of the causes."""
        return frozenset(self.effects)

    @property
    def varied(self):
        """Number of parameters that were fitted, with the constant and the drift that are free
        where a filter of the reference has lost them."""
        return len(self.unknowns) + sum(2 * bool(np.any(effect.poles() == 0))
                                        for effect in self.effects.values())

    @property
    def size(self):
        """Number of parameters that were chosen: also the orders and kinds tried."""
        return self.varied + sum(len(fixed_values(effect)) for effect in self.effects.values())

    @functools.cached_property
    def jacobian(self):
        """Derivatives of the output by the unknowns, shape (n, p), clear of free motions."""
        return self.problem.slopes(self)

    def update(self, before, step):
        """Take the derivatives from a fit one step before, with what the step has shown (C. G.
        Broyden, *Math. Comp.* 19 (1965) 577-593)."""
        missed = before.residual - self.residual - before.jacobian @ step
        self.jacobian = before.jacobian + np.outer(missed, step / (step @ step))
        self.updated = True

    def as_derived(self):
        """The fit, its derivatives made anew where they were only updated."""
        return dataclasses.replace(self, updated=False) if self.updated else self


class Problem:
    """Simulation of one axis of a record with any set of causes, and its fit.

    Parameters
    ----------
    record : Record
    axis : int
    baseline : SensorModel
        The model in use.
    used : ndarray of bool, shape (n,)
        Samples that count.
    limit : TimeLimit, optional
    others : OtherAxes
        Which causes the other axes have as well.
    """

    def __init__(self, record, axis, baseline, used, limit=None, others=UNLIKE):
        self.record, self.axis, self.baseline = record, axis, baseline
        self.others = others
        # `ReferenceNoise` that counts behind no filter, and its power behind the model in use
        self.passed_on = self._passed = None
        self.limit = limit or TimeLimit()
        self.rate = record.sampling_rate_hz
        self.in_band = InBand(record) if record.band_hz else None
        self.time = np.arange(len(record)) / self.rate  # since this part's start
        self.measured = record.sensor[:, axis]
        self.used = used.copy()
        self.edge = min(EDGE, len(record) // 16)
        self.used[:self.edge] = self.used[len(record) - self.edge:] = False
        self.calls = 0
        self.let_go()

    def let_go(self):
        """Keep nothing that has been simulated; it is made again when asked for."""
        self._simulators = {}
        self._last, self._moved, self._others = (None, None), (None, None), {}
        self._turned = {}
        self._columns, self._mixings = {}, {}

    @property
    def recorded(self):
        """Measured values with what is known of each sample and was taken off, shape (n,)."""
        off = self.record.taken_off
        return self.measured if off is None else self.measured + off

    @property
    def count(self):
        """Number of samples that count."""
        return int(self.used.sum())

    def simulator(self, axis, steps=_STEPS, part=None):
        """Simulator of one axis, with as many steps in each sampling interval.

        `part` of the output of a record that was filtered to a band: its "linear" motion; the
        "deviation" that a law adds, which comes from all of the motion, and is filtered as the
        record was; or the "whole" before any filter.
        """
        if (axis, steps, part) not in self._simulators:
            self._simulators[axis, steps, part] = self._new_simulator(
                np.eye(3)[axis], axis, steps, part)
        return self._simulators[axis, steps, part]

    def _new_simulator(self, shares, axis, steps, part):
        """Simulator of an axis along which the base moves by so much of each of its own axes."""
        record = self.record
        motion = mix(record.reference, shares[None])[:, 0]
        if part not in (None, "linear"):
            motion = motion + shares[axis] * (record.unfiltered - record.reference[:, axis])
        return AxisSimulator(
            motion, self.rate, record.temperature_c, start_time_s=record.since_start_s,
            steps_per_sample=steps, lag_s=record.lag_s,
            shown=self.in_band.added if part == "deviation" else None,
            only=None if part == "whole" else part)

    def _simulator_of(self, model, axis, steps=_STEPS, part=None):
        """`simulator` of a model of an axis, which may be turned."""
        shares = model.base_shares(axis)
        if np.array_equal(shares, np.eye(3)[axis]):
            return self.simulator(axis, steps, part)
        return kept(self._turned, (*shares, axis, steps, part), self._new_simulator,
                    shares, axis, steps, part, most=_TURNS)

    def _respond(self, model, steps):
        """Output of core and links of the diagnosed axis; besides, where a law of the output will
        bend it and the record was filtered, that before the filter."""
        bends = model.static_force or model.path_dependent
        parts = [None]
        if self.record.unfiltered is not None and bends:
            parts = ["linear", "deviation"]
        outputs = [sum(self._simulator_of(model, self.axis, steps, part).respond(model)
                       for part in parts)]
        if self.record.unfiltered is not None \
                and any(effect.stage == DEAD_ZONE for effect in model.effects):
            outputs.append(self._simulator_of(model, self.axis, steps, "whole").respond(model))
        return outputs

    def axis_model(self, effects, axis=None):
        """Model of an axis (default: the diagnosed one) with these causes."""
        base = self.baseline.axis(self.axis if axis is None else axis)
        own = *self.baseline.reference_faults, *base.effects
        kept = [effect for effect in own if effect.cause not in effects]
        return AxisModel(base.core, tuple(sorted([*kept, *effects.values()],
                                                 key=lambda effect: effect.stage)))

    def simulate(self, effects, across=True, steps=_STEPS):
        """Output of the axis with these causes, shape (n,); without what other axes' outputs add if
        asked."""
        self.calls += 1
        model = self.axis_model(effects)
        circumstances = self.simulator(self.axis, steps).circumstances
        outputs = self._respond(model, steps)
        for effect in model.effects:
            if effect.stage == DEAD_ZONE and len(outputs) > 1:
                outputs = self.in_band.behind(effect, *outputs, circumstances)
            elif effect.stage == INTERFERENCE and self.in_band:
                added = effect.live(self.rate).simulate(outputs[0], circumstances) - outputs[0]
                outputs = [outputs[0] + (self.in_band.filtered(added) if added.any() else 0.0)]
            elif not effect.mixes_outputs:
                outputs = [effect.live(self.rate).simulate(values, circumstances)
                           for values in outputs]
            else:
                own = effect.share_of_axes(self.axis)[self.axis]
                added = self._across(effects, effect) if across else 0.0
                outputs = [own * values + added for values in outputs]
        return outputs[0]

    def _across(self, effects, effect):
        """What an effect adds of the other axes' outputs; so little that few steps do.

        These have the model in use, and of the causes only what is the same for all axes.
        """
        total = np.zeros(len(self.record))
        common = self.others.common(effects)
        for other, share in enumerate(effect.share_of_axes(self.axis)):
            if other == self.axis or not share or not np.ptp(self.record.reference[:, other]):
                continue
            model = self.axis_model(common, other)
            before = AxisModel(model.core, tuple(e for e in model.effects
                                                 if e.stage < effect.stage))
            simulator = self._simulator_of(before, other, _STEPS_OF_SLOPES)
            total += share * kept(self._others, (other, before.effects), simulator.simulate, before)
        return total

    def change(self, effects, cause, effect, by_links=True):
        """First-order change of the output, shape (n,), when a cause is added or changed.

        Forces of the spring act on the motion as it is, other causes as if there were no such
        forces, and what comes across from the other axes stays as it is where they do not have the
        cause: cheap, and right for small ones. What links change of that counts where asked
        (`by_links`).
        """
        linear = {name: other for name, other in effects.items()
                  if not acts_on_spring(other) and name != cause}
        model = self.axis_model(linear)
        if acts_on_spring(effect) and type(effect).base_gain is Effect.base_gain:
            motion = self.motion({name: other for name, other in effects.items() if name != cause})
            added = self.force(model, effect, motion)
            if cause in effects:
                added = added - self.force(model, effects[cause], motion)
            for later in model.effects:
                # gains after the core act on what it adds as well; the rest is nearly the same
                if later.stage == GAIN and not is_link(later):
                    added = later.live(self.rate).simulate(
                        added, self.simulator(self.axis).circumstances)
            return added
        before = {**linear, cause: effects[cause]} if cause in effects else linear
        across = effect.mixes_outputs or (
            by_links and is_link(effect) and self.others.have(effect))
        # beside a path, few steps show as much of what joins it as a first order is worth
        few = cause not in effects and any(map(follows_path, [effect, *linear.values()]))
        steps = _STEPS_OF_SLOPES if few else _STEPS
        return self.simulate({**linear, cause: effect}, across, steps) \
            - self._remembered(before, across, steps)

    def joined(self, effects, cause, effect):
        """Change of the output, shape (n,), when a cause joins others, for a screening: to first
        order, but for a force that holds the mass, and what such a force makes of a gain or of
        time. Where that hardly moves otherwise, or turns within few samples, a first order says
        nothing, and the force is simulated."""
        model = self.axis_model(effects)
        of_gain_or_time = not (is_link(effect) or effect.adds or acts_on_spring(effect))
        if any(_holds(other, model)
               for other in ([effect] if not of_gain_or_time else effects.values())):
            return self.simulate({**effects, cause: effect}, steps=_STEPS_OF_SLOPES) \
                - self._remembered(effects, True, _STEPS_OF_SLOPES)
        return self.change(effects, cause, effect, not self._hardly_crossed(effects))

    def _hardly_crossed(self, effects):
        """Whether the other axes' outputs add so little that a first order may leave out its
        change."""
        return all(np.abs(np.delete(effect.share_of_axes(self.axis), self.axis)).sum() < _CROSSED
                   for effect in self.axis_model(effects).effects if effect.mixes_outputs)

    def force(self, model, effect, motion):
        """First-order response to a force along a motion."""
        from .first_order import force_response
        return force_response(model, effect, motion, self.rate, self.record.lag_s)

    def motion(self, effects):
        """Motion of the mass with these causes, shape (n,) [output units]; the last one is kept."""
        model = self.axis_model(effects)
        model = AxisModel(model.core, tuple(e for e in model.effects if e.stage <= CORE))
        if self._moved[0] != model:
            self._moved = model, self._simulator_of(model, self.axis).respond(model)
        return self._moved[1]

    def _remembered(self, effects, across, steps=_STEPS):
        """Output with these causes; the last one is kept."""
        key = across, steps, *effects.items()
        if self._last[0] != key:
            self._last = key, self.simulate(effects, across, steps)
        return self._last[1]

    def free_columns(self, effects):
        """What the time before the record may have left, as `ShortColumns`."""
        model = self.axis_model(effects)
        return kept(self._columns, model.dynamics, self._free_columns, model, most=2)

    def _free_columns(self, model):
        return ShortColumns.of(*free_motions(model, self.time, self.used))

    def own_motions(self, effect):
        """Orthonormal `ShortColumns`: slow motions that a cause of its own may have left."""
        slow = [pole for pole in np.atleast_1d(effect.poles())
                if -pole.real * EDGE < self.rate]
        columns = fading([pole for pole in slow if pole != 0], self.time, self.used)
        if any(pole == 0 for pole in slow):
            columns = np.c_[columns, np.ones(len(columns)), self.time]
        return ShortColumns.of(columns).orthonormal(self.used)[0]

    def clear(self, values, free):
        """Values where they count, without the free motions; shape (n,) or (n, p)."""
        masked = values * (self.used if values.ndim == 1 else self.used[:, None])
        return free.add_to(masked, -free.products(masked))

    def taken(self, values):
        """Values of the record as they are simulated: all of them."""
        return values

    def put_back(self, values, whole):
        """A whole record's values with those that are simulated replaced: all of them."""
        return values

    def strongest(self, length):
        """Slice of at most `length` samples where the motion is strongest."""
        return strongest_stretch(self.record.reference[:, self.axis], length)

    @property
    def coherent(self):
        """Slice without gaps in time: all."""
        return slice(0, len(self.record))

    def part(self, rows):
        """Record of a slice."""
        return self.record.part(rows)

    def errors(self, fitted):
        """Measured less simulated with a fit, everywhere in the record; NaN where not known."""
        found = np.full(len(self.record), np.nan)
        inside = slice(self.edge, len(found) - self.edge)
        found[inside] = (self.measured - fitted.output)[inside]
        return found

    def dated(self, fit):
        """Effects of a fit, with its instants where the whole record has them."""
        return fit.effects

    def response(self, axis, links=()):
        """Output of one axis of the model in use, with effects that all axes have, before those on
        the samples, shape (n,)."""
        model = self.axis_model({effect.cause: effect for effect in links}, axis)
        return self._simulator_of(AxisModel(model.core, links), axis).respond(model)

    def mirrored(self):
        """The same problem with the reference turned round."""
        whole = self.record.unfiltered
        return Problem(dataclasses.replace(self.record, reference=-self.record.reference,
                                           unfiltered=None if whole is None else -whole),
                       self.axis, self.baseline, self.used, self.limit)

    def restricted(self, used):
        """The same problem with fewer samples that count."""
        part = object.__new__(type(self))
        part.__dict__.update(self.__dict__, used=used, _columns={})
        return part

    def beside(self, others):
        """The same problem beside other axes of which something else is known."""
        other = self.restricted(self.used)
        other.others = others
        other.let_go()
        return other

    def fit(self, effects, iterations=_ITERATIONS, rough=False, hopeless=np.inf, goal=np.inf,
            held=()):
        """Parameters of these causes that describe the record best, found from those given.

        Parameters
        ----------
        effects : dict of str to Effect
        iterations : int
        rough : bool
            With as few steps of a nonlinear core as derivatives need.
        hopeless : float
            Cost above which a fit ends that an iteration does not improve by half.
        goal : float
            Cost that a fit must come to at its pace, once it is finished, or it ends. Gains are
            taken to shrink evenly to nothing in the iterations to come.
        held : collection of str
            Causes whose parameters stay as they are.

        Returns
        -------
        Fitted
        """
        unknowns = tuple(unknown for cause in effects if cause not in held
                         for unknown in self.unknowns(effects[cause]))
        theta = np.array([_to_theta(getattr(effects[u.cause], u.name), u) for u in unknowns])
        inside = np.clip(theta, [u.low for u in unknowns], [u.high for u in unknowns])
        if np.any(inside != theta):
            theta, effects = inside, self.replaced(effects, unknowns, inside)
        point = self.point(dict(effects), rough)
        return self._improved(Fitted(self, point, unknowns, theta, rough=rough), iterations,
                              hopeless, goal)

    def finished(self, fit, hopeless=np.inf, goal=np.inf):
        """A rough fit with the steps and iterations that it was spared; see `fit`."""
        finer = dataclasses.replace(fit, point=self.point(fit.effects, False), rough=False,
                                    trust=1.0 if fit.settled else fit.trust)
        finer.jacobian = fit.jacobian
        return self._improved(finer, _ITERATIONS, hopeless, goal)

    def carried_on(self, fit):
        """A fit that may have ended early, or near its best only, at its best."""
        if fit.settled and (fit.exact or not any(map(acts_on_spring, fit.effects.values()))):
            return fit
        return self._improved(dataclasses.replace(fit, exact=True), _ITERATIONS, np.inf, np.inf)

    def _improved(self, here, iterations, hopeless, goal):
        """A fit with more iterations."""
        damping, here.settled = 0.0, not here.unknowns
        to_come = _ITERATIONS if here.rough else 0
        for left in reversed(range(iterations if here.unknowns else 0)):
            if self.limit.ends_judging("fits were not carried to their end"):
                break
            small = _SMALL_GAIN * here.cost / self.count
            needed = 2 * (here.cost - goal) / (left + 1 + to_come)
            here, there, damping = self._tried(here, damping, small, needed)
            if there is None and not np.ptp(here.simulated):
                there = self._set_in_motion(here)
            if there is None:
                break
            gained = here.cost - there.cost
            there.settled = gained < small and damping < 1e-2
            # where the parabola promises too much, a longer step would only be refused
            if there.trust > 0.75:
                damping = damping / 10 if damping > 1e-6 else 0.0
            elif there.trust < 0.25:
                damping = max(2 * damping, 1e-3)
            here = there
            if gained < (here.cost if here.cost > hopeless else small):
                break
        return here.as_derived()

    def _tried(self, here, damping, small, needed):
        """A fit; the same one step better, or None; and the damping that the step took.

        There is none where it promises less than a `small` gain, or, as far as such promises can
        be trusted, less than the `needed` one.
        """
        forces = {*map(acts_on_spring, here.effects.values())}
        spared, costly = len(forces) > 1, True in forces or any(
            map(follows_path, here.effects.values()))
        low, high = np.array([(u.low, u.high) for u in here.unknowns]).T
        most = np.array([1.0 if u.logarithmic else here.reach for u in here.unknowns])
        for _ in range(_TRIES):
            gram, slope = _normal(here)
            step = _step(gram, slope, damping, np.maximum(low - here.theta, -most),
                         np.minimum(high - here.theta, most))
            promised = 2 * step @ slope - step @ gram @ step
            if promised < small and here.updated:
                here = here.as_derived()
                continue
            if promised < small or here.trust * promised < needed:
                here.settled = promised < small and damping < 1e-2
                break
            theta = np.clip(here.theta + step, low, high)
            try:
                point = self.point(self.replaced(here.effects, here.unknowns, theta), here.rough)
            except FracAccelError:
                point = None
            if point is not None and point.cost < here.cost:
                went = theta - here.theta
                trust = (here.cost - point.cost) / (2 * went @ slope - went @ gram @ went)
                there = dataclasses.replace(here, point=point, theta=theta, trust=min(trust, 1.0),
                                            updated=False)
                if costly and abs(trust - 1) < _AS_PROMISED:
                    there.update(here, went)
                if not _TRUE[0] < trust < _TRUE[1]:
                    # derivatives that leave something out lead astray where that shows
                    there.exact, there.reach = here.exact or spared, 1.0
                elif np.any(np.abs(went) > 0.99 * most):
                    there.reach = min(2 * here.reach, _FARTHEST)
                return here, there, damping
            if here.updated:
                here = here.as_derived()
                continue
            if spared and not here.exact:
                here = dataclasses.replace(here, exact=True)
                continue
            if promised < here.cost / self.count:
                break  # of no more use than one sample
            damping = max(10 * damping, 1e-3)
        return here, None, damping

    def _set_in_motion(self, here):
        """A fit whose gain is just none, beside which nothing else has a size or a derivative, one
        step of the gain on; or None."""
        gains = np.array([here.effects[unknown.cause].is_constant for unknown in here.unknowns])
        gram, slope = _normal(here)
        sizes = np.diag(gram)
        theta = here.theta + np.where(gains & (sizes > 0), slope / np.maximum(sizes, 1e-300), 0.0)
        try:
            point = self.point(self.replaced(here.effects, here.unknowns, theta), here.rough)
        except FracAccelError:
            return None
        return dataclasses.replace(here, point=point, theta=theta) \
            if point.cost < here.cost else None

    def point(self, effects, rough):
        """`Point` with these parameters; raises FracAccelError where the motion has no bound."""
        simulated = self.simulate(effects, steps=_STEPS_OF_SLOPES if rough else _STEPS)
        self._require_bound(simulated)
        columns = self.free_columns(effects)
        error = (self.measured - simulated) * self.used
        left, free = columns.describing(error, self.used, self._level)
        residual = columns.add_to(error, -left) * self.used
        return Point(effects, simulated, columns, free, left, residual,
                     float(residual @ residual) + self._kept_off(effects))

    def by_reference(self, effects):
        """Power [output units squared] of what a fit leaves because the reference does not show
        it."""
        frequency = np.linspace(0, self.rate / 2, _LINES)[1:]
        model = self.axis_model(effects)
        sensor = AxisModel(model.core, tuple(e for e in model.effects if not e.of_reference))
        density = sum(e.unknown_density(frequency) for e in model.effects if e.of_reference)
        if self.passed_on:
            density = density + self.passed_on.density(frequency)
        gain = np.abs(sensor.transfer_function(2j * np.pi * frequency))
        return float(np.mean(gain**2 * density) * self.rate / 2)

    def _kept_off(self, effects):
        """What a fit leaves less as it keeps noise of the reference, which the record shows, from
        the output: that speaks for no filter."""
        if not self.passed_on:
            return 0.0
        if self._passed is None:
            self._passed = self.by_reference({})
        return self.count * max(self._passed - self.by_reference(effects), 0.0)

    @functools.cached_property
    def _level(self):
        """RMS of the output, gravity with it."""
        return float(np.sqrt(np.mean(self.measured[self.used]**2)))

    def _require_bound(self, simulated):
        """Refuse an output that is out of all proportion: one that only begins to grow beyond all
        numbers would spoil every product."""
        if not np.max(np.abs(simulated)) < _UNBOUND * max(np.max(np.abs(self.measured)), 1e-300):
            raise FracAccelError("the motion has no bound")

    def cost(self, effects, rough=False):
        """Cost of these causes with the parameters that they have; infinite without a bound."""
        try:
            return self.point(effects, rough).cost
        except FracAccelError:
            return np.inf

    def slopes(self, fit):
        """Derivatives of the output by the unknowns of a fit, shape (n, p)."""
        point, theta = fit.whole, fit.theta
        columns = np.zeros((len(self.record), len(theta)))
        forced = any(map(acts_on_spring, point.effects.values()))
        pathed = any(map(follows_path, point.effects.values()))
        steps = _STEPS_OF_SLOPES if forced or pathed else _STEPS
        before = point.simulated
        model = self.axis_model(point.effects)
        crossed = any(effect.mixes_outputs for effect in model.effects)
        if forced and (crossed or not fit.rough):
            try:
                before = self.simulate(point.effects, False, steps)
            except FracAccelError:
                # with fewer steps a motion at its limit has no bound
                steps = _STEPS
                before = self.simulate(point.effects, False, steps)
        elif pathed:
            before = self.simulate(point.effects, not forced, steps)
        # a first trial may leave out a few per cent of a column
        alone = crossed and fit.rough and not forced and self._hardly_crossed(point.effects)
        before_alone = self.simulate(point.effects, False, steps) if alone else before
        for i, unknown in enumerate(fit.unknowns):
            sides = []
            for step in (unknown.step, -unknown.step):
                moved = theta.copy()
                moved[i] = np.clip(theta[i] + step, unknown.low, unknown.high)
                if moved[i] == theta[i]:
                    continue
                try:
                    new = self.replaced(point.effects, fit.unknowns, moved)
                    effect = new[unknown.cause]
                    if forced and (effect.mixes_outputs or not (
                            fit.exact or effect.stage > CORE or acts_on_spring(effect))):
                        change = self.change(point.effects, unknown.cause, effect)
                    else:
                        # with forces, what comes across stays as it is: a few per cent of a column
                        across = not forced and not (alone and not effect.mixes_outputs)
                        change = self.simulate(new, across, steps) \
                            - (before if across or forced else before_alone)
                    self._require_bound(change)
                except FracAccelError:
                    continue
                free = self.free_columns(new)
                if free is not point.columns and free.count == point.columns.count:
                    change = free.add_to(change.copy(), point.left)
                    point.columns.add_to(change, -point.left)
                sides.append((moved[i] - theta[i], change))
                if not unknown.jumps:
                    break
            if len(sides) == 2:
                (up, more), (down, less) = sides
                columns[:, i] = (more - less) / (up - down)
            elif sides:
                columns[:, i] = sides[0][1] / sides[0][0]
        return self.clear(columns, point.free)

    def jump_std(self, fit, unknown, peak):
        """Standard uncertainty of an instant at which something jumps, by the cost around it.

        A quarter of the range in which the cost stays within four variances of the noise, times
        the `peak` of its density; at least that of an instant between two samples.
        """
        limit = fit.cost * (1 + 4 * peak / self.count)
        here, width = getattr(fit.effects[unknown.cause], unknown.name), 0.0
        for side in (-1, 1):
            away = 0.5 / self.rate
            while away < self.time[-1]:
                moved = dataclasses.replace(fit.effects[unknown.cause],
                                            **{unknown.name: max(here + side * away, 0.0)})
                point = self.point({**fit.effects, unknown.cause: moved}, False)
                if point.cost > limit:
                    break
                away *= 1.5
            width += away
        return max(width / 4, 1 / (np.sqrt(12) * self.rate))

    def replaced(self, effects, unknowns, theta):
        """Effects with the values of the unknowns."""
        values = {}
        for unknown, value in zip(unknowns, theta):
            values.setdefault(unknown.cause, {})[unknown.name] = _from_theta(value, unknown)
        return {cause: dataclasses.replace(effect, **values.get(cause, {}))
                for cause, effect in effects.items()}

    def unknowns(self, effect):
        """Unknowns of one effect."""
        if effect.read_off:
            return []
        names = effect.fitted_parameters(AXES[self.axis], self.excited)
        return [self._unknown(effect, field) for field in parameter_fields(type(effect))
                if field.name in names]

    def within(self, effect, name, value):
        """The value nearest to one that a parameter of an effect may have, if it is fitted."""
        for unknown in self.unknowns(effect):
            if unknown.name == name and not unknown.logarithmic:
                return np.clip(value, unknown.low * unknown.scale, unknown.high * unknown.scale)
        return value

    def _unknown(self, effect, field):
        limits = field.metadata
        scale = self.scales.of(field, getattr(effect, field.name))
        lows = [limits[key] for key in ("above", "minimum") if limits[key] is not None]
        highs = [limits[key] for key in ("below", "maximum") if limits[key] is not None]
        low, high = max(lows, default=-np.inf), min(highs, default=np.inf)
        logarithmic = limits["above"] == 0 and limits["below"] is None
        if logarithmic:
            least, most = self.scales.reach(field, scale)
            low, high = np.log(least), np.log(min(high, most))
        else:
            if limits["reach"]:
                least, most = self.scales.reach(field, scale)
                low, high = max(low, least), min(high, most)
            low, high = low / scale, high / scale
            span = 1e-3 * min(1.0, high - low) if np.isfinite(high - low) else 0.0
            low, high = low + span, high - span
        return Unknown(effect.cause, field.name, logarithmic, scale, low, high,
                       limits["step"] or _STEP, limits["jumps"])

    @functools.cached_property
    def scales(self):
        """What is small or large in this record."""
        return Scales(float(np.std(self.measured[self.used])), self.rate, float(self.time[-1]))

    def mixing(self, effects):
        """How much of each axis is in each other one, by least squares on the model in use with
        what these effects say of all axes.

        Matrix, shape (3, 3): row i has the shares of the axes' simulated outputs in the measured
        axis i, NaN where either does not move; and the standard uncertainties as for white noise.
        """
        links = tuple(effect for effect in self.others.common(effects).values()
                      if acts_before(effect) or effect.pure_delay_s())
        return kept(self._mixings, links, self._mixing, links, most=2)

    def _mixing(self, links):
        moving = [axis for axis in range(3) if np.ptp(self.record.reference[:, axis])]
        shares, stds = np.full((2, 3, 3), np.nan)
        columns = [self.response(axis, links)[self.used] for axis in moving]
        basis = np.stack([*columns, np.ones(self.count)], axis=1)
        inverse = np.linalg.pinv(basis.T @ basis)
        for axis in range(3):
            measured = self.record.sensor[self.used, axis]
            if np.ptp(measured):
                found = inverse @ (basis.T @ measured)
                noise = np.var(measured - basis @ found)
                shares[axis, moving] = found[:-1]
                stds[axis, moving] = np.sqrt(noise * np.diag(inverse)[:-1])
        return shares, stds

    @functools.cached_property
    def excited(self):
        """By axis, whether the reference moves along it."""
        return {name: bool(np.ptp(self.record.reference[:, i])) for i, name in enumerate(AXES)}


def _holds(effect, model):
    """Whether an effect's force holds the mass of a model's core at rest."""
    return acts_on_spring(effect) and effect.add_force(
        StaticForce(core=model.effective_core)).friction_level != 0


def acts_on_spring(effect):
    """Whether an effect changes the force of the core's spring."""
    return type(effect).add_force is not Effect.add_force


def follows_path(effect):
    """Whether what an effect does depends on the path that the motion has taken."""
    return type(effect).change_motion is not Effect.change_motion


def _to_theta(value, unknown):
    return np.log(value) if unknown.logarithmic else value / unknown.scale


def _from_theta(value, unknown):
    return float(np.exp(value)) if unknown.logarithmic else float(value * unknown.scale)


def _normal(fit):
    """Products of the derivatives among themselves and with the residual."""
    return fit.jacobian.T @ fit.jacobian, fit.jacobian.T @ fit.residual


def _step(gram, slope, damping, least, most):
    """Step of the damped least squares within bounds; none where the derivatives say nothing."""
    sizes = (1 + damping) * np.diag(gram)
    scale = np.sqrt(np.where(sizes > 0, sizes, 1.0))
    damped = (gram + damping * np.diag(np.diag(gram))) / np.outer(scale, scale)
    sizes, vectors = np.linalg.eigh(damped)
    root = np.sqrt(np.maximum(sizes, max(_SINGULAR * sizes[-1], 1e-300)))
    right = np.where(sizes > _SINGULAR * sizes[-1], vectors.T @ (slope / scale) / root, 0.0)
    return lsq_linear(root[:, None] * vectors.T, right, (least * scale, most * scale),
                      method="bvls").x / scale
