"""The models that compete: classical, fractional, and classical with as many parameters."""

import dataclasses

import numpy as np

from ...errors import IdentificationError
from ...identification.fit.output_error import Fit, fit_output_error
from ...identification.fit.structures import FractionalStructure, OscillatorStructure
from ...model import SensorModel
from ...model.core import FractionalTransferFunction, Oscillator
from ...model.core.principal_sheet import fractional_root
from ...model.effects import identified_effect
from ...model.effects.low_pass_lag import LowPassLag

CLASSICAL, FRACTIONAL = "classical", "fractional"
LOW_PASS, SLOPE = "classical + low-pass", "classical + slope"


class LowPassStructure(OscillatorStructure):
    r"""Classical sensor behind a first-order low-pass: one parameter more, as the fractional one.

    The response is multiplied by :math:`1 / (1 + s/\omega_c)`; the unknown is log f_c.
    """

    names = (*OscillatorStructure.names, "corner_hz")

    def gradient(self, s, theta):
        response, slopes = super().gradient(s, theta)
        lag = s * np.exp(-theta[2]) / (2 * np.pi)
        factor = 1 / (1 + lag)
        return response * factor, [*(slope * factor for slope in slopes),
                                   response * factor * factor * lag]

    def bounds(self, rate, n):
        low, high = super().bounds(rate, n)
        return [*low, np.log(0.01 * rate)], [*high, np.log(100 * rate)]

    def grid(self, low_hz, high_hz, peak_hz):
        grid = super().grid(low_hz, high_hz, peak_hz)
        return np.c_[grid, np.full(len(grid), np.log(4 * high_hz))]

    def mode(self, theta):
        return _with_one_more(super().mode(theta))

    def model(self, fit):
        """Core and effects but for the delay."""
        return self.core(fit), [LowPassLag(fit["corner_hz"])]


class SlopeStructure(OscillatorStructure):
    r"""Classical sensor that also answers to the slope of the acceleration.

    The response is multiplied by :math:`1 + \beta s/\omega_0`; the unknown is :math:`\beta`.
    """

    names = (*OscillatorStructure.names, "slope_ratio")

    def gradient(self, s, theta):
        response, slopes = super().gradient(s, theta)
        u = s * np.exp(-theta[0]) / (2 * np.pi)
        factor = 1 + theta[2] * u
        slopes = [slope * factor for slope in slopes]
        slopes[0] = slopes[0] - response * theta[2] * u
        return response * factor, [*slopes, response * u]

    def physical(self, theta):
        values = np.r_[np.exp(theta[:2]), theta[2]]
        return values, np.diag([*values[:2], 1.0])

    def bounds(self, rate, n):
        low, high = super().bounds(rate, n)
        return [*low, -3.0], [*high, 3.0]

    def grid(self, low_hz, high_hz, peak_hz):
        grid = super().grid(low_hz, high_hz, peak_hz)
        # at zero the slope is a delay and a damping to first order: no place to start from
        return np.concatenate([np.c_[grid, np.full(len(grid), slope)] for slope in (-0.3, 0.3)])

    def mode(self, theta):
        return _with_one_more(super().mode(theta))

    def model(self, fit):
        """Core and effects but for the delay."""
        omega = 2 * np.pi * fit["natural_frequency_hz"]
        return FractionalTransferFunction(
            (1 / omega**2, 2 * fit["damping_ratio"] / omega, 1.0), (2.0, 1.0, 0.0),
            (fit["sensitivity"] * fit["slope_ratio"] / omega, fit["sensitivity"]), (1.0, 0.0)), []


class FixedOrdersStructure(OscillatorStructure):
    """Sensor whose damping and inertia have orders that are given, as in the paper's sweeps."""

    def __init__(self, v1, v2=2.0):
        self.v1, self.v2 = v1, v2

    def prepare(self, s):
        return np.log(s)

    def gradient(self, prepared, theta):
        log_u = prepared - theta[0] - np.log(2 * np.pi)
        inertia = np.exp(self.v2 * log_u)
        damper = 2 * np.exp(theta[1] + self.v1 * log_u)
        response = 1 / (inertia + damper + 1)
        square = response * response
        return response, [square * (self.v2 * inertia + self.v1 * damper), -square * damper]

    def mode(self, theta):
        omega, twice = 2 * np.pi * np.exp(theta[0]), 2 * np.exp(theta[1])
        root = fractional_root([1, twice, 1], [self.v2, self.v1, 0])
        if root is None or root.real >= 0:
            return None, None
        damper = twice * root**self.v1
        slope = (self.v2 * root**self.v2 + self.v1 * damper) / root
        return omega * root, omega * np.array([root, -damper / slope])

    def decay_rates(self, theta, duration_s):
        return np.array([])

    def model(self, fit):
        """Core and effects but for the delay."""
        omega = 2 * np.pi * fit["natural_frequency_hz"]
        return FractionalTransferFunction(
            (omega**-self.v2, 2 * fit["damping_ratio"] * omega**-self.v1, 1.0),
            (self.v2, self.v1, 0.0), (fit["sensitivity"],), (0.0,)), []


def _with_one_more(mode):
    """A mode that does not depend on one parameter more."""
    pole, slopes = mode
    return pole, None if slopes is None else np.r_[slopes, 0.0]


class NearFractionalStructure(FractionalStructure):
    """Fractional sensor that is also searched for from the classical solution: fewer trials do."""

    trials = 2
    searches = 1


STRUCTURES = {CLASSICAL: OscillatorStructure(), FRACTIONAL: NearFractionalStructure(),
              LOW_PASS: LowPassStructure(), SLOPE: SlopeStructure()}
# Values of the additional unknown to start from, by the sampling rate: order, corner and slope.
_FROM_CLASSICAL = {FRACTIONAL: (lambda rate: 1.0,), LOW_PASS: (lambda rate: np.log(rate / 2),),
                   SLOPE: (lambda rate: -0.3, lambda rate: 0.3)}
# Classical models with as many parameters as the fractional one.
AS_MANY = (LOW_PASS, SLOPE)


@dataclasses.dataclass(frozen=True)
class Fitted:
    """A structure fitted to a record."""

    name: str
    structure: object
    fit: Fit

    @property
    def parameters(self):
        """Number of parameters, the offset not counted."""
        return len(self.fit.names) - 1

    @property
    def order(self):
        """Damping order that was found, and its standard uncertainty."""
        place = self.fit.names.index("damping_order")
        return self.fit["damping_order"], float(self.fit.std[place])

    def sensor_model(self):
        """SensorModel with the delay, without the offset."""
        if hasattr(self.structure, "model"):
            core, effects = self.structure.model(self.fit)
        else:
            core, effects = self.structure.core(self.fit), []
        if not isinstance(core, Oscillator):
            core.require_stable("core")
        return SensorModel(core, [*effects, identified_effect("delay_s", self.fit["delay_s"])])

    def response(self, frequency_hz):
        """Frequency response, delay included, shape (m,)."""
        return self._parts(frequency_hz)[0]

    def relative_covariance(self, frequency_hz):
        r"""Covariance of the real, then imaginary part of :math:`\ln H`, shape (2 m, 2 m)."""
        response, slopes = self._parts(frequency_hz)
        relative = (slopes / response).T
        jacobian = np.concatenate([relative.real, relative.imag])
        count = jacobian.shape[1]
        return jacobian @ self.fit.covariance[:count, :count] @ jacobian.T

    def _parts(self, frequency_hz):
        """Response and its derivatives by sensitivity, the structure's parameters and the delay."""
        s = 2j * np.pi * np.asarray(frequency_hz, float)
        own = self.fit.unknowns[:-1]
        plain, slopes = self.structure.gradient(self.structure.prepare(s), own)
        _, factors = self.structure.physical(own)
        shift = np.exp(-s * self.fit["delay_s"])
        response = self.fit["sensitivity"] * plain * shift
        by_own = np.linalg.solve(factors.T, self.fit["sensitivity"] * np.array(slopes) * shift)
        return response, np.stack([plain * shift, *by_own, -s * response])


def fitted(name, structure, reference, sensor, rate, valid=None, lag_s=0.0, starts=(None,)):
    """Fit a structure to a record; parameters as `fit_output_error`.

    `starts` are further ones beside None, the structure's own grid; the best fit counts.
    """
    fits = []
    for start in starts:
        try:
            fits.append(fit_output_error(structure, reference, sensor, rate, valid, lag_s, start))
        except IdentificationError:
            if len(starts) == 1:
                raise
    if not fits:
        raise IdentificationError(f"{name}: no fit from any start")
    return Fitted(name, structure, min(fits, key=lambda fit: fit.rmse))


def fit_all(reference, sensor, rate, valid=None, lag_s=0.0):
    """All `STRUCTURES` fitted to one record, all but the classical one also from its solution.

    So no candidate loses by the search alone: each is at least as good as the classical one, which
    they all contain.

    Returns
    -------
    dict of str to Fitted
        Without those that found no fit.
    """
    record = reference, sensor, rate, valid, lag_s
    plain = fitted(CLASSICAL, STRUCTURES[CLASSICAL], *record)
    result = {CLASSICAL: plain}
    for name, values in _FROM_CLASSICAL.items():
        near = [np.insert(plain.fit.unknowns, 2, value(rate)) for value in values]
        try:
            result[name] = fitted(name, STRUCTURES[name], *record, starts=(None, *near))
        except IdentificationError:
            continue
    return result
