r"""Oscillator as a sum of modes, each of which has an exact step.

The displacement that a force on the oscillator makes has the transfer function

.. math:: \frac{1}{u^2 + 2 \zeta u^\nu + 1} = \sum_j \frac{R_j}{u - \mu_j}, \qquad u = s/\omega_0

with the resonant pair among the modes, and, for a fractional order, real ones that stand for the
memory. These come from the diffusive representation of the derivative, for
:math:`0 < \beta < 1`

.. math:: u^\beta = \frac{\sin \beta\pi}{\pi} \int_0^\infty \frac{u}{u + r} r^{\beta - 1} dr

(D. Matignon, *ESAIM Proc.* 5 (1998) 145-158), with the integral over :math:`\ln r` by the
trapezoidal rule, whose error :math:`e^{-\pi^2 / \Delta}` is exponentially small.
"""

import dataclasses

import numpy as np

# Spacing of the memory's rates in ln r, and how far they reach beyond those of the motion: the
# spring and the dashpot that stand for the rest then err by a part in so many.
_FINE = 0.75, 1e4    # error of the quadrature 2e-6
_COARSE = 1.0, 1e2   # 5e-5: of the motion, as measured, 3e-5 to 1.2e-4
# To find the real zeros.
_HALVINGS, _NEWTON_STEPS = 12, 8


@dataclasses.dataclass(frozen=True)
class Modes:
    r"""Modes of an oscillator in the time :math:`\tau = \omega_0 t`.

    Only one of each conjugate pair is there, with twice its residue: a displacement is the real
    part of the sum of all modes' states y, which obey y' = pole * y - residue * N under a force -N.

    Attributes
    ----------
    poles, residues : ndarray of complex, shape (m,)
    of_displacement, of_velocity : ndarray of complex, shape (m,)
        Change of the states by a unit jump of the displacement, and of its rate of change.
    mass : float
        What a force is divided by to give the acceleration that it makes at once.
    """

    poles: np.ndarray
    residues: np.ndarray
    of_displacement: np.ndarray
    of_velocity: np.ndarray
    mass: float


def modes_of(core, slowest_rad_s, fastest_rad_s, coarse=False):
    """Modes of an `Oscillator` for motion between two angular frequencies [rad/s].

    With `coarse` a fractional memory is made of half as many.
    """
    natural = 2 * np.pi * core.natural_frequency_hz
    zeta, order = core.damping_ratio, core.damping_order
    if order == 1:
        if abs(zeta - 1) < 1e-8:
            zeta = 1 + 1e-8  # two poles at one place have no partial fractions
        poles = np.roots([1, 2 * zeta, 1]).astype(complex)
        return _one_of_each_pair(poles, 1 / (2 * poles + 2 * zeta), -1 / poles, 1.0)
    memory = _Memory.of(order, zeta, slowest_rad_s / natural, fastest_rad_s / natural,
                        *(_COARSE if coarse else _FINE))
    poles, residues = memory.modes()
    displacement = poles + memory.dashpot if order < 1 else -1 / poles
    return _one_of_each_pair(poles, residues, displacement,
                             1.0 if order < 1 else 1 + memory.dashpot)


def _one_of_each_pair(poles, residues, displacement, mass):
    kept = poles.imag >= 0
    poles, displacement = poles[kept], displacement[kept]
    residues = residues[kept] * np.where(poles.imag > 0, 2, 1)
    return Modes(poles, residues, residues * displacement, residues * mass, mass)


@dataclasses.dataclass(frozen=True)
class _Memory:
    """2 zeta u**order as spring + u * (dashpot + sum(weights / (u + rates))).

    For an order above 1 all that times u: the memory is then one of the velocity.
    """

    order: float
    rates: np.ndarray
    weights: np.ndarray
    spring: float
    dashpot: float

    @classmethod
    def of(cls, order, zeta, slowest, fastest, log_step, margin):
        beta = order % 1
        first, last = np.log([slowest / margin, fastest * margin]) / log_step
        rates = np.exp(log_step * np.arange(np.floor(first), np.ceil(last) + 1))
        scale = 2 * zeta * np.sin(np.pi * beta) / np.pi * log_step
        # the two geometric sums outside the range
        spring = scale * rates[0]**beta / np.expm1(beta * log_step)
        dashpot = scale * rates[-1]**(beta - 1) / np.expm1((1 - beta) * log_step)
        return cls(order, rates, scale * rates**beta, spring, dashpot)

    def modes(self):
        """Zeros of u**2 + memory + 1 and the residues there.

        Beside each rate lies one real zero, on its right for an order below 1 and on its left
        above. They may be closer to it than rounding allows, so that the distance is what is
        looked for. What is left of the function without them is a quadratic: the pair.
        """
        side = 1.0 if self.order < 1 else -1.0
        neighbours = np.r_[0.0, self.rates[:-1]] if side > 0 else np.r_[self.rates[1:], np.inf]
        room = np.minimum(np.abs(neighbours - self.rates), 1e3 * self.rates + 1e3)
        low, high = np.full(len(self.rates), -300.0), np.zeros(len(self.rates))
        middle = (low + high) / 2
        for i in range(_HALVINGS + _NEWTON_STEPS):
            distance = side * room * np.exp(middle)
            value, slope = self._beside(distance)
            low, high = np.where(value < 0, middle, low), np.where(value < 0, high, middle)
            new = (low + high) / 2
            if i >= _HALVINGS:
                newton = middle - value / (slope * distance)
                new = np.where((newton >= low) & (newton <= high), newton, new)
            middle = new
        distance = side * room * np.exp(middle)
        real = distance - self.rates
        mass = 1.0 if side > 0 else 1 + self.dashpot
        u = np.array([1j])
        rest = self._at(u)[0] * np.prod(1 + distance / (u - real)) / mass
        pair = np.roots([1.0, rest[0].imag, rest[0].real + 1]).astype(complex)
        slopes = np.r_[self._at(pair)[1], self._beside(distance)[1]]
        return np.r_[pair, real], 1 / slopes

    def _at(self, u):
        return self._value_and_slope(u, u[:, None] + self.rates)

    def _beside(self, distance):
        """Value and derivative at each rate's own point, `distance` from it."""
        near = self.rates - self.rates[:, None] + distance[:, None]
        return self._value_and_slope(distance - self.rates, near)

    def _value_and_slope(self, u, near):
        """The same from u and u + rates, shape (len(u), number of rates)."""
        memory = self.spring + u * (self.dashpot + (self.weights / near).sum(axis=1))
        change = self.dashpot + (self.weights * self.rates / near**2).sum(axis=1)
        if self.order < 1:
            return u * u + memory + 1, 2 * u + change
        return u * u + u * memory + 1, 2 * u + memory + u * change
