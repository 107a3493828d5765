"""Low-pass of higher order, as data sheets of accelerometers and their conditioners state it."""

import dataclasses
import functools
import math

import numpy as np

from ..parameters import choice, parameter
from .base import CONDITIONER, Effect
from .fit_starts import matching_alone

_FAMILIES = ("butterworth", "bessel")
_LEAST, _MOST = 2, 8


@dataclasses.dataclass(frozen=True)
class LowPassFilter(Effect):
    r"""All-pole low-pass whose gain at the corner frequency is :math:`1 / \sqrt 2`.

    .. math:: \prod_k \frac{-p_k}{s / \omega_c - p_k}

    A. V. Oppenheim, R. W. Schafer, *Discrete-Time Signal Processing*, 3rd ed., appendix B.1
    (Butterworth); W. E. Thomson, "Delay networks having maximally flat frequency characteristics",
    *Proc. IEE* 96 (1949) 487-490 (Bessel).
    """

    cause = "low_pass_filter"
    stage = CONDITIONER
    explanation = ("A low-pass of higher order in the conditioner makes fast motion smaller and "
                   "later.")
    experiment = ("Excite up to twice the corner frequency: how steeply the amplitude falls there "
                  "tells the filter's order.")

    corner_hz: float = parameter("Hz", above=0, scale="rate", reach=(1e-6, 10.0), null=np.inf)
    order: int = parameter("1", minimum=_LEAST, maximum=_MOST, whole=True)
    family: str = choice(*_FAMILIES)

    def transfer_function(self, s):
        u = np.asarray(s, complex) / (2 * np.pi * self.corner_hz)
        return 1 / functools.reduce(np.multiply, [1 - u / pole
                                                  for pole in _prototype(self.family, self.order)])

    def poles(self):
        return 2 * np.pi * self.corner_hz * _prototype(self.family, self.order)

    def alternatives(self):
        others = [dataclasses.replace(self, order=order)
                  for order in (self.order - 1, self.order + 1) if _LEAST <= order <= _MOST]
        # the best of one family may be like none of the other that is near
        return others + [dataclasses.replace(self, order=order, family=family)
                         for family in _FAMILIES if family != self.family
                         for order in range(_LEAST, _MOST + 1)]

    @classmethod
    def starts(cls, view):
        return matching_alone(view, [
            cls(float(corner), order, family) for corner in view.rate * np.geomspace(0.01, 2.0, 40)
            for order in range(_LEAST, _MOST + 1) for family in _FAMILIES])


@functools.cache
def _prototype(family, order):
    """Poles with the corner at 1 rad/s; conjugates are exactly that."""
    if family == "butterworth":
        angles = np.pi * (2 * np.arange(1, order + 1) + order - 1) / (2 * order)
        poles = np.exp(1j * angles)
    else:
        # reverse Bessel polynomial
        polynomial = [math.factorial(2 * order - k)
                      / (2**(order - k) * math.factorial(k) * math.factorial(order - k))
                      for k in range(order, -1, -1)]
        poles = np.roots(polynomial)
        poles = poles / _corner(polynomial)
    upper = poles[poles.imag > 1e-6]
    real = poles[np.abs(poles.imag) <= 1e-6].real
    return np.r_[upper, upper.conj(), real]


def _corner(polynomial):
    """Frequency [rad/s] at which the size of a polynomial is the square root of 2 of that at 0."""
    low, high = 0.0, 10.0
    for _ in range(60):
        middle = (low + high) / 2
        if abs(np.polyval(polynomial, 1j * middle)) < math.sqrt(2) * abs(polynomial[-1]):
            low = middle
        else:
            high = middle
    return low
