r"""Time-stepping integration of the seismic system, from rest.

.. math:: q'' + 2 \zeta \omega_0^{2-\nu} D^\nu q
          + \omega_0^2 (q + \alpha_2 q^2 + \alpha_3 q^3 + \lambda z + c\,\mathrm{sgn}\,q')
          = \omega_0^2 S a, \qquad z' = q' - \beta |q'| z - \gamma q' |z|

A step spans two samples of the high-rate grid and is a three-point Lobatto IIIA collocation
(Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, II.7): the acceleration
q'' is the parabola through its values at the two ends and in the middle, which the equation of
motion determines. It is of order 4 with a frequency error of (w H)**4 / 720, has no numerical
damping, and needs no history, so that a step may be split where the friction reverses. The modes of
the fractional derivative (`fractional_operator`) answer to the parabola exactly, however fast
they are.

The Bouc-Wen variable z is advanced exactly along the path of q (`bouc_wen`). Coulomb friction is
the set-valued law (Filippov): at each reversal, found on the step's own polynomial, the mass
sticks until the other forces exceed the Coulomb level.

A stop is a further spring, :math:`\kappa` times as stiff, that acts on what q exceeds the stop's
place by; a step is split where q comes to it or leaves it.

With a drift, :math:`\omega_0 (1 + r t)` stands in every place of :math:`\omega_0`; quadratic
damping adds :math:`d\, q' |q'| / \omega_0^2` to the spring's bracket. Both are taken into the
iteration that solves for the nonlinear spring, on top of the constant linear part.
"""

import dataclasses

import numba
import numpy as np

from . import bouc_wen
from .fractional_operator import diffusive_derivative

POWERS = 4              # coefficients of the cubic that a velocity is over a step
MAX_SPLITS = 20         # reversals within one step
FIXED_POINT_PASSES = 30
SHORTEST_SPLIT = 1e-7   # of a step


@dataclasses.dataclass(frozen=True)
class Motion:
    """Output q [output units] and its rate of change v [output units/s] on the grid."""

    q: np.ndarray
    v: np.ndarray


def integrate(acceleration, step_s, natural_frequency_hz, damping_ratio, damping_order=1.0,
              sensitivity=1.0, alpha2=0.0, alpha3=0.0, coulomb_level=0.0,
              hysteresis=(0.0, 0.0, 0.0), stop=(-np.inf, np.inf, 0.0), quadratic_damping=0.0,
              drift=(0.0, 0.0)):
    """Integrate the equation at the top of this file.

    Parameters
    ----------
    acceleration : ndarray, shape (2 m + 1,)
        Base acceleration [m/s²] on the grid, zero and smooth at its start.
    step_s : float
        The grid's spacing [s].
    hysteresis : tuple of float
        Strength (lambda), beta and gamma.
    stop : tuple of float
        Places of the lower and the upper stop [output units], and their stiffness over the spring's
        (kappa).
    quadratic_damping : float
        d [1/output units].
    drift : tuple of float
        Rate r of the natural frequency [1/s] and the time t of the grid's first point [s]; needs
        classical damping and no friction.

    Returns
    -------
    Motion
    """
    if len(acceleration) % 2 == 0:
        raise ValueError(f"{len(acceleration)} grid points: expected an odd number")
    if drift[0] and (damping_order != 1 or coulomb_level):
        raise ValueError("a drifting natural frequency needs classical damping and no friction")
    natural = 2 * np.pi * natural_frequency_hz
    derivative = diffusive_derivative(
        damping_order, 1 / (len(acceleration) * step_s), max(natural, 0.05 / step_s))
    physics = np.array([natural ** 2, 2 * damping_ratio * natural ** (2 - damping_order),
                        derivative.low, derivative.high, alpha2, alpha3, coulomb_level,
                        *hysteresis, *stop, quadratic_damping, *drift])
    force = sensitivity * np.ascontiguousarray(acceleration, dtype=float)
    if drift[0]:
        force *= (1 + drift[0] * (drift[1] + step_s * np.arange(len(force)))) ** 2
    q, v = _integrate(force, 2 * step_s, derivative.acts_on_velocity, derivative.rates,
                      derivative.weights, physics)
    if not np.isfinite(q[-1]):
        raise FloatingPointError("the motion grows without bound")
    return Motion(q, v)


@numba.njit(cache=True)
def _memory_response(rate, length, moments):
    """moments[k] = integral over the step of exp(-rate (length - t)) (t / length)**k dt."""
    x = rate * length
    if x > 1:
        value = -np.expm1(-x) / x
        moments[0] = length * value
        for k in range(1, POWERS):
            value = (1 - k * value) / x
            moments[k] = length * value
    else:
        for k in range(POWERS):
            term = 1.0 / (k + 1)
            value = term
            for i in range(1, 20):
                term *= -x / (k + 1 + i)
                value += term
            moments[k] = length * value


@numba.njit(cache=True)
def _prepare(length, on_velocity, rates, weights, physics):
    """Everything about a step that depends only on its length.

    Returns the modes' decay and moments over the full step, their weighted decay up to the middle
    and to the end, the weighted moments (2, POWERS), and the matrix (2, 3) of the equation of
    motion at the middle and the end on q'' at the start, middle and end.
    """
    stiffness, damping, low, high = physics[0], physics[1], physics[2], physics[3]
    n = len(rates)
    decay = np.exp(-rates * length)
    seen = np.empty((2, n))
    moments = np.empty((POWERS, n))
    sums = np.zeros((2, POWERS))
    scratch = np.empty(POWERS)
    for j in range(n):
        seen[0, j] = weights[j] * np.exp(-rates[j] * length / 2)
        seen[1, j] = weights[j] * decay[j]
        _memory_response(rates[j], length / 2, scratch)
        for k in range(POWERS):
            sums[0, k] += weights[j] * scratch[k] * 0.5 ** k
        _memory_response(rates[j], length, scratch)
        for k in range(POWERS):
            sums[1, k] += weights[j] * scratch[k]
            moments[k, j] = scratch[k]
    matrix = np.empty((2, 3))
    for i in range(2):
        x = 0.5 * (i + 1)
        row = np.empty(3)
        for k in range(3):  # of q'' = sum of c_k x**k
            u = x ** k
            v = length * x ** (k + 1) / (k + 1)
            q = length ** 2 * x ** (k + 2) / ((k + 1) * (k + 2))
            if on_velocity:
                fractional = low * v + sums[i, k] + high * u
            else:
                fractional = low * q + length * sums[i, k + 1] / (k + 1) + high * v
            row[k] = u + stiffness * q + damping * fractional
        matrix[i, 0] = row[0] - 3 * row[1] + 2 * row[2]
        matrix[i, 1] = 4 * row[1] - 4 * row[2]
        matrix[i, 2] = -row[1] + 2 * row[2]
    return decay, moments, seen, sums, matrix


@numba.njit(cache=True)
def _velocity(x, length, v0, c0, c1, c2):
    return v0 + length * x * (c0 + x * (c1 / 2 + x * c2 / 3))


@numba.njit(cache=True)
def _displacement(x, length, q0, v0, c0, c1, c2):
    return q0 + length * x * (v0 + length * x * (c0 / 2 + x * (c1 / 6 + x * c2 / 12)))


@numba.njit(cache=True)
def _at(values, index):
    """Values between the grid points, by the polynomial through the six nearest."""
    first = min(max(int(np.floor(index)) - 2, 0), len(values) - 6)
    total = 0.0
    for i in range(first, first + 6):
        term = values[i]
        for j in range(first, first + 6):
            if j != i:
                term *= (index - j) / (i - j)
        total += term
    return total


@numba.njit(cache=True)
def _restoring(q, v, z, now, physics):
    """Restoring force over the stiffness, without its constant linear part and friction."""
    beyond = min(q - physics[10], 0.0) + max(q - physics[11], 0.0)
    force = q * q * (physics[4] + physics[5] * q) + physics[7] * z + physics[12] * beyond
    if physics[14] != 0:
        more = physics[14] * now  # relative change of the natural frequency
        force = ((1 + more) ** 2 * force + (2 + more) * more * q
                 + more * physics[1] / physics[0] * v)
    return force + physics[13] * v * abs(v) / physics[0]


@numba.njit(cache=True)
def _drive(force, q, v, z, phi, weights, on_velocity, physics):
    """q'' that all forces but friction would give now."""
    stiffness, damping, low, high = physics[0], physics[1], physics[2], physics[3]
    memory = 0.0
    for j in range(len(phi)):
        memory += weights[j] * phi[j]
    if on_velocity:
        memory += low * v
        mass = 1 + damping * high
    else:
        memory += low * q + high * v
        mass = 1.0
    return (stiffness * (force - q - _restoring(q, v, z, 0.0, physics)) - damping * memory) / mass


@numba.njit(cache=True, fastmath={"reassoc", "contract"})
def _advance_modes(phi, decay, moments, p0, p1, p2, p3):
    for j in range(len(phi)):
        phi[j] = (decay[j] * phi[j] + p0 * moments[0, j] + p1 * moments[1, j]
                  + p2 * moments[2, j] + p3 * moments[3, j])


@numba.njit(cache=True, fastmath={"reassoc", "contract"})
def _weighted_memory(phi, seen):
    middle = 0.0
    end = 0.0
    for j in range(len(phi)):
        middle += seen[0, j] * phi[j]
        end += seen[1, j] * phi[j]
    return middle, end


@numba.njit(cache=True)
def _solve(now, length, state, phi, slip, force_middle, force_end, prepared, on_velocity,
           physics):
    """q'' over one step as the coefficients of its parabola, and z in the middle and at the end."""
    stiffness, damping, low, high = physics[0], physics[1], physics[2], physics[3]
    q0, v0, u0, z0 = state
    _, _, seen, sums, matrix = prepared
    middle, end = _weighted_memory(phi, seen)
    if on_velocity:
        middle += low * v0
        end += low * v0
    else:
        middle += low * (q0 + length / 2 * v0) + (sums[0, 0] + high) * v0
        end += low * (q0 + length * v0) + (sums[1, 0] + high) * v0
    friction = physics[6] * slip
    known_middle = (stiffness * (force_middle - friction - q0 - length / 2 * v0)
                    - damping * middle - matrix[0, 0] * u0)
    known_end = (stiffness * (force_end - friction - q0 - length * v0)
                 - damping * end - matrix[1, 0] * u0)
    determinant = matrix[0, 1] * matrix[1, 2] - matrix[0, 2] * matrix[1, 1]
    nonlinear = (physics[4] != 0 or physics[5] != 0 or physics[7] != 0 or physics[12] != 0
                 or physics[13] != 0 or physics[14] != 0)
    c1, c2, zm, z1 = 0.0, 0.0, z0, z0
    for _ in range(FIXED_POINT_PASSES if nonlinear else 1):
        right_middle, right_end = known_middle, known_end
        if nonlinear:
            vm = _velocity(0.5, length, v0, u0, c1, c2)
            v1 = _velocity(1.0, length, v0, u0, c1, c2)
            qm = _displacement(0.5, length, q0, v0, u0, c1, c2)
            q1 = _displacement(1.0, length, q0, v0, u0, c1, c2)
            if physics[7] != 0:
                zm = bouc_wen.advance(z0, q0, v0, qm, vm, length / 2, physics[8], physics[9])
                z1 = bouc_wen.advance(zm, qm, vm, q1, v1, length / 2, physics[8], physics[9])
            right_middle -= stiffness * _restoring(qm, vm, zm, now + length / 2, physics)
            right_end -= stiffness * _restoring(q1, v1, z1, now + length, physics)
        um = (right_middle * matrix[1, 2] - right_end * matrix[0, 2]) / determinant
        u1 = (right_end * matrix[0, 1] - right_middle * matrix[1, 1]) / determinant
        before1, before2 = c1, c2
        c1 = -3 * u0 + 4 * um - u1
        c2 = 2 * u0 - 4 * um + 2 * u1
        if abs(c1 - before1) + abs(c2 - before2) <= 1e-12 * (abs(u0) + abs(um) + abs(u1)):
            break
    return c1, c2, zm, z1


@numba.njit(cache=True)
def _reversal(length, v0, u0, c1, c2, slip):
    """Fraction of the step at which the velocity leaves the direction `slip`; above 1: nowhere."""
    low = 0.0
    for high in (0.5, 1.0):
        if _velocity(high, length, v0, u0, c1, c2) * slip < 0:
            for _ in range(60):
                x = (low + high) / 2
                if _velocity(x, length, v0, u0, c1, c2) * slip < 0:
                    high = x
                else:
                    low = x
            return high
        low = high
    return 2.0


@numba.njit(cache=True)
def _contact(length, q0, v0, u0, c1, c2, place):
    """Fraction of the step at which q passes the stop's place; above 1: nowhere."""
    side = q0 - place
    if (_displacement(1.0, length, q0, v0, u0, c1, c2) - place) * side >= 0:
        return 2.0
    low, high = 0.0, 1.0
    for _ in range(60):
        x = (low + high) / 2
        if (_displacement(x, length, q0, v0, u0, c1, c2) - place) * side < 0:
            high = x
        else:
            low = x
    return high if high > SHORTEST_SPLIT else 2.0  # where the step begins at the stop


@numba.njit(cache=True)
def _stuck_until(position, left, excess_force, index, grid, state, phi, rates, weights,
                 on_velocity, physics, step):
    """Fraction of the whole step at which the forces on the stuck mass overcome friction."""
    low, high = position, position + left
    for _ in range(40):
        x = (low + high) / 2
        faded = phi * np.exp(-rates * (x - position) * step)
        drive = _drive(_at(grid, index + 2 * x), state[0], 0.0, state[3], faded, weights,
                       on_velocity, physics)
        if abs(drive) > excess_force:
            high = x
        else:
            low = x
    return high


@numba.njit(cache=True)
def _integrate(grid, step, on_velocity, rates, weights, physics):
    n = len(grid)
    q = np.zeros(n)
    v = np.zeros(n)
    phi = np.zeros(len(rates))
    whole = _prepare(step, on_velocity, rates, weights, physics)
    has_friction = physics[6] != 0
    has_stop = physics[12] != 0
    mass = 1 + (physics[1] * physics[3] if on_velocity else 0.0)
    level = physics[0] * physics[6] / mass  # q'' that friction can hold or takes away
    slip = 0.0
    state = (0.0, 0.0, 0.0 if has_friction else physics[0] * grid[0] / mass, 0.0)
    for index in range(0, n - 2, 2):
        position = 0.0
        for split in range(MAX_SPLITS):
            left = 1 - position
            length = left * step
            force_middle = grid[index + 1] if split == 0 else _at(grid, index + 1 + position)
            q0, v0, u0, z0 = state
            if has_friction and slip == 0:
                ending = phi * np.exp(-rates * length)
                drive = _drive(grid[index + 2], q0, 0.0, z0, ending, weights, on_velocity, physics)
                release = 2.0
                if abs(drive) > level:
                    release = _stuck_until(position, left, level, index, grid, state, phi, rates,
                                           weights, on_velocity, physics, step)
                if position < 0.5 <= release:
                    q[index + 1] = q0
                if release > 1:
                    phi = ending
                    break
                phi = phi * np.exp(-rates * (release - position) * step)
                slip = np.sign(drive)
                position = release
                state = (q0, 0.0, 0.0, z0)
                if 1 - position < SHORTEST_SPLIT:
                    break
                continue
            prepared = whole if split == 0 else _prepare(length, on_velocity, rates, weights,
                                                         physics)
            now = physics[15] + (index / 2 + position) * step
            c1, c2, zm, z1 = _solve(now, length, state, phi, slip, force_middle, grid[index + 2],
                                    prepared, on_velocity, physics)
            share = 2.0
            if has_friction and split < MAX_SPLITS - 1:
                share = _reversal(length, v0, u0, c1, c2, slip)
            reversal = share
            if has_stop and split < MAX_SPLITS - 1:
                for place in physics[10:12]:
                    share = min(share, _contact(length, q0, v0, u0, c1, c2, place))
            if share < 1:
                length *= share
                prepared = _prepare(length, on_velocity, rates, weights, physics)
                c1, c2, zm, z1 = _solve(now, length, state, phi, slip,
                                        _at(grid, index + 2 * position + left * share),
                                        _at(grid, index + 2 * (position + left * share)),
                                        prepared, on_velocity, physics)
                left *= share
            if position < 0.5 <= position + left:
                x = (0.5 - position) / left
                q[index + 1] = _displacement(x, length, q0, v0, u0, c1, c2)
                v[index + 1] = _velocity(x, length, v0, u0, c1, c2)
            if on_velocity:
                _advance_modes(phi, prepared[0], prepared[1], u0, c1, c2, 0.0)
            else:
                _advance_modes(phi, prepared[0], prepared[1], v0, length * u0, length * c1 / 2,
                               length * c2 / 3)
            q1 = _displacement(1.0, length, q0, v0, u0, c1, c2)
            if share > 1:
                state = (q1, _velocity(1.0, length, v0, u0, c1, c2), u0 + c1 + c2, z1)
                break
            position += left
            if share < reversal:
                state = (q1, _velocity(1.0, length, v0, u0, c1, c2), u0 + c1 + c2, z1)
            else:
                drive = _drive(_at(grid, index + 2 * position), q1, 0.0, z1, phi, weights,
                               on_velocity, physics)
                slip = 0.0 if abs(drive) <= level else np.sign(drive)
                state = (q1, 0.0, drive - level * slip if slip else 0.0, z1)
            if 1 - position < SHORTEST_SPLIT:
                break
        q[index + 2], v[index + 2] = state[0], state[1]
        if not np.isfinite(state[0]):
            q[-1] = np.nan
            break
    return q, v
