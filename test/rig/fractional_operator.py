r"""Fractional derivative from rest as a sum of exponentially fading memories.

For :math:`0 < \beta < 1` (Prudnikov et al., Integrals and Series 1, 2.2.5)

.. math:: s^\beta = \frac{\sin \beta\pi}{\pi} \int_{-\infty}^{\infty}
          e^{\beta x} \frac{s}{s + e^x} \, dx ,

and :math:`s / (s + r)` is the ordinary equation :math:`\varphi' = -r \varphi + y'`: the diffusive
representation of the Caputo derivative. The trapezoidal rule in x converges exponentially, because
the integrand is analytic for :math:`|Im\, x| < \pi/2` on the imaginary s-axis: its error is
:math:`e^{-\pi^2/\Delta x}`. The rates below the range act as a spring, those above as a dashpot;
both sums are geometric and are kept exactly.
"""

import dataclasses

import numpy as np

LOG_RATE_STEP = 0.6  # quadrature error exp(-pi**2 / 0.6) = 7e-8


@dataclasses.dataclass(frozen=True)
class DiffusiveDerivative:
    """D^order y = low * y + sum(weights * phi) + high * y', with phi' = -rates * phi + y'.

    For an order above 1 the same holds one derivative later: y is then the velocity.
    """

    order: float
    rates: np.ndarray    # [rad/s]
    weights: np.ndarray  # [(rad/s)**beta]
    low: float
    high: float

    @property
    def acts_on_velocity(self):
        """True where y is q' (order above 1), False where y is q."""
        return self.order > 1

    def transfer_function(self, s):
        """Response of this approximation at complex `s` [rad/s], to be compared with s**order."""
        s = np.asarray(s, complex)
        modes = (self.weights / (s[..., None] + self.rates)).sum(axis=-1)
        return (self.low + s * (self.high + modes)) * (s if self.acts_on_velocity else 1)


def diffusive_derivative(order, slowest_rad_s, fastest_rad_s):
    """Approximate D^order, 0 < order < 2, for motion between the two angular frequencies.

    The range of the rates is wider than that of the motion by 1e4 on either side, so that
    the spring and the dashpot that stand for the rest err by less than 3e-6 of the operator.
    """
    if not 0 < order < 2:
        raise ValueError(f"order {order}: expected between 0 and 2")
    if order == 1:
        return DiffusiveDerivative(1.0, np.empty(0), np.empty(0), 0.0, 1.0)
    beta = order % 1
    first = np.floor(np.log(slowest_rad_s / 1e4) / LOG_RATE_STEP)
    last = np.ceil(np.log(fastest_rad_s * 1e4) / LOG_RATE_STEP)
    rates = np.exp(LOG_RATE_STEP * np.arange(first, last + 1))
    scale = np.sin(np.pi * beta) / np.pi * LOG_RATE_STEP
    low = scale * rates[0] ** beta / np.expm1(beta * LOG_RATE_STEP)
    high = scale * rates[-1] ** (beta - 1) / np.expm1((1 - beta) * LOG_RATE_STEP)
    return DiffusiveDerivative(float(order), rates, scale * rates ** beta, low, high)
