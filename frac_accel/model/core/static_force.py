"""What the oscillator's spring does beyond its linear part."""

import dataclasses
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ...errors import FracAccelError

# Points of a spring's characteristic from which Newton's method finds the rest, and its steps.
_GRID, _NEWTON = 257, 3
# Share of a load beyond what a spring carries that is no more than what between samples is not
# known better.
_LITTLE_LESS = 0.01


class ForceLaw(NamedTuple):
    """A further term of the force, with or without a state of its own.

    Attributes
    ----------
    function : callable
        ``function(q0, v0, state, q1, v1, duration, parameters) -> (force, state)``: force and state
        at the end of a part of a step in which the mass went from q0 to q1 [output units], with the
        velocities v0 and v1 by the time tau = omega_0 t at its ends. Plain arithmetic on numbers,
        without calls of anything but `math`, so that numba compiles it as it stands. The state is 0
        at the start; with a duration of 0 the function says the force at q1, v1.
    parameters : tuple of float
        Handed over as an array.
    timed : bool
        Whether the state is the time tau since the record's start.
    slope : float
        Largest slope of the force by q: steps must be the finer.
    """

    function: Callable
    parameters: tuple
    timed: bool = False
    slope: float = 0.0

    def along(self, motion, velocity, duration, state=0.0, before=None):
        """Force along a motion, shape (n,), and the state after it.

        Parameters
        ----------
        motion, velocity : ndarray, shape (n,)
            q [output units] and its derivative by tau.
        duration : float
            Of the step between two of them, in tau.
        state : float
            Before the first.
        before : tuple of float, optional
            Motion and velocity before the first; default: as there.
        """
        parameters = np.array(self.parameters, float)
        forces = np.empty(len(motion))
        q0, v0 = before if before is not None else (motion[0], velocity[0])
        for i, (q, v) in enumerate(zip(motion.tolist(), velocity.tolist())):
            forces[i], state = self.function(q0, v0, state, q, v, duration, parameters)
            q0, v0 = q, v
        return forces, state


def no_force(q0, v0, state, q1, v1, duration, parameters):
    """The law that adds nothing."""
    return 0.0, 0.0


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
    laws : tuple of ForceLaw
        Further terms of :math:`N`.
    core : Oscillator or Gain, optional
        What the spring belongs to, for laws that need to know.
    """

    polynomial: tuple = ()
    friction_level: float = 0.0
    strength: float = 0.0
    beta: float = 0.0
    gamma: float = 0.0
    laws: tuple = ()
    core: object = None

    @property
    def slope(self):
        """Largest slope by q that a law declares."""
        return max((law.slope for law in self.laws), default=0.0)

    @property
    def natural_frequency_hz(self):
        """Of the core; without bound where the mass of a gain follows at once."""
        return getattr(self.core, "natural_frequency_hz", np.inf)

    def __bool__(self):
        return bool(any(self.polynomial) or self.friction_level != 0 or self.strength != 0
                    or self.laws)

    def with_power(self, power, coefficient):
        """The same with another term `coefficient` * q**`power`, power 2 or more."""
        terms = np.zeros(max(len(self.polynomial), power - 1))
        terms[:len(self.polynomial)] = self.polynomial
        terms[power - 2] += coefficient
        return dataclasses.replace(self, polynomial=tuple(terms.tolist()))

    def with_law(self, function, *parameters, timed=False, slope=0.0):
        """The same with a further term; see `ForceLaw`."""
        law = ForceLaw(function, parameters, timed, slope)
        return dataclasses.replace(self, laws=(*self.laws, law))

    def equilibrium(self, load):
        """Output under a load that has been there for ever: q + sum(alpha_k q**k) = `load`.

        Friction, hysteresis and further terms are taken as relaxed.

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

    def _carried(self, load):
        """A load, or one that is less by `_LITTLE_LESS` where the spring carries that only."""
        try:
            self.equilibrium(load)
        except FracAccelError:
            return load * (1 - _LITTLE_LESS)
        return load

    def at_once(self, load):
        """`equilibrium` under each of some loads, shape (n,), as a mass that follows at once has
        it: where a sensor is far below its resonance. A little more than the spring carries counts
        as what it does: by so much a peak between two samples depends on how these are filled."""
        least, most = self._carried(float(load.min())), self._carried(float(load.max()))
        load = np.clip(load, least, most)
        ends = self.equilibrium(least), self.equilibrium(most)
        carried = np.polynomial.Polynomial([0.0, 1.0, *self.polynomial])
        # from end to end the load grows with the output
        grid = np.linspace(*ends, _GRID)
        found = np.interp(load, carried(grid), grid)
        for _ in range(_NEWTON):
            found = found - (carried(found) - load) / carried.deriv()(found)
        return found
