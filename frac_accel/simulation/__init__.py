"""Simulation of a sensor model from a sampled reference."""

import copy
import functools
from typing import Any

import numpy as np

from ..errors import FracAccelError, ModelError
from ..io.samples import Samples
from ..model import AXES, SensorModel
from ..model.core import Arx, Gain
from ..model.effects.base import CORE, GAIN, Circumstances
from ..record.sources import is_bag
from ..signals.convolution import Convolution, at_positions, every, exponentials
from ..signals.kept import kept
from ..signals.straight_line import straight_line
from .modes import modes_of

# Samples at both ends that the band-limited simulation of a record cannot know: what the base did
# before and does after, within the reach of its interpolation.
EDGE = 64
# Factor by which the response of a linear sensor is refined before it is read between samples.
_REFINED = 4
# A nonlinear core is stepped this often in each sampling interval, and three times as often in each
# natural period.
_STEPS_PER_SAMPLE = 8
_MOST_STEPS_PER_SAMPLE = 64
# Points in each sampling interval at which a path is followed: a turn of the largest motion must be
# known far better than the smallest play. A coarse simulator follows it at fewer.
_PATH_STEPS = 16
_FEW_PATH_STEPS = 4
# With fewer steps the modes of a fractional memory need not be finer.
_FEW_STEPS = 4
# Steps of a record up to which what a spring and its path make of the motion is kept.
_LONG = 1 << 20
# Frequencies at which links are evaluated at a time.
_BLOCK = 65536
# Where a constant response is seen, and what it must not drown beside [rad/s]: next to nothing,
# since orders below zero and high-passes make s = 0 itself undefined, and all that may be asked.
_CONSTANT_AND_MOVING = np.append(1e-9, 2j * np.pi * np.geomspace(1e-3, 1e5, 200))
# Samples that a response between samples needs after the last one.
_BEYOND = 8


def simulate(model: SensorModel, reference: Any, sampling_rate_hz: float | None = None,
             axis: str | None = None, initial: str = "rest", temperature_c: Any = None,
             start_time_s: float = 0.0) -> Any:
    """Output of a sensor, from the acceleration of its base.

    Parameters
    ----------
    model : SensorModel
    reference : array_like, shape (n, 3) or (n,), or str or Path
        Acceleration [m/s²] at uniform instants; one column needs `axis`. Or a bag, of which the
        default topic of the reference is taken.
    sampling_rate_hz : float, optional
        Needed by an array.
    axis : {"x", "y", "z"}, optional
        The axis of a one-column reference. The other two axes are then at rest.
    initial : {"rest", "steady"}
        Motion before the record: none, or the first sample's value for ever (gravity).
    temperature_c : array_like, shape (n,) or (), optional
        Temperature [°C]; needed by a model with temperature_sensitivity.
    start_time_s : float
        Time of the first sample from the start of the record that drifts and steps count from.

    Returns
    -------
    ndarray, same shape as `reference`, or Samples of a bag
        Output in the sensor's units at the same instants. Lost samples and scattering stamps
        change no value.

    Raises
    ------
    FracAccelError
        If the reference is not finite, empty or of the wrong shape, rate or temperature are
        missing, or the motion of a nonlinear model grows without bound.
    ModelError
        If an ``arx`` core holds at a lower rate than the record's.

    Notes
    -----
    See `AxisSimulator`.

    Examples
    --------
    >>> import numpy as np, frac_accel
    >>> from frac_accel.model.core import Oscillator
    >>> model = frac_accel.SensorModel(Oscillator(200.0, 0.5, sensitivity=2.0))
    >>> steady = frac_accel.simulate(model, np.full(100, 9.81), 1000.0, "x", initial="steady")
    >>> round(float(steady[-1]), 3)
    19.62
    """
    if is_bag(reference):
        return _of_bag(model, reference, initial, temperature_c)
    if sampling_rate_hz is None:
        raise FracAccelError("sampling_rate_hz: missing, expected the rate of the reference in Hz")
    values = np.asarray(reference, float)
    single = values.ndim == 1
    if single:
        if axis not in tuple(AXES):
            raise FracAccelError(f"axis: {axis!r} given for a reference of one column, "
                                 "expected x, y or z")
        column = AXES.index(axis)
        values = np.zeros((len(values), 3))
        values[:, column] = reference
    if values.ndim != 2 or values.shape[1] != 3 or not len(values):
        raise FracAccelError(f"reference: shape {np.shape(reference)} given, expected (n, 3)")
    values = model.along_sensor(values)
    result = np.empty_like(values)
    for i, axis_model in enumerate(model.axes):
        simulator = AxisSimulator(values[:, i], sampling_rate_hz, temperature_c, start_time_s,
                                  initial)
        result[:, i] = simulator.respond(axis_model)
    result = model.live_simulation(sampling_rate_hz)(result, simulator.circumstances)
    return result[:, column] if single else result


def _of_bag(model, bag, initial, temperature_c):
    from ..io.bag import REFERENCE_TOPIC, read_bag
    from ..record.record import UniformSamples
    samples = read_bag(bag, [REFERENCE_TOPIC])[REFERENCE_TOPIC]
    record = UniformSamples.of(samples, f"{bag}: topic {REFERENCE_TOPIC}")
    output = simulate(model, record.values, record.sampling_rate_hz, initial=initial,
                      temperature_c=temperature_c)[record.slot]
    return Samples.of(samples.stamps_ns[record.index], output, frame_id=samples.frame_id)


class AxisSimulator:
    """Simulates models of one axis again and again on the same reference.

    Parameters
    ----------
    reference : array_like, shape (n,)
        Acceleration [m/s²] at uniform instants.
    sampling_rate_hz : float
    temperature_c : array_like, shape (n,) or (), optional
        Temperature [°C].
    start_time_s : float
        Time [s] from the record's start to the first sample: drifts, tones and skewed clocks count
        from there.
    initial : {"steady", "rest"}
        Motion before the first sample: its value for ever (gravity), or none.
    lag_s : float
        Time [s] by which the output's instants are later than the reference's.
    steps_per_sample : int
        Steps of a nonlinear core in each sampling interval. Half as many leave an error about ten
        times as large.
    shown : callable, optional
        What of a nonlinear core's addition shows at the samples; default `sampled`, as in a record
        that no filter has changed.
    only : {None, "linear", "deviation"}
        Only the linear motion of a core, or only what a nonlinear one adds to that.

    Attributes
    ----------
    circumstances : Circumstances
        Times and temperatures of the samples.

    Notes
    -----
    The linear part is the exact convolution with the band-limited reference (`Convolution`). What
    a nonlinear spring does comes on top as a deviation, which the modes of the oscillator
    follow step by step between the samples (`core.nonlinear_motion`), and which then passes
    through the links behind the core. As in a sampled record, harmonics above the Nyquist
    frequency fold back.
    """

    def __init__(self, reference, sampling_rate_hz, temperature_c=None, start_time_s=0.0,
                 initial="steady", steps_per_sample=_STEPS_PER_SAMPLE, lag_s=0.0, shown=None,
                 only=None):
        values = np.asarray(reference, float)
        if values.ndim != 1 or not len(values):
            raise FracAccelError(f"reference: shape {values.shape} given, expected (n,)")
        if not np.isfinite(values).all():
            first = int(np.flatnonzero(~np.isfinite(values))[0])
            raise FracAccelError(f"reference: sample {first} is not finite")
        if not np.isfinite(sampling_rate_hz) or sampling_rate_hz <= 0:
            raise FracAccelError(f"sampling_rate_hz: {sampling_rate_hz} given, expected above 0")
        if initial not in ("rest", "steady"):
            raise FracAccelError(f"initial: {initial!r} given, expected rest or steady")
        self._rate = float(sampling_rate_hz)
        self._n = len(values)
        self._level = values[0] if initial == "steady" else 0.0
        self._moving = values - self._level
        self._still = not self._moving.any()
        self._start_time_s = start_time_s
        self._least_steps = steps_per_sample
        self._lag_s = lag_s
        self._shown, self._only = shown or sampled, only
        self._clear()
        self.circumstances = Circumstances(start_time_s + np.arange(self._n) / self._rate,
                                           _temperature(temperature_c, self._n))

    def simulate(self, axis_model):
        """Output of an `AxisModel`, without the cross-axis part.

        Returns
        -------
        ndarray, shape (n,)

        Raises
        ------
        FracAccelError, ModelError
            As `simulate`.
        """
        values = self.respond(axis_model)
        for effect in axis_model.effects:
            values = effect.live(self._rate).simulate(values, self.circumstances)
        return values

    def respond(self, axis_model):
        """Output of the core and its links, delay and clock: before the effects on the samples."""
        axis_model, on_base = axis_model.behind_base
        if on_base:
            return kept(self._bases, on_base, self._behind, on_base, most=2).respond(axis_model)
        if axis_model.changes_base:
            gain = axis_model.base_gain(self.circumstances.time_s + self._lag_s)
            return self._with_base(gain * (self._moving + self._level))._respond(axis_model)
        return self._respond(axis_model)

    def _behind(self, on_base):
        """Simulator for the base's acceleration behind what is recorded of it."""
        values = self._moving + self._level
        for effect in on_base:
            values = effect.change_base(values, self._rate)
        return self._with_base(values)

    def _with_base(self, reference):
        """The same simulator for another acceleration of the base."""
        return AxisSimulator(reference, self._rate, self.circumstances.temperature_c,
                             self._start_time_s, "steady" if self._level else "rest",
                             self._least_steps, self._lag_s, self._shown, self._only)

    def _respond(self, axis_model):
        result, late_s = self._late(axis_model, 0.0), 0.0
        for at_s, step_s in axis_model.time_steps:
            late_s += step_s
            result = np.where(self.circumstances.time_s >= at_s, self._late(axis_model, late_s),
                              result)
        return result

    def _late(self, axis_model, late_s):
        """Response with a further delay."""
        core = axis_model.effective_core
        if isinstance(core, Arx) and self._rate > core.sampling_rate_hz * (1 + 1e-6):
            raise ModelError(f"core.sampling_rate_hz: the model holds at {core.sampling_rate_hz:g} "
                             f"Hz, the record has {self._rate:g} Hz")
        ratio = axis_model.clock_ratio
        # what the clock is off already at the start is a delay like any other
        delay_s = axis_model.delay_s + late_s - self._lag_s - (ratio - 1) * self._start_time_s
        if ratio != 1:
            return kept(self._clocks, ratio, self._on_clock, ratio, most=2)._at(axis_model, delay_s)
        return self._at(axis_model, delay_s)

    def _on_clock(self, ratio):
        """Simulator for the same motion at the instants of a clock that runs differently."""
        position = ratio * np.arange(self._n)
        count = int(max(position[-1], self._n)) + _BEYOND
        convolution = self._prepared(0.0)
        fine = convolution.response_between(1.0, _REFINED, _REFINED * count)
        other = copy.copy(self)
        other._clear()
        other._rate = self._rate / ratio
        other._moving = at_positions(fine, _REFINED * position)
        return other

    def _at(self, axis_model, delay_s):
        """Response with this delay in all."""
        result = np.zeros(self._n) if self._only == "deviation" \
            else self._linear(axis_model, delay_s)
        force = axis_model.static_force
        if (force or axis_model.path_dependent) and self._only != "linear" \
                and not (self._still and not self._level):
            result += self._deviation(axis_model, force, delay_s)
        return result

    def _linear(self, model, delay_s):
        level = self._level * static_gain(model) if self._level else 0.0
        if self._still:
            return np.full(self._n, level)
        convolution = self._prepared(delay_s)
        transfer = self._transfer(model.dynamics)
        if delay_s:
            s = convolution.s
            transfer = transfer * exponentials(-s[0] * delay_s, -(s[1] - s[0]) * delay_s, len(s))
        response = convolution.response(transfer) + level
        if _lost_slow(model.dynamics):
            _level_out(response[None], self._n, 1.0)
        return response

    def _deviation(self, model, force, delay_s):
        """What the spring's force beyond its linear part adds, and what depends on the path."""
        try:
            from . import nonlinear_motion
        except ImportError as error:
            raise FracAccelError(f"a model with a nonlinear spring or friction needs numba to be "
                                 f"simulated: pip install numba ({error})") from None
        core = model.effective_core
        # the mass of a gain follows its spring at once
        at_once = isinstance(core, Gain)
        natural = 2 * np.pi * core.natural_frequency_hz if force and not at_once else 0.0
        highest = natural / (2 * np.pi) * np.sqrt(1 + force.slope)
        wanted = self._least_steps * max(1.0, 3 * highest / self._rate)
        if model.path_dependent:
            wanted = max(wanted, _PATH_STEPS if self._least_steps >= _FEW_STEPS
                         else _FEW_PATH_STEPS)
        steps = int(np.ceil(min(wanted, _MOST_STEPS_PER_SAMPLE)))
        count = int(max(self._n - 1 - delay_s * self._rate, self._n)) + _BEYOND
        self._prepared(delay_s)
        links = (core, *(effect for effect in model.dynamics[1:] if effect.stage < CORE))
        load = self._level * core.sensitivity if force and not _lost_slow(links) else 0.0
        orders = nonlinear_motion.derivatives_needed(force) + 1 if natural else 1
        known_by = links, natural, orders, steps, count
        motion, modes = kept(self._motions, known_by, self._core_motion, *known_by, most=1)
        start, deviation = 0.0, np.zeros(motion.shape[1])
        if force and at_once:
            deviation = kept(self._deviations, (known_by, force), _bent, force, motion[0], most=3)
        elif force:
            start = force.equilibrium(load) - load
            deviation = kept(self._deviations, (known_by, force), nonlinear_motion.deviation,
                             modes, force, natural / (self._rate * steps), motion, start,
                             natural * self._start_time_s, most=3)
        if not np.isfinite(deviation[-1]):
            raise FracAccelError("the model's motion grows without bound: its nonlinear terms are "
                                 "too large for this record")
        path = known_by, force, tuple(model.path_dependent)
        if model.path_dependent:
            deviation = _kept_of_short(self._paths, path, _changed_by_path, motion[0], deviation,
                                       1 / (self._rate * steps), model.path_dependent)
        if self._level:
            start = deviation[0]
        behind = [effect for effect in model.dynamics[1:] if effect.stage >= CORE]
        moving = deviation - start
        filtering = [effect for effect in behind if effect.stage < GAIN]
        if filtering:
            make = functools.partial(Convolution, oversampled=steps > 1)
            conditioner = _kept_of_short(self._conditioners, path, make, moving, self._rate * steps)
            moving = conditioner.response(_product(filtering, conditioner.s), consumed=True)
        gain = _product([effect for effect in behind if effect.stage >= GAIN], np.array([1j]))
        if start and filtering:
            start *= _static_gain(lambda s: _product(filtering, s))
        moving = self._shown(moving, steps, self._n, steps * self._rate * delay_s)
        return gain[0].real * (moving + start)

    def _core_motion(self, links, natural, orders, steps, count):
        """Linear motion and its derivatives by the time natural * t, shape (orders, n); modes."""
        convolution, transfer = self._convolution, self._transfer(links)
        motion = np.empty((orders, steps * count))
        for order in range(orders):
            motion[order] = convolution.response_between(transfer, steps, steps * count)
            if order < orders - 1:
                transfer = transfer * (convolution.s / natural)
        if _lost_slow(links):
            _level_out(motion, steps * self._n, natural / (self._rate * steps))
        elif self._level:
            motion[0] += self._level * _static_gain(lambda s: _product(links, s))
        if not natural:
            return motion, None
        return motion, modes_of(links[0], self._rate / count,
                                natural + np.pi * self._rate * steps,
                                coarse=self._least_steps < _FEW_STEPS)

    def _transfer(self, links):
        """Composite transfer function of some links, a core first, where the convolution is."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return functools.reduce(np.multiply, [
                kept(self._transfers, link, link.transfer_function, self._convolution.s)
                for link in links])

    def _clear(self):
        self._convolution, self._room_s, self._bases, self._clocks = None, 0.0, {}, {}
        self._forget()

    def _forget(self):
        self._transfers, self._motions, self._deviations = {}, {}, {}
        self._paths, self._conditioners = {}, {}

    def _prepared(self, delay_s):
        """Convolution with room for a delay."""
        if self._convolution is None or abs(delay_s) > self._room_s:
            self._forget()
            self._room_s = max(abs(delay_s), 64 / self._rate)
            self._convolution = Convolution(self._moving, self._rate, self._room_s)
        return self._convolution


def sampled(fine, steps, count, late=0.0):
    """Values at samples, shape (count,), of those at so many steps in each interval; each sample
    may come `late`, by so many of these steps."""
    return every(fine, -late, steps, count) if late else fine[:steps * count:steps]


def _bent(force, motion):
    """What a force adds to a motion that follows at once."""
    return force.at_once(motion) - motion


def _kept_of_short(store, key, make, values, *arguments):
    """What `make` returns, as it was kept where the record is short: a search asks for it often."""
    if len(values) > _LONG:
        return make(values, *arguments)
    return kept(store, key, make, values, *arguments, most=1)


def _changed_by_path(linear, deviation, interval_s, effects):
    """The deviation from a linear motion behind effects that depend on its path."""
    for effect in effects:
        passed = linear + deviation
        deviation = deviation + effect.change_motion(passed, interval_s) - passed
    return deviation


def _lost_slow(links):
    """Whether the reference has lost a constant and a slow drift, before a core."""
    return any(link.of_reference and 0 in link.poles() for link in links[1:])


def _level_out(motion, count, step):
    """Take a straight line through the first `count` points out of a motion, and its slope out of
    the derivative: neither is known, and a spring would take them for a load that grows."""
    place = np.arange(motion.shape[1])
    slope, constant = straight_line(place[:count], motion[0, :count])
    motion[0] -= constant + slope * place
    if len(motion) > 1:
        motion[1] -= slope / step


def static_gain(model):
    """Response to a constant acceleration [output units per m/s²]; 0 behind a high-pass."""
    return _static_gain(model.transfer_function)


def _static_gain(transfer):
    gain, *others = transfer(_CONSTANT_AND_MOVING)
    size = np.abs(others)
    largest = np.max(size[np.isfinite(size)], initial=0.0)
    # without bound where a high-pass is undone: what went before is then not in the record
    bounded = np.isfinite(gain) and abs(gain) < 1e6 * largest
    return float(gain.real) if bounded and abs(gain) > 1e-6 * largest else 0.0


def _product(links, s):
    """Composite transfer function of some links."""
    total = np.ones(len(s), complex)
    # by blocks, of which temporary values are small
    for start in range(0, len(s), _BLOCK):
        lines = slice(start, start + _BLOCK)
        for link in links:
            total[lines] *= link.transfer_function(s[lines])
    return total


def _temperature(values, n):
    if values is None:
        return None
    values = np.asarray(values, float)
    if values.shape not in ((), (n,)) or not np.isfinite(values).all():
        raise FracAccelError(f"temperature_c: shape {values.shape} given, expected one finite "
                             f"number or {n} of them")
    return np.broadcast_to(values, n)
