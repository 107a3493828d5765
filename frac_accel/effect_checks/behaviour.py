"""What a cause does: finite, gone at its null value, in blocks of any size, undone by inversion."""

import dataclasses

import numpy as np

from ..errors import DesignError, FracAccelError
from ..model import SensorModel
from ..model.effects.base import Effect
from ..model.parameters import is_varied, parameter_fields
from ..signals.metrics import interpolate
from ..simulation import simulate
from ..streaming import Corrector
from .draws import BAND, CORE, RATE, Broken, core_for, scale_of, sensor_with, words

# Draws of each check.
_EXTREMES, _NULLS, _CUTS, _INVERSES = 12, 3, 3, 3
# Draws among which so many inverses must be feasible.
_DESIGNS = 20
# Distances from the null value at which the output is compared [scales], and the largest change
# [share of the output's RMS] that may be left at the last.
_DISTANCES = (1e-2, 1e-4, 1e-7)
_GONE = 1e-4
# Error after inversion of samples, beside the stated uncertainty [share of the signal's RMS], and
# by how many stated standard deviations it may lie beyond (an even distribution ends at 1.7).
_ROUNDING, _SIGMAS = 1e-9, 3.0
# Error of the corrected motion, beside the stated uncertainty [share of its RMS], and its samples.
_CORRECTED, _LONG = 5e-3, 4000
# A force makes harmonics beyond the band: share of what it does that may be left [of the error
# without it].
_FORCED = 0.25

_ON_SAMPLES = ("simulate", "invert", "live", "simulate_axes", "invert_axes")
_ON_MOTION = ("transfer_function", "pure_delay_s", "clock_ratio", "change_core", "add_force",
              "change_motion", "share_of_axes")


def stays_finite(cls, draws):
    """Outputs, or an error in words, over all that the parameters may be."""
    n = 300
    for _ in range(_EXTREMES):
        effect = draws.any(cls)
        reference, there = draws.motion(n), draws.circumstances(n)
        output = _simulated(effect, reference, there.temperature_c)
        if output is not None and not np.isfinite(output).all():
            raise Broken(f"not finite: the simulated output with {words(effect)}")
        try:
            found = sensor_with(effect).live_inverse(RATE)(
                draws.values(n), np.full((n, 3), 1e-6), there)
        except FracAccelError:
            continue
        except Exception as error:
            raise Broken(_raised(error, "inversion", effect)) from None
        if not all(np.isfinite(part).all() for part in found) or np.any(found[1] < 0):
            raise Broken(f"not finite, or a variance below 0: inversion with {words(effect)}")


def _simulated(effect, reference, temperature_c, model=None):
    """Output, or None where the package says in words that there is none."""
    model = model or sensor_with(effect)
    try:
        return simulate(model, reference, RATE, temperature_c=temperature_c)
    except FracAccelError:
        return None
    except Exception as error:
        raise Broken(_raised(error, "simulation", effect)) from None


def _raised(error, of, effect):
    return f"{of} with {words(effect)} raises {type(error).__name__}: {error}"


def vanishes_at_null(cls, draws):
    """The output tends to that without the cause as its parameters tend to their null values."""
    fields = [field for field in parameter_fields(cls)
              if is_varied(field) and field.metadata["null"] is not None]
    if not fields:
        return
    n = 600
    for _ in range(_NULLS):
        effect, reference = draws.usual(cls), draws.motion(n)
        temperature = draws.circumstances(n).temperature_c
        without = _simulated(effect, reference, temperature, SensorModel(core_for(effect)))
        for distance in _DISTANCES:
            near = dataclasses.replace(effect, **{
                field.name: _near_null(field, distance) for field in fields})
            output = _simulated(near, reference, temperature)
            if output is None:
                raise Broken(f"cannot be simulated near its null value, with {words(near)}")
            change = float(np.std(output - without) + abs(np.mean(output - without)))
        if not change < _GONE * np.std(without):
            raise Broken(f"near its null value ({words(near)}) it still changes the output by "
                         f"{change / np.std(without):.2g} of its RMS")


def _near_null(field, distance):
    null, limits = field.metadata["null"], field.metadata
    if null == "core":
        return getattr(CORE, field.name) * (1 + distance)
    if np.isinf(null):
        return float(np.copysign(scale_of(field) / distance, null))
    moved = null + distance * scale_of(field)
    tops = [limits[key] for key in ("below", "maximum") if limits[key] is not None]
    return moved if not tops or moved < min(tops) else null - distance * scale_of(field)


def ignores_blocks(cls, draws):
    """Simulation and inversion of a stream are the same to the bit however it is cut."""
    n = 400
    for _ in range(_CUTS):
        effect, values, there = draws.usual(cls), draws.values(n), draws.circumstances(n)
        model = sensor_with(effect)
        variance = 1e-4 * draws.rng.random((n, 3))
        for of, start, columns in (("simulation", model.live_simulation, (values,)),
                                   ("inversion", model.live_inverse, (values, variance))):
            given = [column.copy() for column in columns]
            try:
                whole = _run(start(RATE), columns, there, [0, n])
                parts = _run(start(RATE), columns, there, draws.cuts(n))
            except Exception as error:
                raise Broken(_raised(error, of, effect)) from None
            if any(np.any(one != other) for one, other in zip(given, columns)):
                raise Broken(f"{of} changes the samples that it is given")
            if any(part.shape != (n, 3) for part in (*whole, *parts)):
                raise Broken(f"{of} gives back another number of samples than it is given")
            for one, other in zip(whole, parts):
                if not np.array_equal(one, other, equal_nan=True):
                    raise Broken(
                        f"{of} depends on how a stream is cut into blocks, by up to "
                        f"{np.nanmax(np.abs(one - other)):.2g} with {words(effect)}: what it "
                        "remembers belongs into `live`")


def _run(step, columns, there, edges):
    """Results of consecutive blocks, joined: one array or two, each (n, 3)."""
    parts = []
    for start, stop in zip(edges[:-1], edges[1:]):
        block = slice(start, stop)
        found = step(*(column[block] for column in columns),
                     type(there)(there.time_s[block], there.temperature_c[block]))
        parts.append(found if isinstance(found, tuple) else (found,))
    return tuple(np.concatenate(joined) for joined in zip(*parts))


def inverts_samples(cls, draws):
    """What acts on samples is undone, as far as the stated variance and the limits allow."""
    # samples alone do not show what depends on the motion between them
    if not _overrides(cls, _ON_SAMPLES) or _overrides(cls, ("change_motion",)):
        return
    n = 2000
    for _ in range(_INVERSES):
        effect, values, there = draws.usual(cls), draws.values(n), draws.circumstances(n)
        model = sensor_with(effect)
        low, high = model.limits
        output = model.live_simulation(RATE)(values, there)
        found, variance = model.live_inverse(RATE)(output, np.zeros((n, 3)), there)
        # of a sample at a limit no more is known than that
        inside = (output > low) & (output < high)
        error = np.sqrt(np.mean((found - values)[inside]**2)) if inside.any() else 0.0
        stated = np.sqrt(np.mean(variance[inside])) if inside.any() else 0.0
        if not error <= _ROUNDING * np.std(values) + _SIGMAS * stated:
            raise Broken(f"inversion leaves an error of {error:.2g} with {words(effect)}, where "
                         f"its variance states {stated:.2g}")


def inverts_motion(cls, draws):
    """A link, clock, core or force is undone by the corrector, on a motion in its band."""
    if cls.of_reference or not _overrides(cls, _ON_MOTION):
        return
    feasible, refusal = 0, "no inverse reaches the band of the motion"
    for _ in range(_DESIGNS):
        effect, temperature = draws.usual(cls), draws.circumstances(1).temperature_c[0]
        model = SensorModel(core_for(effect), [effect])
        try:
            corrector = Corrector(model, RATE)
        except DesignError as failure:
            refusal = str(failure)
            continue
        low = 2 * max(axis.band_hz[0] for axis in corrector.design.axes) / RATE
        high = 0.9 * min(axis.band_hz[1] for axis in corrector.design.axes) / RATE
        if high < BAND[1] or low > BAND[1] / 4:
            continue
        reference = draws.motion(_LONG, max(low, BAND[0]))
        output = _simulated(effect, reference, temperature, model)
        if output is None:
            continue
        if model.needs_temperature:
            corrector.set_temperature(temperature)
        error, stated = _left(corrector, reference, output)
        if not error < _CORRECTED + _SIGMAS * stated:
            before, _ = _left(Corrector(SensorModel(core_for(effect)), RATE), reference, output)
            if error < _FORCED * before and _overrides(cls, ("add_force",)):
                feasible += 1
                continue
            raise Broken(f"the corrected motion is wrong by {error:.2%} of its RMS with "
                         f"{words(effect)} (without the cause in the model by {before:.2%}), where "
                         f"its variance states {stated:.2%}")
        feasible += 1
        if feasible >= _INVERSES:
            return
    raise Broken(f"only {feasible} of {_DESIGNS} draws can be simulated and inverted: {refusal}")


def _left(corrector, reference, output):
    """Error of the corrected motion and its stated uncertainty [shares of its RMS], worst axis."""
    stamps_ns = np.arange(len(reference)) * round(1e9 / RATE)
    corrected = corrector.process(stamps_ns, output, np.full_like(output, 1e-12))
    expected = interpolate(stamps_ns, reference, corrected.stamps_ns, RATE)
    usable = np.isfinite(expected).all(axis=1)
    sizes = [np.mean(part[usable], axis=0) for part in (
        (corrected.values - expected)**2, corrected.variance, expected**2)]
    worst = np.argmax(sizes[0] / sizes[2])
    return tuple(float(np.sqrt(size[worst] / sizes[2][worst])) for size in sizes[:2])


def _overrides(cls, names):
    return any(getattr(getattr(cls, name), "__func__", getattr(cls, name))
               is not getattr(getattr(Effect, name), "__func__", getattr(Effect, name))
               for name in names)
