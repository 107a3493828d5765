"""The paper's G(z), the model that it makes of it, and the one that follows from it."""

import numpy as np

from ..model.core import Arx, FractionalTransferFunction
from . import published


def identified():
    """Equation (6) as a sampled core."""
    return Arx(published.G_NUMERATOR, published.G_DENOMINATOR, published.SAMPLING_RATE_HZ)


def substituted(v1=1.0, v2=2.0, numerator_orders=None):
    """Equation (5) with the coefficients of equation (6): z-domain numbers in an s-domain equation.

    Parameters
    ----------
    v1, v2 : float
        Orders of the left-hand side.
    numerator_orders : tuple of float, optional
        mu_1 and mu_2; default: the same.

    Returns
    -------
    FractionalTransferFunction
    """
    u1, u2 = (v1, v2) if numerator_orders is None else numerator_orders
    b2, b1, _ = published.G_NUMERATOR
    left = _merged((v2, v1, 0.0), published.G_DENOMINATOR)
    right = _merged((u2, u1), (b2, b1))
    return FractionalTransferFunction(left[1], left[0], right[1], right[0])


def by_bilinear_transform(core):
    r"""Rational function in s that equals a sampled core under :math:`z = (1 + sT/2)/(1 - sT/2)`.

    The response at f is exactly that of the sampled core at
    :math:`\arctan(\pi f T) / (\pi T)`: at 500 Hz and 10 kHz, 0.8 % lower. A hold-equivalent would
    not do: it takes the input for a staircase, whose delay of half a sample is not the sensor's.

    Parameters
    ----------
    core : Arx
        Of order 2.

    Returns
    -------
    FractionalTransferFunction
        Of orders 2, 1, 0.
    """
    half = 0.5 / core.sampling_rate_hz
    up, down = np.array([half, 1.0]), np.array([-half, 1.0])
    powers = [np.polymul(up, up), np.polymul(up, down), np.polymul(down, down)]

    def side(values):
        padded = np.r_[np.zeros(3 - len(values)), values]
        return sum(value * power for value, power in zip(padded, powers))
    numerator, denominator = side(core.numerator), side(core.denominator)
    orders = (2.0, 1.0, 0.0)
    return FractionalTransferFunction(
        tuple((denominator / denominator[0]).tolist()), orders,
        tuple((numerator / denominator[0]).tolist()), orders)


def _merged(orders, values):
    """Orders and their coefficients; those of one order added up."""
    total = {}
    for order, value in zip(orders, values):
        total[order] = total.get(order, 0.0) + value
    return tuple(total), tuple(total.values())
