"""Fit of a continuous-time model structure to points of a frequency response."""

import dataclasses

import numpy as np
from scipy.optimize import least_squares

from ...errors import IdentificationError
from .output_error import Fit

# Points on which starts are compared, and how many of them are followed to their minimum.
_START_POINTS = 150
_START_DELAYS = 200
_ROUGH_DELAYS = 1000
_STARTS = 5
# Trial steps from each start, before the best goes to the end.
_TRIALS = 25
# Steps from a fit in the time domain, the square of one that changes nothing any more [standard
# uncertainties], and the reduced chi-squared up to which the minimum needs no rival.
_DESCENT, _SETTLED, _SUITS = 12, 1e-6, 2.0
# Relative uncertainty below which a point is never trusted: that of the arithmetic.
_FINEST = 1e-9


@dataclasses.dataclass(frozen=True)
class ResponseFit(Fit):
    """Result of `fit_response`.

    Attributes
    ----------
    names : tuple of str
        ``sensitivity``, the structure's parameters, ``delay_s``.
    values : ndarray, shape (p,)
    covariance : ndarray, shape (p, p)
        Enlarged by `reduced_chi_squared` where that is above one.
    residual : ndarray, shape (2 m,)
        Model less measured at each point, real part then imaginary, in standard uncertainties.
    unknowns : ndarray
        Where the search ended, in the coordinates of `output_error.Fit.unknowns`.
    reduced_chi_squared : float
        Sum of squared residuals over the degrees of freedom; one for a model that lacks nothing.
    relative_error : float
        RMS of the model over the points, less one.
    """

    reduced_chi_squared: float
    relative_error: float


def fit_response(structure, points, sampling_rate_hz, delay_s=0.0, near=None):
    r"""Parameters of a structure, with sensitivity and delay, from a frequency response.

    Weighted least squares on amplitude and phase of :math:`G_\theta(f_k)/\hat G(f_k) - 1`, each by
    its standard uncertainty (the maximum-likelihood estimate for Gaussian points: R. Pintelon,
    J. Schoukens, *System Identification*, 2nd ed., 2012, chapter 9), by Gauss-Newton steps in a
    trust region with the analytic Jacobian.

    Parameters
    ----------
    structure : Structure
        See `structures`.
    points : ResponsePoints
    sampling_rate_hz : float
        Sets the range of the delay and of the unknowns.
    delay_s : float
        Rough delay to start from [s], known to half a period of the points' spacing.
    near : ndarray, optional
        `Fit.unknowns` of a fit in the time domain, to start from besides the grid's best.

    Returns
    -------
    ResponseFit

    Raises
    ------
    IdentificationError
        If the points are too few for the parameters.
    """
    unknowns = len(structure.names) + 2
    if 2 * len(points) <= unknowns:
        raise IdentificationError(f"{len(points)} points of the frequency response cannot give "
                                  f"{unknowns} parameters")
    problem = _Problem(structure, points, sampling_rate_hz)
    descended = None if near is None else problem.descend(problem.start_at(near))
    if descended is not None:
        return problem.result(descended)
    starts = problem.starts(delay_s, _STARTS) if near is None else \
        [*problem.starts(delay_s, 1), problem.start_at(near)]
    trials = [problem.search(start, _TRIALS) for start in starts]
    best = problem.search(min(trials, key=lambda trial: trial.cost).x, 100)
    return problem.result(best)


@dataclasses.dataclass(frozen=True)
class _Minimum:
    """What `result` needs of a minimum; names as in `scipy.optimize.OptimizeResult`."""

    x: np.ndarray
    fun: np.ndarray
    jac: np.ndarray
    cost: float
    active_mask: np.ndarray


class _Problem:
    """Unknowns of the search: sensitivity over its size, the structure's own, delay in samples."""

    def __init__(self, structure, points, rate):
        self.structure, self.rate = structure, rate
        self.response = points.response
        self.frequency = points.frequency_hz
        self.s = 2j * np.pi * points.frequency_hz
        self.prepared = structure.prepare(self.s)
        self.weight = np.stack([1 / np.maximum(points.std_amplitude, _FINEST),
                                1 / np.maximum(points.std_phase_rad, _FINEST)])
        # the record was at least as long as a period of the lowest frequency
        length = 10 * rate / points.frequency_hz[0]
        low, high = structure.bounds(rate, length)
        self.low = np.r_[-np.inf, low, -np.inf]
        self.high = np.r_[np.inf, high, np.inf]

    def start_at(self, unknowns):
        """Start at unknowns without sensitivity, with the one that suits them best."""
        relative, _ = self.parts(np.r_[1.0, unknowns])
        weight = np.minimum(self.weight[0], 100.0)**2
        return np.r_[weight @ relative.real / (weight @ np.abs(relative)**2), unknowns]

    def starts(self, delay_s, count):
        """The grid's best `count` with either polarity, each at its best delay."""
        few = np.unique(np.linspace(0, len(self.s) - 1, _START_POINTS).astype(int))
        s, response = self.s[few], self.response[few]
        frequency = self.frequency
        delay_s = self.rough_delay(delay_s)
        # alike over the band: no point counts for more than a hundredth
        weight = np.minimum(self.weight[0][few], 100.0) ** 2
        prepared = self.structure.prepare(s)
        peak = frequency[np.argmax(np.abs(self.response))]
        grid = self.structure.grid(frequency[0], frequency[-1], peak)
        models = self.structure.response(prepared, grid.T[:, :, None])
        relative = models / response
        reach = 1 / frequency[len(frequency) // 2] + 2 / self.rate
        delays = delay_s + np.linspace(-reach, reach, _START_DELAYS)
        shared = np.real(np.conj(relative) @ (weight[:, None] * np.exp(np.outer(s, delays))))
        size = (np.abs(relative)**2 @ weight)[:, None]
        starts = []
        for polarity in (1, -1):
            explained = np.maximum(polarity * shared, 0)**2 / size
            at = np.argmax(explained, axis=1)
            best = np.max(explained, axis=1)
            seen = set()
            for place in np.argsort(best)[::-1]:
                kind = tuple(np.round(grid[place], 1))
                if kind not in seen:
                    seen.add(kind)
                    gain = shared[place, at[place]] / size[place, 0]
                    starts.append(np.r_[gain, grid[place], delays[at[place]] * self.rate])
                if len(seen) == count:
                    break
        return starts

    def rough_delay(self, near_s):
        """Delay that aligns the phases best, within what the points' spacing tells apart."""
        reach = 0.5 / np.median(np.diff(self.frequency))
        step = 0.125 / self.frequency[-1]
        delays = near_s + np.arange(-reach, reach, max(step, reach / _ROUGH_DELAYS))
        phases = self.response / np.abs(self.response)
        aligned = np.abs(np.exp(np.outer(delays, self.s)) @ phases)
        return delays[np.argmax(aligned)]

    def search(self, start, steps):
        start = np.clip(start, self.low + 1e-9, self.high - 1e-9)
        return least_squares(self.error, start, self.jacobian, (self.low, self.high),
                             x_scale="jac", max_nfev=steps, xtol=1e-10, ftol=1e-10)

    def descend(self, start):
        """Minimum next to a good start, by Gauss-Newton steps; None if there is none as close."""
        freedom = 2 * len(self.s) - len(start)
        if freedom < 1 or np.any(start <= self.low) or np.any(start >= self.high):
            return None
        x, cost = start, np.inf
        for _ in range(_DESCENT):
            whole, slopes = self.parts(x)
            error = self.weighted(whole - 1)
            jacobian = np.stack([self.weighted(slope) for slope in slopes], axis=1)
            if not 0.5 * error @ error < cost:
                return None
            cost = 0.5 * error @ error
            scale = np.linalg.norm(jacobian, axis=0)
            step = -np.linalg.lstsq(jacobian / scale, error, rcond=1e-12)[0]
            if step @ step < _SETTLED * max(cost / freedom, 1.0):
                close = 2 * cost < _SUITS * freedom
                return _Minimum(x, error, jacobian, cost, np.zeros(len(x))) if close else None
            x = x + step / scale
            if np.any(x <= self.low) or np.any(x >= self.high):
                return None
        return None

    def parts(self, unknowns):
        """Model over measured, and its derivatives by the unknowns."""
        gain, own, delay = unknowns[0], unknowns[1:-1], unknowns[-1]
        model, slopes = self.structure.gradient(self.prepared, own)
        shift = np.exp(-self.s * delay / self.rate) / self.response
        whole = gain * model * shift
        return whole, [model * shift, *(gain * slope * shift for slope in slopes),
                       -self.s / self.rate * whole]

    def error(self, unknowns):
        return self.weighted(self.parts(unknowns)[0] - 1)

    def jacobian(self, unknowns):
        return np.stack([self.weighted(part) for part in self.parts(unknowns)[1]], axis=1)

    def weighted(self, values):
        """Amplitude and phase of a small relative difference, in standard uncertainties."""
        return np.r_[values.real * self.weight[0], values.imag * self.weight[1]]

    def result(self, found):
        own, factors = self.structure.physical(found.x[1:-1])
        jacobian = found.jac.copy()
        jacobian[:, 1:-1] = jacobian[:, 1:-1] @ np.linalg.inv(factors)
        jacobian[:, -1] *= self.rate
        chi_squared = 2 * found.cost / (len(found.fun) - len(found.x))
        scale = np.linalg.norm(jacobian, axis=0)
        inverse = np.linalg.pinv(jacobian / scale, rcond=1e-12)
        covariance = inverse @ inverse.T / np.outer(scale, scale) * max(chi_squared, 1.0)
        values = np.r_[found.x[0], own, found.x[-1] / self.rate]
        at_bounds = tuple(name for name, side in zip(self.structure.names, found.active_mask[1:])
                          if side)
        return ResponseFit(("sensitivity", *self.structure.names, "delay_s"), values, covariance,
                           found.fun, found.x[1:], at_bounds, None, 0.0, np.nan,
                           float(chi_squared),
                           float(np.sqrt(np.mean(np.abs(self.parts(found.x)[0] - 1)**2))))
