"""What the oscillator's spring does beyond its linear part."""

import dataclasses

import numpy as np

from ..errors import FracAccelError


@dataclasses.dataclass(frozen=True)
class StaticForce:
    r"""Restoring force over the stiffness, without its linear part.

    .. math:: N = \sum_{k \ge 2} \alpha_k q^k + h + c\,\mathrm{sgn}\,q', \qquad
              h = \lambda z, \quad z' = q' - \beta |q'| z - \gamma q' |z|

    the terms beside :math:`q` in the equation of motion

    .. math:: q'' + 2 \zeta \omega_0^{2-\nu} D^\nu q + \omega_0^2 (q + N) = \omega_0^2 S a

    Attributes
    ----------
    polynomial : tuple of float
        :math:`\alpha_2, \alpha_3, \ldots` [1/(output units)**(k - 1)].
    friction_level : float
        Coulomb level :math:`c` [output units].
    strength, beta, gamma : float
        :math:`\lambda` [1] and :math:`\beta, \gamma` [1/(output units)] of the hysteresis:
        R. Bouc (1967) and Y.-K. Wen, J. Eng. Mech. Div. ASCE 102 (1976) 249-263.
    """

    polynomial: tuple = ()
    friction_level: float = 0.0
    strength: float = 0.0
    beta: float = 0.0
    gamma: float = 0.0

    def __bool__(self):
        return any(self.polynomial) or self.friction_level != 0 or self.strength != 0

    def with_power(self, power, coefficient):
        """The same with another term `coefficient` * q**`power`, power 2 or more."""
        terms = np.zeros(max(len(self.polynomial), power - 1))
        terms[:len(self.polynomial)] = self.polynomial
        terms[power - 2] += coefficient
        return dataclasses.replace(self, polynomial=tuple(terms.tolist()))

    def equilibrium(self, load):
        """Output under a load that has been there for ever: q + sum(alpha_k q**k) = `load`.

        Friction and hysteresis are taken as relaxed.

        Raises
        ------
        FracAccelError
            Where the spring cannot carry the load.
        """
        roots = np.roots([*self.polynomial[::-1], 1.0, -load])
        real = roots.real[np.abs(roots.imag) <= 1e-9 * np.abs(roots)]
        # the one that the load reaches from zero
        between = real[real * load >= 0]
        if not len(between):
            raise FracAccelError(f"the model's spring has no position of rest under {load:g} "
                                 "output units: its stiffness terms are too large")
        return float(between[np.argmin(np.abs(between))])
