"""Fitted linear filter without a physical name."""

import dataclasses

import numpy as np

from ...errors import ModelError
from ..parameters import coefficients, parameter
from .base import CONDITIONER, Effect


@dataclasses.dataclass(frozen=True)
class EmpiricalLink(Effect):
    r"""A description of what a sensor does besides, never a cause.

    .. math:: e^{-s \tau} \frac{b_0 u^m + \dots + b_m}{a_0 u^n + \dots + a_n},
              \quad u = \frac{s}{2 \pi f}

    `diagnosis.empirical.fit_empirical_link` fits one; it has no corner or resonance that would mean
    something.
    """

    cause = "empirical_link"
    stage = CONDITIONER
    explanation = ("A fitted filter describes what no known cause explains; it says nothing of "
                   "where it comes from.")
    experiment = ("Nothing that could be measured belongs to its coefficients; look for the cause "
                  "where it changes the response most.")
    # no search may take it for a cause
    read_off = True

    numerator: tuple = coefficients()
    denominator: tuple = coefficients()
    frequency_hz: float = parameter("Hz", above=0)
    delay_s: float = parameter("s", minimum=-3600, maximum=3600, default=0.0)

    def __post_init__(self):
        if not self.denominator[0] or not any(self.numerator):
            raise ModelError("empirical_link: leading 0 in the denominator or none but 0 in the "
                             "numerator given, expected a filter")
        if len(self.numerator) > len(self.denominator):
            raise ModelError(f"empirical_link.numerator: {len(self.numerator)} coefficients given, "
                             f"expected at most the denominator's {len(self.denominator)}")
        unstable = self.poles()[self.poles().real >= 0]
        if len(unstable):
            raise ModelError("empirical_link.denominator: unstable, a pole at "
                             f"{unstable[0]:.4g} rad/s, expected all left of the imaginary axis")

    def pure_delay_s(self):
        return self.delay_s

    def slow_delay_s(self):
        # - d arg H / ds at s = 0
        (b1, b0), (a1, a0) = (tuple((0.0, *values)[-2:])
                              for values in (self.numerator, self.denominator))
        with np.errstate(divide="ignore", invalid="ignore"):
            own = np.subtract(np.divide(a1, a0), np.divide(b1, b0))
        return self.delay_s + (float(own) / (2 * np.pi * self.frequency_hz)
                               if np.isfinite(own) else 0.0)

    def transfer_function(self, s):
        u = np.asarray(s, complex) / (2 * np.pi * self.frequency_hz)
        return np.polyval(self.numerator, u) / np.polyval(self.denominator, u)

    def reference_gain(self):
        return float(abs(self.transfer_function(np.array([2e-3j * np.pi * self.frequency_hz]))[0]))

    def poles(self):
        return 2 * np.pi * self.frequency_hz * np.roots(self.denominator)

    def zeros(self):
        return 2 * np.pi * self.frequency_hz * np.roots(self.numerator)
