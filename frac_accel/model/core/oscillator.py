"""Seismic sensor with classical or fractional damping."""

import dataclasses
from typing import ClassVar

import numpy as np

from ..parameters import parameter
from .principal_sheet import fractional_root


@dataclasses.dataclass(frozen=True)
class Oscillator:
    r"""Seismic sensor in output units.

    .. math:: q'' + 2 \zeta \omega_0^{2-\nu} D^\nu q + \omega_0^2 q = \omega_0^2 S a

    Equation (4) of Pietruszczak, *Laboratory investigations of dynamic properties of
    accelerometers with fractional orders*, with the factor :math:`\omega_0^{1-\nu}` that makes
    its units close, and the displacement scaled to output units.

    Attributes
    ----------
    natural_frequency_hz : float
        :math:`\omega_0 / 2\pi`.
    damping_ratio : float
        :math:`\zeta`.
    damping_order : float
        :math:`\nu`: 1 classical, otherwise fractional.
    sensitivity : float
        :math:`S` [output units per m/s²].
    """

    type: ClassVar[str] = "oscillator"

    natural_frequency_hz: float = parameter("Hz", above=0, maximum=1e8)
    damping_ratio: float = parameter("1", above=0, maximum=100)
    damping_order: float = parameter("1", above=0, below=2, default=1.0)
    sensitivity: float = parameter("output units per m/s^2", default=1.0)

    def transfer_function(self, s):
        """Transfer function at complex `s` [rad/s], same shape."""
        u = np.asarray(s, complex) / (2 * np.pi * self.natural_frequency_hz)
        return self.sensitivity / (u * u + 2 * self.damping_ratio * u**self.damping_order + 1)

    def poles(self):
        """Poles on the principal sheet [rad/s]; a fractional damping's branch cut is none."""
        omega = 2 * np.pi * self.natural_frequency_hz
        zeta, order = self.damping_ratio, self.damping_order
        if order == 1:
            return omega * np.roots([1, 2 * zeta, 1])
        root = fractional_root([1, 2 * zeta, 1], [2, order, 0])
        return omega * np.array([] if root is None else [root, np.conj(root)])

    def zeros(self):
        """Zeros [rad/s]: none."""
        return np.array([])

    def reference_gain(self):
        """Gain on the plateau below the resonance: the sensitivity's size."""
        return abs(self.sensitivity)

    def require_stable(self, where):
        """Positive damping of an order between 0 and 2 is stable, whatever its value."""


def tail_rates(natural_frequency_hz, duration_s):
    """Rates [1/s] of the decays that stand for a fractional sensor's memory of earlier motion.

    The contribution of the branch cut falls off algebraically; so many exponentials leave less than
    1e-4 of the output of it.

    Returns
    -------
    ndarray, shape (8,)
    """
    return np.geomspace(1 / duration_s, 2 * np.pi * natural_frequency_hz, 8)


def tail_sizes(core, rates):
    r"""What earlier motion, as large as 1, can leave of each decay of `tail_rates`, shape (m,).

    What a damping force of order :math:`\nu` remembers is a sum of decays with the density

    .. math:: \frac{|\sin \pi\nu|}{\pi} r^\nu \, \int_0^\infty e^{-rs} q(-s) \, ds

    over the rates r (I. Podlubny, *Fractional Differential Equations* (1999), 2.2 and 2.8, with the
    kernel as a Laplace transform), and the integral is at most the motion's size over r.
    """
    step = np.log(rates[-1] / rates[0]) / (len(rates) - 1)
    return 2 * core.damping_ratio * abs(np.sin(np.pi * core.damping_order)) / np.pi * step \
        * (rates / (2 * np.pi * core.natural_frequency_hz))**core.damping_order
