"""Where the fit of each cause begins (to be moved to the causes)."""

from typing import NamedTuple

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.ndimage import uniform_filter1d

from ..effects import known_effects


class Start(NamedTuple):
    """Where the fit of a cause may begin.

    Attributes
    ----------
    effect : Effect
    columns : tuple of Effect
        Changes that are screened together, as if the output were linear in them.
    kind : str
        ``free``: the output is nearly linear in `parameter`, of either sign; ``positive``: the
        same, but it cannot be negative; ``finite``: the effect counts as it is; ``weak``: as it is
        or weaker.
    parameter : str or None
        What a screened factor scales.
    """

    effect: object
    columns: tuple
    kind: str
    parameter: str | None = None


def starts(cause, view):
    """List of Start of one cause."""
    return _STARTS[cause](known_effects()[cause], view)


def _free(effect, parameter=None):
    return Start(effect, (effect,), "free", parameter)


def _positive(effect, parameter=None):
    return Start(effect, (effect,), "positive", parameter)


def _finite(effect):
    return Start(effect, (effect,), "finite")


def _grid(effects):
    """Starts over a grid whose last effect is the weakest."""
    *stronger, weakest = effects
    return [*map(_finite, stronger), Start(weakest, (weakest,), "weak")]


def _core_shift(cls, view):
    core = view.core
    f, z = core.natural_frequency_hz, core.damping_ratio
    both = cls(f * 1.003, z * 1.01)
    return [Start(both, (cls(f * 1.003, z), cls(f, z * 1.01)), "free")]


def _fractional(cls, view):
    z, order = view.core.damping_ratio, view.core.damping_order
    result = []
    for shift in (-0.8, -0.5, -0.25, -0.05, 0.05, 0.25, 0.5, 0.8):
        new = order + shift
        if 0.05 < new < 1.95:
            result.append(Start(cls(new, z), (cls(new, z), cls(new, z * 1.05)), "free"))
    return result


def _mounting(cls, view):
    grid = view.rate * np.geomspace(0.02, 3.0, 18)
    # one that rings shows in the residual, between the points of any grid
    peaks = _peaks(view)
    return [start for z in (0.07, 0.2, 0.6) for start in _grid([cls(f, z) for f in grid])] \
        + [_finite(cls(f, z)) for f in peaks for z in (0.02, 0.06)]


def _peaks(view, count=3):
    """Frequencies [Hz] of the highest peaks of the residual's smoothed spectrum."""
    power = np.abs(rfft(view.residual))**2
    width = max(3, len(power) // 400)
    smooth = uniform_filter1d(power, width)
    inner = smooth[1:-1]
    tops = 1 + np.flatnonzero((inner > smooth[:-2]) & (inner >= smooth[2:]))
    found = []
    for top in tops[np.argsort(smooth[tops])[::-1]]:
        if top > 2 * width and all(abs(top - other) > 2 * width for other in found):
            found.append(top)
        if len(found) == count:
            break
    return [top * view.rate / len(view.residual) for top in found]


def _delay(cls, view):
    lag = bulk_shift(view.simulated, view.measured, view.used)
    delay = view.delay_s
    result = [_free(cls(delay + 0.1 / view.rate))]
    if lag:
        result.append(_finite(cls(delay + lag / view.rate)))
    return result


def bulk_shift(simulated, measured, used):
    """Whole samples by which the measured signal is later than the simulated."""
    n = len(simulated)
    length = next_fast_len(2 * n, real=True)
    shared = irfft(np.conj(rfft((simulated - simulated[used].mean()) * used, length))
                   * rfft((measured - measured[used].mean()) * used, length), length)
    lags = np.r_[0:n // 4, -(n // 4):0]
    return int(lags[np.argmax(shared[lags])])


def _tone(cls, view):
    values = view.residual - view.residual[view.used].mean() * view.used
    n = len(values)
    spectrum = rfft(values * np.hanning(n))
    power = np.abs(spectrum)**2
    power[:3] = 0
    peak = int(np.argmax(power[:-1]))
    if peak < 3:
        return []
    a, b, c = np.log(power[peak - 1:peak + 2] + 1e-300)
    place = peak + 0.5 * (a - c) / (a - 2 * b + c)
    frequency = place * view.rate / n
    wave = 2 * np.pi * frequency * view.time
    basis = np.stack([np.sin(wave), np.cos(wave)], axis=1) * view.used[:, None]
    s, c = np.linalg.lstsq(basis, values, rcond=None)[0]
    return [_finite(cls(frequency, float(np.hypot(s, c)), float(np.arctan2(c, s))))]


def _hysteresis(cls, view):
    return [_positive(cls(0.02, b / view.level, g * b / view.level), "strength")
            for b in (0.3, 1.0, 3.0) for g in (-0.4, 0.4)]


def _cross(cls, view):
    others = [axis for axis in "xyz" if view.excited[axis] and axis != view.axis]
    return [Start(cls(**dict.fromkeys(others, 1e-3)), tuple(cls(**{a: 1e-3}) for a in others),
                  "free")] if others else []


_STARTS = {
    "sensitivity_error": lambda cls, view: [_free(cls(1.01)), _finite(cls(-1.0))],
    "offset": lambda cls, view: [_free(cls(0.01 * view.level), "offset")],
    "core_parameter_shift": _core_shift,
    "time_delay": _delay,
    "clock_skew": lambda cls, view: [_free(cls(1.0), "skew_ppm"), _finite(cls(100.0)),
                                     _finite(cls(-100.0))],
    "ac_coupling": lambda cls, view: _grid(
        [cls(f) for f in view.rate * np.geomspace(5e-2, 2e-6, 18)]),
    "low_pass_lag": lambda cls, view: _grid(
        [cls(f) for f in view.rate * np.geomspace(0.02, 20, 13)]),
    "mounting_resonance": _mounting,
    "fractional_damping": _fractional,
    "cross_axis_sensitivity": _cross,
    "cubic_stiffness": lambda cls, view: [_free(cls(1e-3 / view.level**2), "alpha3")],
    "quadratic_stiffness": lambda cls, view: [_free(cls(1e-3 / view.level), "alpha2")],
    "dead_zone": lambda cls, view: [_positive(cls(w * view.level), "half_width")
                                    for w in (0.01, 0.05, 0.2)],
    "coulomb_friction": lambda cls, view: [_positive(cls(0.01 * view.level), "level")],
    "hysteresis": _hysteresis,
    "gain_drift": lambda cls, view: [_free(cls(1e-3), "rate_per_s")],
    "temperature_sensitivity": lambda cls, view: [_free(cls(1e-4), "coefficient_per_k")]
    if view.warms else [],
    "tone_interference": _tone,
}
CAUSES = tuple(_STARTS)
