"""Design of the filter that inverts a sensor's composite linear response (or plays it live)."""

import dataclasses
import functools

import numpy as np

from ..errors import DesignError, FracAccelError, ModelError
from ..model import AXES
from ..model.core import Arx, Gain, Oscillator
from ..model.effects import Circumstances
from .fitting import LOWEST_SHARE, FilterProblem, evaluate
from .parameter_uncertainty import design_parameter_uncertainty
from .static_terms import StaticTermsDesign

# A band ends where the sensor's gain has fallen to this share of its reference gain: the inverse
# multiplies the noise there by five. At the latest it ends at 0.6 of the Nyquist frequency.
GAIN_AT_BAND_EDGE = 0.2
NYQUIST_SHARE = 0.6
# Worst relative error of the complex response in the band, where the user names none.
TOLERANCE = 2e-3
# Without a permitted delay: the shortest whose noise gain is this close to that of a brick wall.
NOISE_EXCESS = 1.3
# Bands that are tried where one cannot be met: shares of its upper end, for that and for the lower.
_NARROWER = (0.7, 0.5, 0.25, 0.1, 0.03)
_HIGHER = (1e-3, 1e-2, 0.1)
# Ratio of a band's edges over which a plateau is looked for where the band begins at zero.
_WIDEST = 1000


@dataclasses.dataclass(frozen=True, eq=False)
class FilterDesign:
    """Filters for the three axes of a sensor model at one sampling rate.

    Attributes
    ----------
    model : SensorModel
    sampling_rate_hz : float
    axes : tuple of DesignedFilter
        One for each of x, y, z.
    static_terms : tuple of StaticTerms
        What the nonlinear spring of each axis adds; None where it is linear.
    delay_samples : int
        An output belongs to the sample this many before the newest.
    sensor_delay_ns : int
        Sensor's own delay [ns], which the correction takes out of the stamp.
    parameter_uncertainty : tuple of ParameterUncertainty
        What the uncertainty of each axis's parameters adds to the variance; None where the model
        states none, or nothing that can be used.
    notes : tuple of str
        For each axis, why what the model states of it cannot be used; empty where it can.
    """

    model: object
    sampling_rate_hz: float
    axes: tuple
    static_terms: tuple
    delay_samples: int
    sensor_delay_ns: int
    parameter_uncertainty: tuple = (None,) * 3
    notes: tuple = ("",) * 3

    @property
    def warm_up_samples(self):
        """Number of samples after a start that cannot be estimated: the taps are not yet full."""
        linear = max(axis.filter.lead + len(axis.filter.taps) for axis in self.axes) - 1
        return max(linear, *(terms.warm_up_samples for terms in self.static_terms if terms), 0)

    @property
    def extrapolated_below_hz(self):
        """Where the band in which the model was identified begins, if the filters reach below it.

        A sensor's plateau is physical, and gravity and the offset need it, but it was not measured.
        """
        known = self.model.band_hz
        lowest = min(axis.band_hz[0] for axis in self.axes)
        return known[0] if known and lowest < known[0] else 0.0

    def summary(self):
        """Plain numbers of the design, for reports and diagnostics."""
        return {
            "sampling_rate_hz": self.sampling_rate_hz,
            "extrapolated_below_hz": self.extrapolated_below_hz,
            "filter_delay_s": self.delay_samples / self.sampling_rate_hz,
            "sensor_delay_s": self.sensor_delay_ns * 1e-9,
            "warm_up_s": self.warm_up_samples / self.sampling_rate_hz,
            "axes": {name: {
                "band_hz": list(axis.band_hz),
                "worst_amplitude_error": axis.amplitude_error,
                "worst_phase_error_deg": axis.phase_error_deg,
                "noise_gain": axis.noise_gain,
                "static_gain": axis.filter.static_gain,
                "taps": len(axis.filter.taps), "poles": len(axis.filter.poles),
                "parameter_uncertainty": uncertainty.summary() if uncertainty else note or "none",
            } for name, axis, uncertainty, note in zip(
                AXES, self.axes, self.parameter_uncertainty, self.notes)},
        }


def design_inverse(model, sampling_rate_hz, bandwidth_hz=None, max_delay_s=None, lowest_hz=None,
                   tolerance=TOLERANCE):
    r"""Stable causal inverse of a sensor model.

    The composite response of each axis (core, mounting, conditioner, gain) is inverted as one
    filter: with the target :math:`T(f) = e^{-j 2\pi f d} / H(f)` its coefficients minimise

    .. math:: \sum_{band} \left|G(f)/T(f) - 1\right|^2 + \mu^2 \int_{rest} |G(f)|^2 df

    with the largest noise weight :math:`\mu` for which the worst error in the band, checked on a
    denser grid, stays within the tolerance. The poles of `G` are fixed beforehand, so the problem
    is linear and the result stable; compare the least-squares inverse of S. Eichstädt et al.,
    *Metrologia* 47 (2010) 522-533, which has no poles and a separate low-pass.

    Parameters
    ----------
    model : SensorModel
    sampling_rate_hz : float
        Rate of the record [Hz].
    bandwidth_hz : float, optional
        Highest frequency to correct [Hz]. Default: where the sensor's gain has fallen to a fifth,
        at most 0.6 of the Nyquist frequency or the end of the band in which the model was
        identified.
    max_delay_s : float, optional
        Permitted delay of the filter [s]. Default: the shortest whose noise gain is within 30 % of
        that of an ideal band limit, at most four periods of the highest frequency unless the
        tolerance needs more.
    lowest_hz : float, optional
        Lowest frequency to correct [Hz]. Default: 0, or where a high-pass leaves a fifth.
    tolerance : float
        Permitted worst relative error of the complex response in the band.

    Returns
    -------
    FilterDesign

    Raises
    ------
    DesignError
        If it cannot be met; the message says what can.
    ModelError
        If the cross-axis terms cannot be inverted.

    Examples
    --------
    >>> import frac_accel
    >>> from frac_accel.model.core import Oscillator
    >>> model = frac_accel.SensorModel(Oscillator(180.0, 0.15))
    >>> design = frac_accel.design_inverse(model, 1000.0, bandwidth_hz=300.0)
    >>> [axis.band_hz[1] for axis in design.axes], design.delay_samples < 50
    ([300.0, 300.0, 300.0], True)
    """
    rate = _positive(sampling_rate_hz, "sampling_rate_hz")
    require_wishes(bandwidth_hz, max_delay_s, lowest_hz, tolerance)
    zeros = np.zeros((1, 3))
    model.live_inverse(rate)(zeros, zeros, Circumstances.at_rest(1))  # refuses singular ones
    ratio = _clock_ratio(model)
    # stamps are whole nanoseconds; what is left of the delay is done by the filters
    sensor_delay_ns = int(np.ceil(max(axis.delay_s for axis in model.axes) * 1e9 - 1e-3))

    # what the sensor's clock calls a second is `ratio` seconds
    true_rate = rate / ratio

    def late(axis):
        return max(0.0, sensor_delay_ns * 1e-9 - axis.delay_s) * true_rate

    @functools.cache
    def problem(axis, band):
        return FilterProblem(lambda s: 1 / axis.transfer_function(s), axis.zeros(), true_rate, band,
                             late(axis))

    @functools.cache
    def terms(axis, band):
        return StaticTermsDesign(axis, true_rate, band, late(axis)) if axis.static_force else None

    def within(bandwidth_hz, lowest_hz):
        bands = [_band(axis, name, rate, bandwidth_hz, lowest_hz, model.band_hz)
                 for name, axis in zip(AXES, model.axes)]
        return bands, [problem(axis, band) for axis, band in zip(model.axes, bands)]

    bands, problems = within(bandwidth_hz, lowest_hz)
    nonlinear = [terms(axis, band) for axis, band in zip(model.axes, bands)]

    def elsewhere():
        high, low = (pick(band[end] for band in bands) for pick, end in ((max, 1), (min, 0)))
        yield "bandwidth_hz", high, _NARROWER, lambda end: within(end, lowest_hz)[1]
        if high * _HIGHER[-1] > low:
            yield "lowest_hz", high, _HIGHER, lambda end: within(bandwidth_hz, end)[1]

    delay = _choose_delay(list(dict.fromkeys(problems)), rate, max_delay_s, tolerance, elsewhere)
    delay = _delay_with_terms(delay, nonlinear, rate, max_delay_s)

    @functools.cache
    def solved(own_problem, own_terms):
        linear = own_problem.solve(delay, tolerance)
        return linear, own_terms.solve(delay, linear) if own_terms else None

    axes, static_terms = zip(*map(solved, problems, nonlinear))
    uncertainty, notes = zip(*_parameter_uncertainty(model, problems, delay, axes))
    return FilterDesign(model=model, sampling_rate_hz=rate, axes=axes, static_terms=static_terms,
                        delay_samples=delay, sensor_delay_ns=sensor_delay_ns,
                        parameter_uncertainty=uncertainty, notes=notes)


def require_wishes(bandwidth_hz=None, max_delay_s=None, lowest_hz=None, tolerance=None):
    """Refuse wishes, as those of `design_inverse`, that are no numbers above 0.

    Raises
    ------
    FracAccelError
    """
    for name, value in (("bandwidth_hz", bandwidth_hz), ("max_delay_s", max_delay_s),
                        ("lowest_hz", lowest_hz), ("tolerance", tolerance)):
        if value is not None:
            _positive(value, name)


def _parameter_uncertainty(model, problems, delay, axes):
    """`ParameterUncertainty` of each axis, or None and why there is none."""
    known = {}
    says_of_axes = any("axes." in str(model.metadata.get(key))
                       for key in ("covariance", "uncertainties"))
    for name, problem, linear in zip(AXES, problems, axes):
        # axes alike share the filters, unless the file says something of one alone
        alike = problem, model.axis(name), name if says_of_axes else ""
        if alike not in known:
            try:
                result = design_parameter_uncertainty(model, name, problem, delay, linear), ""
            except ModelError as error:
                result = None, str(error)
            known[alike] = result
        yield known[alike]


def _delay_with_terms(delay, nonlinear, rate, max_delay_s):
    """Delay [samples] that is long enough for the path of the nonlinear terms, too."""
    least = max((terms.least_delay for terms in nonlinear if terms), default=0)
    if max_delay_s is not None and least > max_delay_s * rate * (1 + 1e-9):
        raise DesignError(f"the nonlinear terms need a delay of {_rounded_up(least / rate, 6)} s, "
                          f"but max_delay_s is {max_delay_s:.3g} s")
    return max(delay, least)


def design_simulator(model, sampling_rate_hz, tolerance=TOLERANCE):
    """Filters that play a sensor model's linear response live, one per axis.

    Parameters
    ----------
    model : SensorModel
    sampling_rate_hz : float
    tolerance : float
        Permitted worst error of the complex response up to 0.6 of the Nyquist frequency, relative
        to its size, or to a hundredth of the sensor's plateau where it is smaller than that.

    Returns
    -------
    FilterDesign
        The sensor's own delay is in the filters, so ``sensor_delay_ns`` is 0.

    Raises
    ------
    DesignError
        If the tolerance cannot be met.
    """
    rate = _positive(sampling_rate_hz, "sampling_rate_hz")
    _clock_ratio(model)
    if any(axis.static_force for axis in model.axes):
        raise DesignError("a model with a nonlinear spring or friction cannot be played live; "
                          "simulate it offline")
    if any(axis.path_dependent for axis in model.axes):
        raise DesignError("a model whose output depends on the path of the motion cannot be played "
                          "live; simulate it offline")
    # a sensor whose stamps are early (a negative delay) can only be played so much later
    wait = int(np.ceil(max(0.0, *(-axis.delay_s * rate for axis in model.axes))))

    @functools.cache
    def problem(axis):
        return FilterProblem(axis.transfer_function, axis.poles(), rate,
                        (0.0, NYQUIST_SHARE * rate / 2), axis.delay_s * rate + wait,
                        floor=0.01 * reference_gain(axis, model.band_hz))

    problems = [problem(axis) for axis in model.axes]
    delay = _choose_delay(list(dict.fromkeys(problems)), rate, None, tolerance)
    return FilterDesign(model=model, sampling_rate_hz=rate,
                        axes=tuple(p.solve(delay, tolerance) for p in problems),
                        static_terms=(None,) * 3, delay_samples=delay + wait, sensor_delay_ns=0)


def _clock_ratio(model):
    """Ratio of the sensor's clock, which is one for all axes."""
    ratios = {axis.clock_ratio for axis in model.axes}
    if len({axis.time_steps for axis in model.axes}) > 1:
        raise DesignError("effects: the stamps jump otherwise on one axis than on another, but a "
                          "sample has one stamp for all of them")
    if len(ratios) > 1:
        raise DesignError("effects: the clock's rate differs between the axes, but a sample has "
                          "one stamp for all of them")
    return ratios.pop()


def _choose_delay(problems, rate, max_delay_s, tolerance, elsewhere=lambda: ()):
    """Common delay [samples] of all axes; `elsewhere` gives other bands, as `_offers` takes them,
    for where there is none."""
    period = rate / min(problem.band[1] for problem in problems)
    longest = _longest(problems, rate, max_delay_s)
    shares = (0, 0.25, 0.5, 0.75, 1, 1.5, 2, 3, 4, 6, 8)
    usual = 4 * period if max_delay_s is None else longest
    ladder = sorted({min(int(np.ceil(share * period)), longest) for share in shares} | {longest})
    best, best_excess, smallest = None, np.inf, np.inf
    for delay in ladder:
        if best is not None and delay > np.ceil(usual):
            break
        designs = [problem.solve(delay, tolerance) for problem in problems]
        error = _worst(designs)
        smallest = min(smallest, error)
        if error > tolerance:
            continue
        excess = max(d.noise_gain / p.ideal_noise_gain for d, p in zip(designs, problems))
        if excess < best_excess:
            best, best_excess = delay, excess
        if max_delay_s is None and excess <= NOISE_EXCESS:
            break
    if best is None:
        raise DesignError(_cannot(problems, rate, max_delay_s, tolerance, smallest, elsewhere))
    return best


def _longest(problems, rate, max_delay_s):
    """Longest delay [samples] that is of use and permitted."""
    longest = max(problem.longest for problem in problems)
    return longest if max_delay_s is None else min(longest, int(max_delay_s * rate * (1 + 1e-9)))


def _worst(designs):
    return max(max(d.amplitude_error, np.radians(d.phase_error_deg)) for d in designs)


def _cannot(problems, rate, max_delay_s, tolerance, smallest, elsewhere):
    """Say what was asked for, and a delay, a band or a tolerance with which it can be met."""
    low = min(problem.band[0] for problem in problems)
    high = max(problem.band[1] for problem in problems)
    what = f"a worst error of {tolerance:.2g} from {low:.4g} to {high:.4g} Hz at {rate:.6g} Hz"
    most = max(problem.longest for problem in problems)
    longest = _longest(problems, rate, max_delay_s)
    delay = longest + 1
    while max_delay_s is not None and delay <= most:
        if _worst([problem.solve(delay, tolerance) for problem in problems]) <= tolerance:
            return (f"{what} needs a delay of {_rounded_up(delay / rate, 6)} s, but max_delay_s is "
                    f"{max_delay_s:.3g} s; there the error is {smallest:.2g}")
        delay = int(np.ceil(1.2 * delay))
    offers = list(_offers(elsewhere, rate, max_delay_s, tolerance))
    possible = smallest
    while possible < 0.5:
        possible = float(_rounded_up(possible, 2))
        if _worst([problem.solve(longest, possible) for problem in problems]) <= possible:
            offers.append(f"tolerance={possible:g}")
            break
        possible *= 1.2
    if not offers:
        return f"{what} cannot be met, nor in any narrower band that was tried"
    return f"{what} cannot be met; it can with {' or '.join(offers)}"


def _offers(elsewhere, rate, max_delay_s, tolerance):
    """Wishes for a band, one of each kind, with which a filter has been seen to do."""
    for name, high, shares, problems_of in elsewhere():
        for share in shares:
            end = float(f"{share * high:.2g}")
            try:
                problems = problems_of(end)
            except DesignError:
                continue
            longest = _longest(problems, rate, max_delay_s)
            if _worst([problem.solve(longest, tolerance) for problem in problems]) <= tolerance:
                yield f"{name}={end:g}"
                break


def _rounded_up(value, digits):
    """Decimal text of at least `value` with so many significant digits."""
    unit = 10.0 ** (np.floor(np.log10(value)) + 1 - digits)
    return f"{np.ceil(value / unit * (1 - 1e-12)) * unit:.{digits}g}"


def _positive(value, name):
    if not isinstance(value, (int, float, np.number)) or not np.isfinite(value) or value <= 0:
        raise FracAccelError(f"{name}: {value!r} given, expected a number above 0")
    return float(value)


def _band(axis, name, rate, bandwidth_hz, lowest_hz, known_band_hz):
    """Lowest and highest frequency [Hz] of the correction of one axis."""
    nyquist = rate / 2
    core = axis.effective_core
    top = min(nyquist, core.sampling_rate_hz / 2) if isinstance(core, Arx) else nyquist
    reference = reference_gain(axis, known_band_hz)
    if not reference > 0:
        raise DesignError(f"axis {name}: the model's gain is zero, there is nothing to invert")
    grid = np.geomspace(0.1 * LOWEST_SHARE * rate, NYQUIST_SHARE * top, 8000)
    usable = np.abs(evaluate(axis.transfer_function, grid, rate)) >= GAIN_AT_BAND_EDGE * reference
    if bandwidth_hz is not None and bandwidth_hz >= 0.95 * top:
        raise DesignError(f"bandwidth_hz: {bandwidth_hz:g} given, expected below {0.95 * top:g} "
                          f"(0.95 of the Nyquist frequency)")
    if not usable.any():
        raise DesignError(f"axis {name}: nowhere up to {NYQUIST_SHARE * top:.4g} Hz does the "
                          f"sensor keep {GAIN_AT_BAND_EDGE:.0%} of its gain; "
                          "a higher sampling rate is needed")
    first = int(np.argmax(usable))
    after = np.flatnonzero(~usable[first:])
    last = first + (int(after[0]) if len(after) else len(grid) - first) - 1
    low = 0.0 if first == 0 else float(grid[first])
    low = low if lowest_hz is None else float(lowest_hz)
    known = known_band_hz[1] if known_band_hz else np.inf
    high = min(float(grid[last]), known) if bandwidth_hz is None else float(bandwidth_hz)
    if low >= high:
        raise DesignError(f"axis {name}: the band from {low:.4g} Hz to {high:.4g} Hz is empty")
    return low, high


def plateau(axis, band_hz=None):
    """Gain of an axis on its plateau, with its polarity [output units per m/s²].

    The plateau of an oscillator or a gain is known wherever it was identified. Another core means
    nothing outside the band in which it was identified: its gain is the median over that band,
    octave by octave.

    Parameters
    ----------
    axis : AxisModel
    band_hz : sequence of float, optional
        Band in which the model was identified.

    Returns
    -------
    float
    """
    core = axis.effective_core
    if isinstance(core, (Oscillator, Gain)):
        own = core.sensitivity
    elif band_hz is None:
        # the polarity of the limit, since orders below zero leave s = 0 itself undefined
        own = np.copysign(core.reference_gain(),
                          core.transfer_function(np.array([1e-9 + 0j]))[0].real)
    else:
        low, high = band_hz
        frequency = np.geomspace(max(low, high / _WIDEST), high, 500)
        response = core.transfer_function(2j * np.pi * frequency)
        own = np.copysign(np.median(np.abs(response)), np.median(response.real))
    return float(own * np.prod([effect.reference_gain() for effect in axis.effects]))


def reference_gain(axis, band_hz=None):
    """Size of `plateau`."""
    return abs(plateau(axis, band_hz))
