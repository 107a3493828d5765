"""Where the fit of a cause begins: what `Effect.starts` is made of.

scipy is imported where it is used: a running corrector loads the effects, but starts no fit.
"""

import dataclasses
import math
from typing import NamedTuple

import numpy as np

# Sampling rates at which a core's resonance is nowhere in a record.
_FAR_BEYOND = 10.0
# Longest segment of an averaged spectrum, and the largest delay that is tried beside a link
# [samples].
_LONGEST_SEGMENT = 1024
_MOST_DELAY = 8
# Segments of a spectrum for low frequencies, and the coherence from which on motion is common.
_SEGMENTS, _MOSTLY = 16, 0.5
# Segments whose lags are to lie on a line over time, the largest growth of such a lag, and parts of
# a sample that it is told to.
_LINES, _FASTEST_DRIFT, _FINER = 16, 2e-3, 4
# Share of the output that a fit leaves from which the motion may differ so much from the linear one
# that a force is sought in the equation of motion; and share of that equation's error that it may
# leave to be worth a simulation.
_STRONG, _MOSTLY_FORCE = 0.1, 0.5
# Shares of the Nyquist frequency between which the equation of motion is faded out, and factor by
# which a motion is refined before its powers are taken, which fold otherwise.
_FADED, _REFINED = (0.6, 0.95), 2
# Samples that must count on either side of an instant at which something is to have changed.
_SIDE = 32
# Share of a record at either end in which a change cannot be told from one that was always there.
_END = 0.05


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
        or weaker; ``whole``: as it is, by a simulation and not to first order.
    parameter : str or None
        What a screened factor scales.
    lag_s : float
        What a delay that is there already has to take on [s], where there is one: before, it may
        have stood for that of this effect.
    core : Oscillator or None
        What the sensor's core is beside this effect, where a fit may move it: before, it may have
        been bent by the lack of it.
    """

    effect: object
    columns: tuple
    kind: str
    parameter: str | None = None
    lag_s: float = 0.0
    core: object = None


def free(effect, parameter=None):
    """Start of a cause that the output is nearly linear in."""
    return Start(effect, (effect,), "free", parameter)


def positive(effect, parameter=None):
    """The same for a parameter that cannot be negative."""
    return Start(effect, (effect,), "positive", parameter)


def finite(effect):
    """Start of a cause whose effect counts as it is."""
    return Start(effect, (effect,), "finite")


def grid(effects):
    """Starts over a grid whose last effect is the weakest."""
    *stronger, weakest = effects
    return [*map(finite, stronger), Start(weakest, (weakest,), "weak")]


def of_orders(averages, orders, most):
    """Moving averages of other orders, up to the highest, with the same curvature at low
    frequencies: lengths as 1 over the order's square root."""
    return [dataclasses.replace(averages, order=order,
                                length_s=averages.length_s * math.sqrt(averages.order / order))
            for order in orders if 1 <= order <= most]


class EquationOfMotion:
    r"""A sensor's equation of motion along the measured output, as linear least squares.

    It is explicit in the output q, so with

    .. math:: q = S a - c_1 q' - c_2 q'' - \alpha q^k - b

    the core and the coefficient of a force are found together, however strong that is: no
    simulation is needed, and no core that is nearly right. The error of that equation is the
    output's, filtered by the core's inverse; filtered by the response of the core that is known, it
    counts nearly as that of the output does.

    Parameters
    ----------
    view : diagnosis.search.View
    """

    def __init__(self, view):
        from ...signals.convolution import Convolution
        self._view = view
        used, core = view.used, view.core
        output, simulated = view.measured - view.offset, view.simulated - view.offset
        self._output, filtered = output, Convolution(output, view.rate)
        s = filtered.s
        place = np.abs(s.imag) / (np.pi * view.rate)
        faded = np.cos(np.pi / 2 * np.clip((place - _FADED[0]) / np.ptp(_FADED), 0, 1))**2
        u = s / (2 * np.pi * core.natural_frequency_hz)
        self._response = faded * core.transfer_function(s) / core.sensitivity
        decays = [np.exp(pole * view.time) for pole in core.poles() if pole.imag >= 0]
        # what the record's start and a constant force leave is free
        free = [np.ones(len(output)), *(part for decay in decays
                                        for part in (decay.real, decay.imag) if np.any(part))]
        self._span = np.linalg.qr(np.array(free).T[used])[0]
        driven, speed, acceleration, self._left = self._clear(
            Convolution(simulated, view.rate).response(faded)[used],
            *(-filtered.response(power * self._response)[used] for power in (u**core.damping_order,
                                                                            u * u)),
            filtered.response(self._response)[used])
        self._own = np.array([1.0, 2 * core.damping_ratio, 1.0])
        columns = np.stack([driven, speed, acceleration], axis=1)
        self._open = np.array(["sensitivity" in view.open_core, *[
            {"natural_frequency_hz", "damping_ratio"} <= view.open_core] * 2])
        self._left = self._left - columns[:, ~self._open] @ self._own[~self._open]
        self._columns = columns[:, self._open]

    def _clear(self, *columns):
        return [column - self._span @ (self._span.T @ column) for column in columns]

    def with_power(self, power):
        """The core, and the coefficient of a force by a power of the motion, beside it.

        Returns
        -------
        tuple of Oscillator and float, or None
            None where the force does not take most of the equation's error.
        """
        from ...signals.convolution import Convolution
        view, core = self._view, self._view.core
        force, = self._clear(-Convolution(_power(self._output, power), view.rate)
                             .response(self._response)[view.used])
        errors = []
        for columns in (self._columns, np.c_[self._columns, force]):
            scale = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
            found = np.linalg.lstsq(columns / scale, self._left, rcond=None)[0] / scale
            errors.append(np.linalg.norm(self._left - columns @ found))
        values = self._own.copy()
        values[self._open] = found[:-1]
        if not errors[1] < _MOSTLY_FORCE * errors[0] or not np.all(values > 0):
            return None
        gained, damping, inertia = values.tolist()
        # with u = s / omega_0 the inertia is 1 where the frequency is right
        slower = math.sqrt(inertia)
        gain = gained * view.gain
        return dataclasses.replace(
            core, natural_frequency_hz=core.natural_frequency_hz / slower,
            damping_ratio=damping / 2 / slower**core.damping_order,
            sensitivity=gain * core.sensitivity), float(found[-1]) * gain**(power - 1)


def _power(values, power):
    """Power of a band-limited signal, without what folds."""
    from scipy.fft import irfft, next_fast_len, rfft
    n = len(values)
    length = next_fast_len(n + n // 8, real=True)
    before = (length - n) // 2
    padded = np.pad(values, (before, length - n - before), mode="reflect", reflect_type="odd")
    fine = irfft(rfft(padded), _REFINED * length) * _REFINED
    return irfft(rfft(fine**power)[:length // 2 + 1], length)[before:before + n] / _REFINED


def by_equation(view, cause, power):
    """Start of a force by a power of the motion, as the equation of motion says it.

    Parameters
    ----------
    view : diagnosis.search.View
    cause : type of Effect
        Its one parameter is the force's coefficient.
    power : int

    Returns
    -------
    list of Start
        None where the motion is nearly linear, or such a force does not explain most of what is
        left.
    """
    if not view.is_motion or not is_far(view):
        return []
    try:
        found = view.equation.with_power(power)
    except ArithmeticError:
        return []  # a core at the end of what is searched, whose poles are no numbers
    if found is None:
        return []
    core, coefficient = found
    effect = cause(coefficient)
    return [Start(effect, (effect,), "whole", core=core)]


def bulk_shift(simulated, measured, used):
    """Whole samples by which the measured signal is later than the simulated."""
    from scipy.fft import irfft, next_fast_len, rfft
    n = len(simulated)
    length = next_fast_len(2 * n, real=True)
    shared = irfft(np.conj(rfft((simulated - simulated[used].mean()) * used, length))
                   * rfft((measured - measured[used].mean()) * used, length), length)
    lags = np.r_[0:n // 4, -(n // 4):0]
    return int(lags[np.argmax(shared[lags])])


def drifting_lags(view):
    """Lags that grow evenly with time, with which measured and simulated signals agree most.

    The correlations of some segments, of the signals' slopes, are summed along straight lines of
    lag over time (J. Illingworth, J. Kittler, *Comput. Vision Graph. Image Process.* 44 (1988)
    87-116): one segment alone may agree best a period of its motion away.

    Returns
    -------
    list of tuple of float
        Growth of the lag [1] and lag at the record's start [s]: of lines that begin at none, and
        of any. Empty where there are too few samples.
    """
    from scipy.fft import irfft, next_fast_len, rfft
    count = len(view.measured)
    size = count // _LINES
    most = min(size // 3, max(4, int(_FASTEST_DRIFT * count)))
    if most < 4:
        return []
    length, reach = next_fast_len(size + most, real=True), _FINER * most
    lags = np.arange(-reach, reach + 1)
    shared = np.zeros((_LINES, len(lags)))
    for row, start in zip(shared, range(0, _LINES * size, size)):
        rows = slice(start, start + size)
        one, other = (rfft(np.diff(values[rows]) * view.used[rows][1:], length)
                      for values in (view.simulated, view.measured))
        row[:] = irfft(np.conj(one) * other, _FINER * length)[lags]
    middle, found = (np.arange(_LINES) + 0.5) / _LINES, []
    for begins in (np.zeros(1, int), lags[::_FINER]):
        # by the lag of the line at the record's end; of all lines at once it would take tens of MB
        total = np.stack([shared[np.arange(_LINES), reach + np.round(
            begin + (lags[:, None] - begin) * middle).astype(int)].sum(-1) for begin in begins])
        begin, end = np.unravel_index(np.argmax(total), total.shape)
        found.append((float((lags[end] - begins[begin]) / (_FINER * count)),
                      float(begins[begin] / (_FINER * view.rate))))
    return found


def spectral_peaks(view, count=3):
    """Frequencies [Hz] of the highest peaks of the residual's smoothed spectrum."""
    from scipy.fft import rfft
    from scipy.ndimage import uniform_filter1d
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


def is_far(view):
    """Whether a fit leaves so much of the output that nothing near it may describe the record."""
    return bool(np.std(view.residual[view.used]) >= _STRONG * np.std(view.measured[view.used]))


def beyond_band(view):
    """The core as it would be with its resonance far beyond all that is recorded, where a fit may
    move it; else None."""
    if not {"natural_frequency_hz", "damping_ratio"} <= view.open_core:
        return None
    return dataclasses.replace(view.core, natural_frequency_hz=_FAR_BEYOND * view.rate,
                               damping_ratio=math.sqrt(0.5))


def matching(view, links, count=2, response=None, core=None, lost=False):
    """Starts of the linear links that come nearest to what is between simulated and measured.

    Their responses are compared with the averaged ratio of the two, where there is power: as they
    are, and with any gain and a further delay, which another cause may have to give.

    Parameters
    ----------
    view : diagnosis.search.View
    links : list of Effect
    count : int
        How many of either comparison.
    response : callable, optional
        What one of them, given with s, shape (n,) [rad/s], changes of the output, shape (n,);
        default: a link's own response.
    core : Oscillator, optional
        What the sensor's core is beside these links, where a fit may move it.
    lost : bool
        Whether the responses say what the simulated output has of the measured one, and not the
        other way round: where that is little, no ratio to it is known.

    Returns
    -------
    list of Start
    """
    from scipy.signal import csd, welch
    size = min(_LONGEST_SEGMENT, max(64, len(view.measured) // 8))
    simulated = (view.simulated - view.simulated[view.used].mean()) * view.used
    measured = (view.measured - view.measured[view.used].mean()) * view.used
    one, other = (measured, simulated) if lost else (simulated, measured)
    frequency, power = welch(one, view.rate, nperseg=size)
    ratio = csd(one, other, view.rate, nperseg=size)[1] / np.maximum(power, 1e-300)
    strong = power > 1e-6 * power.max()
    strong[0] = False
    s, ratio, weight = 2j * np.pi * frequency[strong], ratio[strong], power[strong]
    if core is not None:
        moved = core.transfer_function(s) / view.core.transfer_function(s)
        ratio, weight = (ratio * moved, weight) if lost else \
            (ratio / moved, weight * np.abs(moved)**2)
    responses = np.array([(response or _response)(link, s) for link in links])
    plain = np.abs(responses - ratio)**2 @ weight
    found = [finite(links[i]) for i in np.argsort(plain)[:count]]
    within = np.linspace(-_MOST_DELAY, _MOST_DELAY, 16 * _MOST_DELAY + 1) / view.rate
    # a delay that is there may stand for that of the link
    for ahead in np.zeros(len(links)), _mean_delays(responses, s, weight):
        others = responses * np.exp(np.outer(ahead, s))
        shared = np.abs(np.real((np.conj(others) * ratio * weight) @ np.exp(np.outer(s, within))))
        explained = np.max(shared, axis=1)**2 / (np.abs(responses)**2 @ weight)
        lags = (within[np.argmax(shared, axis=1)] - ahead) * (-1 if lost else 1)
        found += [finite(links[i])._replace(lag_s=float(lags[i]))
                  for i in np.argsort(-explained)[:count]]
    return found if core is None else [start._replace(kind="whole", core=core) for start in found]


def matching_alone(view, links):
    """The same, and those that come nearest in the place of the dynamics of a core that was
    identified, which may stand for a filter."""
    core = beyond_band(view)
    return matching(view, links) + ([] if core is None else matching(view, links, 1, core=core))


def _mean_delays(responses, s, weight):
    """Delays [s] that come nearest to the phases of some responses, a row each."""
    omega = s.imag
    return -np.unwrap(np.angle(responses), axis=1) @ (weight * omega) / (weight @ omega**2)


def _response(link, s):
    return link.transfer_function(s) * np.exp(-s * link.pure_delay_s())


def coherent_from_hz(view):
    """Frequency [Hz] below which a record shows no common motion; 0 where it shows all of it.

    Half of that above which the two signals are mostly coherent, up to the most of their power.
    """
    from scipy.signal import coherence, csd
    size = max(64, len(view.measured) // _SEGMENTS)
    simulated, measured = ((values - values[view.used].mean()) * view.used
                           for values in (view.simulated, view.measured))
    frequency, shared = coherence(simulated, measured, view.rate, nperseg=size)
    top = int(np.argmax(np.abs(csd(simulated, measured, view.rate, nperseg=size)[1][1:]))) + 1
    alone = np.flatnonzero(shared[1:top] < _MOSTLY)
    # by one line of such a spectrum nothing is told
    return float(frequency[alone[-1] + 1]) / 2 if len(alone) > 1 else 0.0


def strongest_line(view):
    """Frequency [Hz], amplitude and phase [rad] of the residual's strongest line, or None."""
    from scipy.fft import rfft
    values = view.residual - view.residual[view.used].mean() * view.used
    power = np.abs(rfft(values * np.hanning(len(values))))**2
    power[:3] = 0
    peak = int(np.argmax(power[:-1]))
    if peak < 3:
        return None
    before, here, after = np.log(power[peak - 1:peak + 2] + 1e-300)
    place = peak + 0.5 * (before - after) / (before - 2 * here + after)
    frequency = place * view.rate / len(values)
    wave = 2 * np.pi * frequency * (view.since_start_s + view.time)
    basis = np.stack([np.sin(wave), np.cos(wave)], axis=1) * view.used[:, None]
    sine, cosine = np.linalg.lstsq(basis, values, rcond=None)[0]
    return float(frequency), float(np.hypot(sine, cosine)), float(np.arctan2(cosine, sine))


def jumps(view, shape):
    """Where the residual begins to hold more of a shape, or less, and how much.

    The instant is that at which least squares with another factor of the shape on either side gain
    most (cumulative sums, O(n)): D. V. Hinkley, *Biometrika* 57 (1970) 1-17.

    Parameters
    ----------
    view : diagnosis.search.View
    shape : ndarray, shape (n,)

    Returns
    -------
    list of tuple of float
        Instant [s] and change: with the part before it free, and with nothing there. None where
        there are not enough samples.
    """
    shared = np.cumsum(np.where(view.used, view.residual * shape, 0.0))
    power = np.cumsum(np.where(view.used, shape**2, 0.0))
    count = np.cumsum(view.used)
    side = max(_SIDE, _END * count[-1])
    inner = np.flatnonzero((count[:-1] >= side) & (count[-1] - count[:-1] >= side)
                           & (power[:-1] > 0) & (power[:-1] < power[-1]))
    if not len(inner):
        return []
    before = shared[inner] / power[inner]
    after = (shared[-1] - shared[inner]) / (power[-1] - power[inner])
    beyond = power[-1] - power[inner]
    best = inner[np.argmax(before**2 * power[inner] + after**2 * beyond)]
    alone = inner[np.argmax(after**2 * beyond)]
    changes = dict(zip(inner, after - before)), dict(zip(inner, after))
    return [(_after(view, place), float(change[place]))
            for place, change in zip((best, alone), changes)]


def _after(view, place):
    """Instant [s] of the record half an interval after a sample."""
    return float(view.since_start_s + view.time[place] + 0.5 / view.rate)


def jump_between(view, before, after):
    """Instant [s] from which on another error is the smaller one, by least squares; or None."""
    gained = np.cumsum(np.where(view.used, after**2 - before**2, 0.0))
    inner = slice(_SIDE, -_SIDE)
    if len(gained[inner]) == 0:
        return None
    return _after(view, _SIDE + int(np.argmax(gained[inner])))
