r"""Sensitivity filters: what the uncertainty of a model's parameters adds to corrected samples.

Had the sensor the parameters :math:`\theta + \delta`, the true acceleration would be the
corrected one filtered by :math:`H_\theta / H_{\theta+\delta} = 1 + \Delta_\delta`. The variance
of a corrected sample is the mean of :math:`(\Delta_\delta * \hat a)^2` over the distribution of
the parameters, and the mean of such a quadratic form is a sum of squares,

.. math:: u^2 = \sum_k (F_k * y + c_k)^2 ,

of a few filters that run on the raw samples beside the inverse. To first order,
:math:`\Delta_\delta = -\sum_i \delta_i \, \partial \ln H / \partial \theta_i`, and the F_k belong
to the roots of the covariance (A. Link, C. Elster, *Meas. Sci. Technol.* 20 (2009) 055104, have the
same for the coefficients of a digital filter). Where the inverse does not depend linearly on the
parameters, they belong to draws of these instead. The c_k are those of an uncertain offset.
"""

import dataclasses
from typing import NamedTuple

import numpy as np

from ..errors import ModelError
from ..parameters import number
from .filter import FilterState
from .fitting import TAIL

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
_MOST_FREQUENCIES = 2000


@dataclasses.dataclass(frozen=True, eq=False)
class ParameterUncertainty:
    """Filters from the raw samples of an axis to the variance by its parameters.

    Attributes
    ----------
    filters : tuple of ParallelFilter
        F_k.
    constants : ndarray, shape (k,)
        c_k, of the offset.
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
        Parameters in the covariance that the linear response does not depend on.
    """

    filters: tuple
    constants: np.ndarray
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
        self._states = [FilterState(one, level) for one in design.filters]
        self._constants = design.constants.tolist()
        self._constant_variance = design.constant_variance
        self._waiting = np.repeat(level[:, None], design.lead, axis=1)

    def process(self, values):
        """Variance that belongs to the next samples; shape (k, n) in and out."""
        if self._waiting.shape[1]:
            queue = np.concatenate([self._waiting, values], axis=1)
            values, self._waiting = np.split(queue, [values.shape[1]], axis=1)
        total = np.full(values.shape, self._constant_variance)
        for state, constant in zip(self._states, self._constants):
            output = state.process(values)
            if constant:
                output += constant
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
    changes, constants, method, nonlinearity = _changes(uncertain, s, offset_gain)
    moved = np.abs(uncertain.slopes(s[:: max(1, len(s) // 50)])).max(axis=1) > 0
    left_out = tuple(parameter for parameter, is_moved in zip(uncertain.names, moved)
                     if not is_moved and parameter != "offset")
    relative = np.sqrt(np.sum(np.abs(changes)**2, axis=0))
    if not np.isfinite(relative).all():
        raise ModelError("covariance: it cannot be propagated, the response changes without bound")
    if not relative.any():
        return ParameterUncertainty(
            (), np.empty(0), float(np.sum(constants**2)), 0, method, nonlinearity, 0.0, left_out)
    unit = np.maximum(relative, _FLOOR * relative.max())
    changes, constants, rest = _principal(changes, constants, unit)
    fit = _shortest(problem, delay, frequency, target, changes, unit, linear.noise_gain)
    return ParameterUncertainty(
        filters=fit.filters, constants=constants, constant_variance=rest, lead=fit.lead,
        method=method, nonlinearity=nonlinearity, worst_error=fit.error, left_out=left_out)


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
    from ..uncertainty.parameters import UncertainAxis, read_covariance
    stated = model.metadata.get("covariance")
    if stated is None and (given := model.metadata.get("uncertainties")):
        # standard uncertainties alone: without correlations
        if not isinstance(given, dict) or not all(
                isinstance(entry, dict) and "std" in entry for entry in given.values()):
            raise ModelError(f"uncertainties: {given!r:.60} given, expected the std of each "
                             "parameter")
        std = [number(entry["std"], f"uncertainties.{name}.std")
               for name, entry in given.items()]
        stated = {"parameters": list(given), "matrix": [
            [std[i]**2 if i == j else 0.0 for j in range(len(std))] for i in range(len(std))]}
    if stated is None:
        return None
    own = model.axis(name)
    if own.core != model.core:
        raise ModelError(f"axes.{name}: has a core of its own, of which the covariance says "
                         "nothing")
    return UncertainAxis.given(own, *read_covariance(stated))


def _changes(uncertain, s, offset_gain):
    """Relative changes of the inverse (k, m), those of the offset (k,), and how they were found.

    The mean square of a change over the parameters is the sum of squares over k.
    """
    from ..uncertainty.parameters import LINEAR
    place = uncertain.names.index("offset") if "offset" in uncertain.names else None

    def change(drawn):
        inverse = 1 / uncertain.ratio(drawn, s) - 1
        return np.concatenate([inverse.real, inverse.imag])

    nonlinearity = uncertain.nonlinearity(change, whole=True)
    if nonlinearity <= LINEAR:
        roots = uncertain.directions()
        constants = np.zeros(len(roots)) if place is None else offset_gain * roots[place]
        return -roots.T @ uncertain.slopes(s), constants, "first order", nonlinearity
    drawn = uncertain.draws(_DRAWS)
    changes = np.array([1 / uncertain.ratio(one, s) - 1 for one in drawn])
    constants = np.zeros(_DRAWS)
    if place is not None:
        constants = offset_gain * np.array([_offset(one) - uncertain.values[place]
                                            for one in drawn])
    return changes / np.sqrt(_DRAWS), constants / np.sqrt(_DRAWS), "Monte Carlo", nonlinearity


def _offset(axis):
    return sum(effect.offset for effect in axis.effects if effect.cause == "offset")


def _principal(changes, constants, unit):
    """Fewest changes with nearly the same sum of squares at all frequencies.

    Returns
    -------
    changes : ndarray, shape (k, m)
    constants : ndarray, shape (k,)
    rest : float
        Sum of squares of the other constants.
    """
    weighted = changes / unit
    gram = (weighted @ weighted.conj().T).real
    size, rotation = np.linalg.eigh(gram)
    rotation = rotation[:, np.argsort(size)[::-1]]
    changes, constants = rotation.T @ changes, rotation.T @ constants
    # what would be missing after the first k, at the worst frequency
    missing = np.cumsum((np.abs(changes / unit)**2)[::-1], axis=0)[::-1].max(axis=1)
    count = int(np.sum(missing > _NEGLECTED**2))
    return changes[:count], constants[:count], float(np.sum(constants[count:]**2))


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
