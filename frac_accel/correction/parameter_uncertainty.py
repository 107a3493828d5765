r"""Sensitivity filters: what the uncertainty of a model's parameters adds to corrected samples.

Had the sensor the parameters :math:`\theta + \delta`, the true acceleration would be the
corrected one filtered by :math:`H_\theta / H_{\theta+\delta} = 1 + \Delta_\delta`. The variance
of a corrected sample is the mean of :math:`(\Delta_\delta * \hat a)^2` over the distribution of
the parameters, and the mean of such a quadratic form is a sum of squares,

.. math:: u^2 = \sum_k (F_k * y + c_k)^2 ,

of a few filters that run on the raw samples beside the inverse. A nonlinear spring's part of the
inverse is linear in its coefficients, so that each of these has a signal of its own, which joins
the sum with what the parameters move it by. To first order,
:math:`\Delta_\delta = -\sum_i \delta_i \, \partial \ln H / \partial \theta_i`, and the F_k belong
to the roots of the covariance (A. Link, C. Elster, *Meas. Sci. Technol.* 20 (2009) 055104, have the
same for the coefficients of a digital filter). Where the inverse does not depend linearly on the
parameters, they belong to draws of these instead. The c_k are those of an uncertain offset.
"""

import dataclasses
from typing import NamedTuple

import numpy as np

from ..errors import ModelError
from ..model.parameters import number
from ..signals.parallel_filter import FilterState
from .fitting import TAIL
from .static_terms import coefficients

# Of the standard uncertainty at each frequency: permitted error of the filters, and what may be
# left out of them.
_TOLERANCE = 0.02
_NEGLECTED = 0.01
# Below this share of its largest value over the band, the uncertainty is not fitted.
_FLOOR = 0.03
# Lengths that are tried, over that of the inverse, and the most noise that a shorter one may let
# through, over that of the inverse: in the variance, 4 %.
_LENGTHS = (0.06, 0.09, 0.12, 0.18, 0.25, 0.5, 1)
_NOISE_SHARE = 0.2
_NOISE_WEIGHTS = (0.3, 0.1, 0.03, 0.01, 1e-3, 1e-5)
# Of the poles that carry the inverse's long memory, the sensitivities need every third.
_THINNED = 2
_DRAWS = 400
# Relative change of a response that is none.
_ROUNDING = 1e-9
# Frequencies at which filters are fitted, at most.
_MOST_FREQUENCIES = 2000


@dataclasses.dataclass(frozen=True, eq=False)
class ParameterUncertainty:
    """Filters from the raw samples of an axis to the variance by its parameters.

    Attributes
    ----------
    filters : tuple of ParallelFilter
        F_k.
    constants : ndarray, shape (m,)
        c_k, of the offset; those beyond the number of filters stand without one.
    parts : tuple
        Of the nonlinear spring's terms; see `StaticTermsState`.
    shares : ndarray, shape (m, n_parts)
        What each square takes of these.
    constant_variance : float
        Of what the offset adds beside the filters.
    lead : int
        Whole samples by which the input waits before all this.
    method : str
        ``first order`` or ``Monte Carlo``.
    nonlinearity : float
        What decided between them; see `UncertainAxis.nonlinearity`.
    worst_error : float
        Of the filters in the band, over the standard uncertainty at each frequency.
    left_out : tuple of str
        Parameters in the covariance that are not in the variance.
    """

    filters: tuple
    constants: np.ndarray
    parts: tuple
    shares: np.ndarray
    constant_variance: float
    lead: int
    method: str
    nonlinearity: float
    worst_error: float
    left_out: tuple

    def summary(self):
        """Plain values, for reports and diagnostics."""
        return {"method": self.method, "nonlinearity": self.nonlinearity,
                "worst_error": self.worst_error, "filters": len(self.filters),
                "left_out": list(self.left_out)}


class ParameterUncertaintyState:
    """`ParameterUncertainty` running over the samples of some axes, in blocks of any length.

    Parameters
    ----------
    design : ParameterUncertainty
    level : ndarray, shape (k,)
        The samples of each axis before the first: a constant.
    """

    def __init__(self, design, level):
        self._states = [FilterState(one, level, _TOLERANCE) for one in design.filters]
        self._states += [None] * (len(design.constants) - len(self._states))
        self._added = list(zip(design.constants.tolist(), design.shares.tolist()))
        self._constant_variance = design.constant_variance
        self._waiting = np.repeat(level[:, None], design.lead, axis=1)

    def process(self, values, parts=()):
        """Variance that belongs to the next samples; shape (k, n) in and out.

        Parameters
        ----------
        values : ndarray, shape (k, n)
        parts : list of ndarray, shape (k, n)
            What the parts of the spring add to the corrected samples.
        """
        shape = values.shape
        if self._waiting.shape[1]:
            queue = np.concatenate([self._waiting, values], axis=1)
            values, self._waiting = queue[:, :shape[1]], queue[:, shape[1]:]
        total = np.full(shape, self._constant_variance)
        for state, (constant, shares) in zip(self._states, self._added):
            output = state.process(values) if state else np.zeros(shape)
            if constant:
                output += constant
            for share, part in zip(shares, parts):
                output += share * part
            output *= output
            total += output
        return total


def design_parameter_uncertainty(model, name, problem, delay, linear):
    """Sensitivity filters beside the inverse of one axis.

    Parameters
    ----------
    model : SensorModel
    name : str
        Axis.
    problem : FilterProblem
        Of its inverse.
    delay : int
        Of the inverse [samples].
    linear : DesignedFilter
        The inverse.

    Returns
    -------
    ParameterUncertainty or None
        None where the model states no uncertainty.

    Raises
    ------
    ModelError
        If what it states cannot be used.
    """
    uncertain = _uncertain_axis(model, name)
    if uncertain is None:
        return None
    offset_gain = -linear.filter.static_gain if linear.band_hz[0] == 0 else 0.0
    step = -(-len(problem.check) // _MOST_FREQUENCIES)
    frequency, target = problem.check[::step], problem.check_target[::step]
    s = 2j * np.pi * np.maximum(frequency, 1e-9 * problem.rate)
    parts = _parts(uncertain.axis)
    changes, constants, shares, method, nonlinearity = _changes(uncertain, s, offset_gain, parts)
    slopes = np.abs(uncertain.slopes(s[:: max(1, len(s) // 50)])).max(axis=1)
    moved = slopes * np.where(uncertain.values, np.abs(uncertain.values), 1.0) > _ROUNDING
    moved |= np.any(_part_slopes(uncertain, parts), axis=0)
    left_out = tuple(parameter for parameter, is_moved in zip(uncertain.names, moved)
                     if not is_moved and parameter != "offset")
    relative = np.sqrt(np.sum(np.abs(changes)**2, axis=0))
    if not np.isfinite(relative).all():
        raise ModelError("covariance: it cannot be propagated, the response changes without bound")
    if relative.max() < _ROUNDING:
        constants, shares, rest = _without_filters(constants, shares)
        return ParameterUncertainty((), constants, parts, shares, rest, 0, method, nonlinearity,
                                    0.0, left_out)
    unit = np.maximum(relative, _FLOOR * relative.max())
    changes, constants, shares, rest = _principal(changes, constants, shares, unit)
    fit = _shortest(problem, delay, frequency, target, changes, unit, linear.noise_gain)
    return ParameterUncertainty(
        filters=fit.filters, constants=constants, parts=parts, shares=shares,
        constant_variance=rest, lead=fit.lead, method=method, nonlinearity=nonlinearity,
        worst_error=fit.error, left_out=left_out)


class _Fit(NamedTuple):
    filters: tuple
    lead: int
    error: float


def _shortest(problem, delay, frequency, target, changes, unit, noise_gain):
    """Shortest filters that are as exact as the inverse's own length allows or as wanted.

    Noise of the samples passes them, too; what it adds to the variance stays a small share of what
    it makes through the inverse.
    """
    own = min(delay, problem.longest)
    for share in _LENGTHS:
        short = int(np.ceil(share * own))
        wait = delay - short
        taps, poles = problem.structure(short, share * TAIL)
        poles = _thinned(poles)
        phase = np.exp(2j * np.pi * frequency * (short + problem.extra_delay) / problem.rate)
        columns = problem.columns(frequency, taps, poles) * (phase / (target * unit))[:, None]
        outside = problem.columns(problem.outside, taps, poles) \
            * (problem.outside_weight / unit.max())[:, None]
        unknowns, error = _fitted(columns, changes / unit, outside)
        filters = tuple(dataclasses.replace(problem.filter_of(column, taps, poles), lead=0)
                        for column in unknowns.T)
        noise = np.sqrt(sum(one.noise_gain**2 for one in filters))
        if error <= _TOLERANCE and noise <= _NOISE_SHARE * noise_gain:
            break
    return _Fit(filters, problem.lead + wait, error)


def _uncertain_axis(model, name):
    from ..uncertainty.parameters import UncertainAxis, for_axis, read_covariance
    stated = model.metadata.get("covariance")
    if stated is None and (given := model.metadata.get("uncertainties")):
        # standard uncertainties alone: without correlations
        if not isinstance(given, dict) or not all(
                isinstance(entry, dict) and "std" in entry for entry in given.values()):
            raise ModelError(f"uncertainties: {given!r:.60} given, expected the std of each "
                             "parameter")
        std = [number(entry["std"], f"uncertainties.{parameter}.std")
               for parameter, entry in given.items()]
        stated = {"parameters": list(given), "matrix": [
            [std[i]**2 if i == j else 0.0 for j in range(len(std))] for i in range(len(std))]}
    if stated is None:
        return None
    own = model.axis(name)
    names, matrix, are_own = for_axis(name, *read_covariance(stated))
    if own.core != model.core and not are_own:
        raise ModelError(f"axes.{name}: has a core of its own, of which the covariance says "
                         "nothing")
    return UncertainAxis.given(own, names, matrix)


def _parts(axis):
    """Parts of an axis's nonlinear spring that have a coefficient."""
    if not axis.static_force:
        return ()
    return tuple(part for part, value in coefficients(axis, axis).items() if value)


def _part_slopes(uncertain, parts):
    """Derivatives of the parts' coefficients by the parameters, shape (n_parts, p)."""
    result = np.zeros((len(parts), len(uncertain.values)))
    for i in range(len(uncertain.values) if parts else 0):
        above, below, apart = uncertain.beside(i)
        if apart:
            result[:, i] = (_part_values(above, uncertain, parts)
                            - _part_values(below, uncertain, parts)) / apart
    return result


def _part_values(axis, uncertain, parts):
    known = coefficients(axis, uncertain.axis)
    return np.array([known[part] for part in parts])


def _changes(uncertain, s, offset_gain, parts):
    """How the inverse moves with the parameters.

    Returns
    -------
    changes : ndarray, shape (k, m)
        Relative changes; their mean square over the parameters is the sum of squares over k.
    constants : ndarray, shape (k,)
        Those of the offset.
    shares : ndarray, shape (k, n_parts)
        Those of the coefficients of the spring's parts.
    method : str
    nonlinearity : float
    """
    from ..uncertainty.parameters import LINEAR, offset_of
    place = uncertain.names.index("offset") if "offset" in uncertain.names else None

    def change(drawn):
        inverse = 1 / uncertain.ratio(drawn, s) - 1
        inverse[np.abs(inverse) < 1e-4 * _ROUNDING] = 0
        return np.concatenate([inverse.real, inverse.imag])

    nonlinearity = uncertain.nonlinearity(change, whole=True)
    if nonlinearity <= LINEAR:
        roots = uncertain.directions()
        constants = np.zeros(roots.shape[1]) if place is None else offset_gain * roots[place]
        return (-roots.T @ uncertain.slopes(s), constants,
                roots.T @ _part_slopes(uncertain, parts).T, "first order", nonlinearity)
    drawn = uncertain.draws(_DRAWS)
    changes = np.array([1 / uncertain.ratio(one, s) - 1 for one in drawn])
    constants, shares = np.zeros(_DRAWS), np.zeros((_DRAWS, len(parts)))
    if place is not None:
        constants = offset_gain * np.array([offset_of(one) - uncertain.values[place]
                                            for one in drawn])
    if parts:
        shares = np.array([_part_values(one, uncertain, parts) for one in drawn])
        shares -= _part_values(uncertain.axis, uncertain, parts)
    share = np.sqrt(_DRAWS)
    return changes / share, constants / share, shares / share, "Monte Carlo", nonlinearity


def _principal(changes, constants, shares, unit):
    """Fewest changes with nearly the same sum of squares at all frequencies.

    Returns
    -------
    changes : ndarray, shape (k, m)
    constants, shares : ndarray, shape (k',) and (k', n_parts)
        With what stands without a filter behind those that have one.
    rest : float
        Sum of squares of the other constants.
    """
    weighted = changes / unit
    gram = (weighted @ weighted.conj().T).real
    size, rotation = np.linalg.eigh(gram)
    rotation = rotation[:, np.argsort(size)[::-1]]
    changes, constants, shares = (rotation.T @ each for each in (changes, constants, shares))
    # what would be missing after the first k, at the worst frequency
    missing = np.cumsum((np.abs(changes / unit)**2)[::-1], axis=0)[::-1].max(axis=1)
    count = int(np.sum(missing > _NEGLECTED**2))
    more_constants, more_shares, rest = _without_filters(constants[count:], shares[count:])
    return (changes[:count], np.r_[constants[:count], more_constants],
            np.r_[shares[:count], more_shares], rest)


def _without_filters(constants, shares):
    """Fewest constants and shares with the same sum of squares, and a constant for the rest."""
    if not shares.any():
        return np.empty(0), np.empty((0, shares.shape[1])), float(np.sum(constants**2))
    triangle = np.linalg.qr(np.c_[constants, shares], mode="r")
    return triangle[:, 0], triangle[:, 1:], 0.0


def _fitted(columns, wanted, outside):
    """Least-squares unknowns of all filters (u, k), and their worst error.

    With as little gain outside the band as the tolerance allows. Every other frequency is left out
    of the fit, so that the error is looked up between those fitted, too.
    """
    inside, target = columns[::2], wanted[:, ::2].T
    matrix = np.concatenate([inside.real, inside.imag]) / np.sqrt(len(inside))
    basis, triangle = np.linalg.qr(matrix)
    right = basis.T @ np.concatenate([target.real, target.imag]) / np.sqrt(len(inside))
    noise = np.linalg.qr(np.concatenate([outside.real, outside.imag]), mode="r")
    best, smallest = None, np.inf
    for weight in _NOISE_WEIGHTS:
        whole = np.concatenate([triangle, weight * noise])
        size = np.linalg.norm(whole, axis=0)
        padded = np.concatenate([right, np.zeros((len(noise), right.shape[1]))])
        unknowns = np.linalg.lstsq(whole / size, padded, rcond=1e-12)[0] / size[:, None]
        error = float(np.sqrt(np.max(np.sum(np.abs(columns @ unknowns - wanted.T)**2, axis=1))))
        if error < smallest:
            best, smallest = unknowns, error
        if error <= _TOLERANCE:
            break
    return best, smallest


def _thinned(poles):
    pairs, real = poles[poles.imag != 0], np.sort(poles[poles.imag == 0].real)[::-1]
    return np.concatenate([pairs, real[::_THINNED]])
