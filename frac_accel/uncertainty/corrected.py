"""Variance that a model's parameter uncertainty adds to a corrected signal."""

import dataclasses

import numpy as np

from ..errors import FracAccelError
from ..model import AXES
from ..signals.convolution import Convolution
from ..simulation import static_gain
from .parameters import LINEAR, UncertainAxis, offset_of

# Draws of the parameters.
_DRAWS = 400
# Room before the record, in samples, for parameters that make the answer come earlier.
_ROOM = 64


@dataclasses.dataclass(frozen=True, eq=False)
class CorrectedUncertainty:
    """What the uncertainty of the parameters adds to the variance of corrected samples.

    Attributes
    ----------
    variance : ndarray, shape (n, 3)
        [(m/s²)²]; to be added to that of the noise.
    method : tuple of str
        For each axis, ``first order`` or ``Monte Carlo``.
    nonlinearity : tuple of float
        For each axis, what decided between them; see `UncertainAxis.nonlinearity`.
    """

    variance: np.ndarray
    method: tuple
    nonlinearity: tuple


def corrected_uncertainty(model, corrected, sampling_rate_hz):
    r"""Propagate the uncertainty of a model's parameters to the signal that it has corrected.

    Had the sensor the parameters :math:`\theta + \delta`, the true acceleration would be the
    corrected one, :math:`\hat a`, filtered by :math:`H_\theta / H_{\theta+\delta}`. To first order
    each parameter has one sensitivity filter, run beside the correction,

    .. math:: \frac{\partial \hat a}{\partial \theta_i}
              = -\frac{\partial \ln H}{\partial \theta_i} * \hat a,

    and the variance at each instant is :math:`d^T C d` of their outputs. It is stable whatever the
    inverse is, since the roll-off of the two responses cancels; an oscillator's inverse is linear
    in damping and nearly so in the frequency, so this holds for uncertainties at which the
    response itself is no longer linear. Where it does not hold (`UncertainAxis.nonlinearity` of
    the whole signal above a tenth), the ratio is applied for draws of the parameters instead, and
    the variance is their mean square.

    Parameters
    ----------
    model : SensorModel
        That of the correction, with a ``covariance``.
    corrected : array_like, shape (n, 3)
        Corrected acceleration [m/s²] at uniform instants. Its mean is taken as steady before.
    sampling_rate_hz : float

    Returns
    -------
    CorrectedUncertainty
        What the filter itself gets wrong (its worst error is in `FilterDesign`) and the noise are
        no part of it.

    Raises
    ------
    ModelError
        If the model has no covariance, or not a valid one.
    FracAccelError
        If the samples are not finite or of the wrong shape.

    Examples
    --------
    >>> import frac_accel
    >>> model = frac_accel.identify("bags/classical_bench.mcap").model
    >>> corrected = frac_accel.correct("bags/classical_bench.mcap", model)
    >>> added = frac_accel.corrected_uncertainty(model, corrected.values, 1000.0)
    >>> added.variance.shape == corrected.values.shape
    True
    """
    corrected = np.asarray(corrected, float)
    if corrected.ndim != 2 or corrected.shape[1] != 3 or len(corrected) < 2:
        raise FracAccelError(f"corrected: shape {corrected.shape} given, expected (n, 3)")
    if not np.isfinite(corrected).all():
        raise FracAccelError("corrected: samples that are not finite given")
    parts = [_axis(UncertainAxis.of(model, name), corrected[:, i], sampling_rate_hz)
             for i, name in enumerate(AXES)]
    variance, method, nonlinearity = zip(*parts)
    return CorrectedUncertainty(np.stack(variance, axis=1), method, nonlinearity)


def _axis(uncertain, values, rate):
    """Variance of one axis, how it was found and its nonlinearity."""
    level = values.mean()
    convolution = Convolution(values - level, rate, _ROOM / rate)
    s = convolution.s
    steady = np.array([1e-9 + 0j])
    gain = static_gain(uncertain.axis)
    by_offset = -1 / gain if gain else 0.0
    offset = uncertain.names.index("offset") if "offset" in uncertain.names else None

    def change(drawn):
        result = convolution.response(1 / uncertain.ratio(drawn, s) - 1)
        if gain:
            result += level * (1 / uncertain.ratio(drawn, steady)[0].real - 1)
        if offset is not None:
            result += by_offset * (offset_of(drawn) - uncertain.values[offset])
        return result

    nonlinearity = uncertain.nonlinearity(change, whole=True)
    if nonlinearity <= LINEAR:
        slopes, still = uncertain.slopes(s), uncertain.slopes(steady)[:, 0].real
        changes = np.stack([-convolution.response(slope) for slope in slopes])
        if gain:
            changes -= level * still[:, None]
        if offset is not None:
            changes[offset] = by_offset
        variance = np.einsum("in,ij,jn->n", changes, uncertain.covariance, changes)
        return np.maximum(variance, 0), "first order", nonlinearity
    variance = np.mean([np.square(change(drawn)) for drawn in uncertain.draws(_DRAWS)], axis=0)
    return variance, "Monte Carlo", nonlinearity
