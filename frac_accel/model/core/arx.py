"""Rational transfer function in z, as an ARX identification gives it."""

import dataclasses
from typing import ClassVar

import numpy as np

from ...errors import ModelError
from ..parameters import coefficients, parameter


@dataclasses.dataclass(frozen=True)
class Arx:
    """Sampled core G(z) = numerator(z) / denominator(z), equation (6) of the seed paper.

    Attributes
    ----------
    numerator, denominator : tuple of float
        Coefficients in descending powers of z, down to z**0.
    sampling_rate_hz : float
        Rate at which the model holds. Its coefficients mean nothing in an s-domain equation.
    """

    type: ClassVar[str] = "arx"

    numerator: tuple = coefficients()
    denominator: tuple = coefficients()
    sampling_rate_hz: float = parameter("Hz", above=0, maximum=1e9)

    def __post_init__(self):
        if not self.denominator[0]:
            raise ModelError("core.denominator[0]: 0 given, expected the leading coefficient")
        if not any(self.numerator):
            raise ModelError("core.numerator: only zeros given, expected one that is not")
        if len(self.numerator) > len(self.denominator):
            raise ModelError(
                f"core.numerator: {len(self.numerator)} coefficients given, expected at most the "
                f"denominator's {len(self.denominator)}: the model would answer before its input")

    def transfer_function(self, s):
        """Transfer function at complex `s` [rad/s]; periodic in the sampling rate."""
        z = np.exp(np.asarray(s, complex) / self.sampling_rate_hz)
        return np.polyval(self.numerator, z) / np.polyval(self.denominator, z)

    def poles(self):
        """Poles, mapped to s [rad/s] by z = exp(s / rate); those at z = 0 left out."""
        return self._in_s(np.roots(self.denominator))

    def zeros(self):
        """Zeros, mapped to s [rad/s] by z = exp(s / rate); those at z = 0 left out."""
        return self._in_s(np.roots(self.numerator))

    def _in_s(self, z):
        return np.log(z[np.abs(z) > 1e-12].astype(complex)) * self.sampling_rate_hz

    def reference_gain(self):
        """Static gain, or where there is none the largest below 0.6 of the Nyquist frequency."""
        static = abs(np.polyval(self.numerator, 1.0) / np.polyval(self.denominator, 1.0))
        frequency = np.geomspace(1e-6, 0.3, 1000) * self.sampling_rate_hz
        largest = np.max(np.abs(self.transfer_function(2j * np.pi * frequency)))
        return float(static if static > 1e-3 * largest else largest)

    def require_stable(self, where):
        """Raise ModelError where a pole is not inside the unit circle."""
        radius = np.max(np.abs(np.roots(self.denominator)), initial=0.0)
        if radius >= 1:
            raise ModelError(f"{where}.denominator: unstable, its largest pole has modulus "
                             f"{radius:.6g}, expected all below 1")
