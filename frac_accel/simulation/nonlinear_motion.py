r"""Nonlinear motion of an oscillator, as a deviation from its linear motion, compiled.

With :math:`q = q_{lin} + d` the equation of motion leaves, in the time :math:`\tau = \omega_0 t`,

.. math:: d'' + 2 \zeta D^\nu d + d = -N(q_{lin} + d, q'_{lin} + d')

which the modes of the oscillator (`modes`) turn into uncoupled equations y' = pole y - residue N.
Their step is exact for an N that is a parabola through its values at the step's ends and middle
(exponential collocation: M. Hochbruck, A. Ostermann, Acta Numerica 19 (2010) 209-286, section 2.2);
these values are found by fixed-point iteration. Without nonlinear terms d is zero to the last bit.

Coulomb friction is the set-valued law of A. F. Filippov (1988). A step is split where the velocity
turns and where the mass breaks loose. While it sticks, the force N that holds it is unknown, and
follows from an acceleration of zero.

This module needs numba; it is imported when a nonlinear model is simulated.
"""

import functools
import warnings

import numba
import numpy as np
from numba import types

from ..model.core.bouc_wen import follow_one_way
from ..model.core.static_force import no_force
from . import compiling

# Iterations of a step at most, and the change of the force at which they end.
_PASSES = 40
_CONVERGED = 1e-7      # of the force
_SPLITS = 12            # of one step
_SHORTEST = 1e-9        # part of a step that is none
_TURN_PASSES = 4
_TURNED = 1e-4          # of a step, the permitted error of a turn
_HALVINGS, _SECANTS = 5, 3  # of a step where a turn is looked for

compiling.watch()
_fast = numba.njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract"})
_exact = numba.njit(cache=True, error_model="numpy", fastmath={"contract"})
_inlined = numba.njit(cache=True, error_model="numpy", inline="always", fastmath={"contract"})

_follow_one_way = _inlined(follow_one_way)


def deviation(modes, force, step, motion, start, elapsed=0.0):
    r"""Deviation d of the output on the grid.

    Parameters
    ----------
    modes : Modes
    force : StaticForce
    step : float
        Spacing of the grid in :math:`\tau`.
    motion : ndarray, shape (k, n)
        Linear motion and its derivatives by :math:`\tau` on the grid, at least eight points:
        `derivatives_needed` more than one.
    start : float
        Deviation at the start, where the sensor is at rest.
    elapsed : float
        Time since the record's start at the grid's first point, in :math:`\tau`.

    Returns
    -------
    ndarray, shape (n,)
        Its end is NaN where the motion grows without bound.
    """
    order = np.argsort(modes.poles.imag == 0, kind="stable")  # the complex one first
    pairs = int(np.sum(modes.poles.imag != 0))
    poles, residues, displacement, velocity = (
        np.ascontiguousarray(part[order]) for part in
        (modes.poles, modes.residues, modes.of_displacement, modes.of_velocity))
    terms = np.array(force.polynomial[::-1], float)
    parameters = np.array([force.friction_level, force.strength, force.beta, force.gamma])
    laws = _compiled_laws(force.laws, elapsed)
    middles = _middles(motion)
    if force.friction_level == 0:
        return _integrate(poles, residues, displacement, pairs, terms, parameters, *laws, step,
                          motion, middles, start)
    return _integrate_with_friction(poles, residues, displacement, velocity, pairs, modes.mass,
                                    terms, parameters, *laws, step, motion, middles, start)


def derivatives_needed(force):
    """Derivatives of the linear motion that `deviation` needs."""
    return 2 if force.friction_level != 0 else 1 if force.strength != 0 or force.laws else 0


# functions as arguments are new in numba, and do what is needed
warnings.simplefilter("ignore", numba.NumbaExperimentalFeatureWarning)
_LAW = types.UniTuple(types.float64, 2)(*[types.float64] * 6, types.float64[::1])


@functools.cache
def _compiled_law(function):
    return numba.cfunc(_LAW, cache=True, error_model="numpy")(function)


def _compiled_laws(laws, elapsed):
    """Functions (at least one), their number, the parameters of each in a row, their states."""
    functions = tuple(_compiled_law(law.function) for law in laws)
    rows = [np.array(law.parameters, float) for law in laws]
    width = max((len(row) for row in rows), default=1)
    parameters = np.zeros((max(len(rows), 1), max(width, 1)))
    for i, row in enumerate(rows):
        parameters[i, :len(row)] = row
    begin = np.array([elapsed if law.timed else 0.0 for law in laws] or [0.0])
    return functions or (_compiled_law(no_force),), len(functions), parameters, begin


def _middles(motion):
    """Values between neighbours, by the polynomial through the six nearest."""
    padded = np.pad(motion, ((0, 0), (2, 2)), mode="reflect", reflect_type="odd")
    count = motion.shape[1] - 1
    f = [padded[:, i:i + count] for i in range(6)]
    # (150 (f2 + f3) - 25 (f1 + f4) + 3 (f0 + f5)) / 256, with as few arrays as that takes
    total, pair = f[2] + f[3], f[1] + f[4]
    total *= 150
    pair *= 25
    total -= pair
    np.add(f[0], f[5], out=pair)
    pair *= 3
    total += pair
    total /= 256
    return total


@_inlined
def _moments(z):
    """Integrals over x from 0 to 1 of exp(z (1 - x)) x**k, for k = 0, 1, 2; and exp(z)."""
    if abs(z) > 0.5:
        whole = np.exp(z)
        m0 = (whole - 1) / z
        m1 = (m0 - 1) / z
        return m0, m1, (2 * m1 - 1) / z, whole
    # sum of z**i 2 / (i + 3)!, and from it m[k - 1] = (1 + z m[k]) / k
    square = z * z
    rest = square * square * (1 / 19958400 + z * (1 / 239500800)
                              + square * (1 / 3113510400 + z * (1 / 43589145600)))
    rest = square * square * (1 / 2520 + z * (1 / 20160)
                              + square * (1 / 181440 + z * (1 / 1814400)) + rest)
    m2 = 1 / 3 + z * (1 / 12) + square * (1 / 60 + z * (1 / 360)) + rest
    m1 = (1 + z * m2) / 2
    m0 = 1 + z * m1
    return m0, m1, m2, 1 + z * m0


@_inlined
def _twice_as_far(m0, m1, m2, half):
    """The moments of 2 z from those of z."""
    return ((half + 1) * m0 / 2, ((half + 1) * m1 + m0) / 4,
            ((half + 1) * m2 + m0 + 2 * m1) / 8, half * half)


@_inlined
def _prepare_mode(j, length, pole, residue, rows, gains, sums):
    m0, m1, m2, decay = _moments(pole * length / 2)
    for i in range(2):
        part = 0.5 * (i + 1)
        if i == 1:
            m0, m1, m2, decay = _twice_as_far(m0, m1, m2, decay)
        scale = residue * part * length
        g1, g2 = scale * part * m1, scale * part * part * m2
        # of the parabola's coefficients, then of its values at the start, the middle and the end
        g0, g1, g2 = scale * m0 - 3 * g1 + 2 * g2, 4 * (g1 - g2), 2 * g2 - g1
        if i == 1:
            gains[0, j], gains[1, j] = g0.real, g0.imag
            gains[2, j], gains[3, j] = g1.real, g1.imag
            gains[4, j], gains[5, j] = g2.real, g2.imag
        factor = decay
        for p in range(3):
            rows[6 * i + 2 * p, j], rows[6 * i + 2 * p + 1, j] = factor.real, factor.imag
            sums[i, p, 0] += g0.real
            sums[i, p, 1] += g1.real
            sums[i, p, 2] += g2.real
            factor, g0, g1, g2 = factor * pole, g0 * pole, g1 * pole, g2 * pole


@_exact
def _prepare(length, poles, residues, pairs, rows, gains, sums):
    """All about a step that depends only on its length.

    rows (12, m): what d, d' and d'' in the middle, then at the end, see of each state, real and
    imaginary part; sums (2, 3, 3): and of the force at the start, in the middle and at the end;
    gains (6, m): change of each state by these, real and imaginary part.
    """
    sums[:] = 0.0
    for j in range(pairs):
        _prepare_mode(j, length, poles[j], residues[j], rows, gains, sums)
    for j in range(pairs, len(poles)):
        _prepare_mode(j, length, poles[j].real, residues[j].real, rows, gains, sums)


@_inlined
def _seen(rows, row, real, imaginary, pairs):
    """Real part of the sum of the states, each times its factor in a row (and the next)."""
    total = 0.0
    for j in range(len(real)):
        total += rows[row, j] * real[j]
    for j in range(pairs):
        total -= rows[row + 1, j] * imaginary[j]
    return total


@_inlined
def _advance(rows, gains, real, imaginary, pairs, n0, nm, ne):
    """Move the states to the end of a step with the parabola through n0, nm and ne."""
    for j in range(pairs):
        before = real[j]
        real[j] = (rows[6, j] * before - rows[7, j] * imaginary[j]
                   - (gains[0, j] * n0 + gains[2, j] * nm + gains[4, j] * ne))
        imaginary[j] = (rows[6, j] * imaginary[j] + rows[7, j] * before
                        - (gains[1, j] * n0 + gains[3, j] * nm + gains[5, j] * ne))
    for j in range(pairs, len(real)):
        real[j] = rows[6, j] * real[j] - (gains[0, j] * n0 + gains[2, j] * nm + gains[4, j] * ne)


@_exact
def _add(real, imaginary, share, states):
    for j in range(len(real)):
        real[j] += share * states[j].real
        imaginary[j] += share * states[j].imag


@_inlined
def _parabola(n0, nm, ne, x):
    """Value at x of the parabola through n0, nm and ne at 0, 1/2 and 1."""
    return n0 + x * (4 * nm - 3 * n0 - ne + x * (2 * n0 - 4 * nm + 2 * ne))


@_inlined
def _between(motion, index, part):
    """Motion `part` of an interval after a grid point: by a polynomial through six points."""
    first = min(max(index - 2, 0), motion.shape[1] - 6)
    x0 = index - first + part
    x1, x2, x3, x4, x5 = x0 - 1, x0 - 2, x0 - 3, x0 - 4, x0 - 5
    front, centre, back = x0 * x1, x2 * x3, x4 * x5
    w0, w1 = -x1 * centre * back / 120, x0 * centre * back / 24
    w2, w3 = -front * x3 * back / 12, front * x2 * back / 12
    w4, w5 = -front * centre * x5 / 24, front * centre * x4 / 120
    return (_weighted(motion, 0, first, w0, w1, w2, w3, w4, w5),
            _weighted(motion, 1, first, w0, w1, w2, w3, w4, w5),
            _weighted(motion, 2, first, w0, w1, w2, w3, w4, w5))


@_inlined
def _weighted(motion, order, i, w0, w1, w2, w3, w4, w5):
    return (w0 * motion[order, i] + w1 * motion[order, i + 1] + w2 * motion[order, i + 2]
            + w3 * motion[order, i + 3] + w4 * motion[order, i + 4] + w5 * motion[order, i + 5])


@_inlined
def _power_terms(terms, q):
    total = 0.0
    for coefficient in terms:
        total = (total + coefficient) * q
    return total * q


@_inlined
def _follow(z, q0, v0, q1, v1, duration, beta, gamma):
    """Bouc-Wen variable after q has gone from q0 to q1 with the velocities v0 and v1 at the ends.

    If the velocity turns on the way, it is taken as linear in time.
    """
    if v0 * v1 < 0:
        turn = q0 + 0.5 * duration * v0 * v0 / (v0 - v1)
        z = _follow_one_way(z, turn - q0, beta, gamma)
        return _follow_one_way(z, q1 - turn, beta, gamma)
    return _follow_one_way(z, q1 - q0, beta, gamma)


@_inlined
def _motion(free, sums, i, order, n0, nm, ne):
    """Derivative of the output in the middle (i = 0) or at the end (1) of a step."""
    return (free[i, order] - n0 * sums[i, order, 0]
            - (nm * sums[i, order, 1] + ne * sums[i, order, 2]))


@_inlined
def _beyond(n0, nm, ne):
    """Middle and end of the next step of the same length, if the parabola goes on."""
    return n0 - 3 * nm + 3 * ne, 3 * n0 - 8 * nm + 6 * ne


@_inlined
def _follow_laws(functions, count, constants, states, after, q0, v0, q1, v1, duration):
    """Sum of the further laws' forces after a part of a step; `after`: their states then."""
    total = 0.0
    for i in range(count):
        force, after[i] = functions[i](q0, v0, states[i], q1, v1, duration, constants[i])
        total += force
    return total


@_inlined
def _slip(free, sums, length, n0, q0, v0, z0, nm, ne, friction, terms, parameters, functions,
          count, constants, states):
    """Force in the middle and at the end of a step without a turn, and the hysteresis there.

    free (2, 3): q, q', q'' in the middle and at the end without a force in this step; n0, q0, v0,
    z0: force and motion at the start; nm, ne: a guess; states (3, count): of the further laws at
    the start, and, as found here, in the middle and at the end.
    """
    strength, beta, gamma = parameters[1], parameters[2], parameters[3]
    zm, ze, vm, ve, before = z0, z0, v0, v0, 0.0
    for _ in range(_PASSES):
        qm = _motion(free, sums, 0, 0, n0, nm, ne)
        qe = _motion(free, sums, 1, 0, n0, nm, ne)
        if strength != 0:
            vm = _motion(free, sums, 0, 1, n0, nm, ne)
            ve = _motion(free, sums, 1, 1, n0, nm, ne)
            if v0 * vm >= 0 and vm * ve >= 0:
                zm = _follow_one_way(z0, qm - q0, beta, gamma)
                ze = _follow_one_way(z0, qe - q0, beta, gamma)
            else:
                zm = _follow(z0, q0, v0, qm, vm, length / 2, beta, gamma)
                ze = _follow(zm, qm, vm, qe, ve, length / 2, beta, gamma)
        newm = _power_terms(terms, qm) + strength * zm + friction
        newe = _power_terms(terms, qe) + strength * ze + friction
        if count:
            if strength == 0:
                vm = _motion(free, sums, 0, 1, n0, nm, ne)
                ve = _motion(free, sums, 1, 1, n0, nm, ne)
            newm += _follow_laws(functions, count, constants, states[0], states[1], q0, v0, qm, vm,
                                 length / 2)
            newe += _follow_laws(functions, count, constants, states[1], states[2], qm, vm, qe, ve,
                                 length / 2)
        change = abs(newm - nm) + abs(newe - ne)
        nm, ne = newm, newe
        enough = _CONVERGED * (abs(n0) + abs(nm) + abs(ne))
        # changes shrink by a constant factor: what the next one would be
        if change <= enough or change * change <= enough * before:
            break
        before = change
    return nm, ne, ze


@_exact
def _slip_in_part(free, sums, length, n0, q0, v0, z0, nm, ne, friction, terms, parameters,
                  functions, count, constants, states):
    """`_slip` where it is not worth its place in the loop."""
    return _slip(free, sums, length, n0, q0, v0, z0, nm, ne, friction, terms, parameters,
                 functions, count, constants, states)


@_exact
def _stick(free, sums, n0, mass):
    """Force in the middle and at the end of a step that keeps the acceleration at zero."""
    matrix = np.empty((2, 2))
    right = np.empty(2)
    for i in range(2):
        matrix[i, 0], matrix[i, 1] = sums[i, 2, 1], sums[i, 2, 2]
        matrix[i, i] += 1 / mass
        right[i] = free[i, 2] - n0 * sums[i, 2, 0]
    determinant = matrix[0, 0] * matrix[1, 1] - matrix[0, 1] * matrix[1, 0]
    return ((right[0] * matrix[1, 1] - right[1] * matrix[0, 1]) / determinant,
            (right[1] * matrix[0, 0] - right[0] * matrix[1, 0]) / determinant)


@_exact
def _crossing(n0, nm, ne, level):
    """First part of the step at which a parabola leaves the range from -level to level."""
    low, high = 0.0, 1.0
    if abs(nm) > level:
        high = 0.5
    for _ in range(45):
        x = (low + high) / 2
        if abs(_parabola(n0, nm, ne, x)) > level:
            high = x
        else:
            low = x
    return high


@_exact
def _turn(v0, vm, ve, a0, am, ae, slip):
    """First part of a step after which the velocity is against `slip`.

    By the polynomial with the velocities v0, vm, ve and the slopes a0, am, ae at the start, in the
    middle and at the end (Hermite's interpolation by divided differences).
    """
    first, second = 2 * (vm - v0), 2 * (ve - vm)
    c2 = 2 * (first - a0)
    e2, e3, e4 = 2 * (am - first), 2 * (second - am), 2 * (ae - second)
    c3, f2, f3 = 2 * (e2 - c2), e3 - e2, 2 * (e4 - e3)
    c4 = f2 - c3
    c5 = f3 - f2 - c4
    low, high, before, after = 0.0, 1.0, v0 * slip, ve * slip
    if vm * slip < 0:
        high, after = 0.5, vm * slip
    for i in range(_HALVINGS + _SECANTS):
        x = (low + high) / 2
        if i >= _HALVINGS and before > 0:
            x = low + (high - low) * before / (before - after)
        y = x - 0.5
        value = (v0 + x * (a0 + x * (c2 + y * (c3 + y * (c4 + (x - 1) * c5))))) * slip
        if value < 0:
            high, after = x, value
        else:
            low, before = x, value
    return high


@_inlined
def _look(rows, real, imaginary, pairs, motion, middles, index, orders, free):
    """Fill `free` for a whole step."""
    for order in range(orders):
        free[0, order] = middles[order, index] + _seen(rows, 2 * order, real, imaginary, pairs)
        free[1, order] = (motion[order, index + 1]
                          + _seen(rows, 6 + 2 * order, real, imaginary, pairs))


@_exact
def _look_at_part(rows, real, imaginary, pairs, motion, index, position, left, free):
    """Fill `free` for a step of `left` intervals from `position` after a grid point."""
    for i in range(2):
        q, v, a = _between(motion, index, position + (0.5 + 0.5 * i) * left)
        free[i, 0] = q + _seen(rows, 6 * i, real, imaginary, pairs)
        free[i, 1] = v + _seen(rows, 6 * i + 2, real, imaginary, pairs)
        free[i, 2] = a + _seen(rows, 6 * i + 4, real, imaginary, pairs)


@_exact
def _start(poles, now, real, imaginary, start, of_displacement):
    """Fill `now` (6, m): what d, d' and d'' see of the states as they are; displace these."""
    for j in range(len(poles)):
        power = 1 + 0j
        for p in range(3):
            now[2 * p, j], now[2 * p + 1, j] = power.real, power.imag
            power *= poles[j]
    _add(real, imaginary, start, of_displacement)


@_fast
def _integrate(poles, residues, of_displacement, pairs, terms, parameters, functions, count,
               constants, begin, step, motion, middles, start):
    m = len(poles)
    rows, gains, sums, now = (np.empty((12, m)), np.empty((6, m)), np.empty((2, 3, 3)),
                              np.empty((6, m)))
    free = np.zeros((2, 3))
    real, imaginary = np.zeros(m), np.zeros(m)
    _prepare(step, poles, residues, pairs, rows, gains, sums)
    _start(poles, now, real, imaginary, start, of_displacement)
    orders = motion.shape[0]
    result = np.full(motion.shape[1], np.nan)
    result[0] = start
    q0, v0, z = motion[0, 0] + start, motion[1, 0] if orders > 1 else 0.0, 0.0
    states = np.zeros((3, len(functions)))
    states[0] = begin
    n0 = _power_terms(terms, q0) + _follow_laws(functions, count, constants, states[0], states[0],
                                                q0, v0, q0, v0, 0.0)
    nm, ne = n0, n0
    for index in range(motion.shape[1] - 1):
        _look(rows, real, imaginary, pairs, motion, middles, index, orders, free)
        nextm, nexte = _beyond(n0, nm, ne)
        n0 = ne
        nm, ne, z = _slip(free, sums, step, n0, q0, v0, z, nextm, nexte, 0.0, terms, parameters,
                          functions, count, constants, states)
        if count:
            states[0] = states[2]
        q0 = _motion(free, sums, 1, 0, n0, nm, ne)
        if orders > 1:
            v0 = _motion(free, sums, 1, 1, n0, nm, ne)
        _advance(rows, gains, real, imaginary, pairs, n0, nm, ne)
        if not np.isfinite(q0):
            break
        result[index + 1] = q0 - motion[0, index + 1]
    return result


@_fast
def _integrate_with_friction(poles, residues, of_displacement, of_velocity, pairs, mass, terms,
                             parameters, functions, count, constants, begin, step, motion, middles,
                             start):
    m = len(poles)
    rows, gains, sums, now = (np.empty((12, m)), np.empty((6, m)), np.empty((2, 3, 3)),
                              np.empty((6, m)))
    part_rows, part_gains, part_sums = rows.copy(), gains.copy(), sums.copy()
    free = np.zeros((2, 3))
    real, imaginary = np.zeros(m), np.zeros(m)
    _prepare(step, poles, residues, pairs, rows, gains, sums)
    _start(poles, now, real, imaginary, start, of_displacement)
    level, strength = parameters[0], parameters[1]
    result = np.full(motion.shape[1], np.nan)
    result[0] = start
    # a record may start in mid-motion
    q0, v0, z = motion[0, 0] + start, motion[1, 0], 0.0
    slip, sticks = np.sign(v0), v0 == 0
    states = np.zeros((3, len(functions)))
    states[0] = begin
    n0 = level * slip + _power_terms(terms, q0) + _follow_laws(
        functions, count, constants, states[0], states[0], q0, v0, q0, v0, 0.0)
    if sticks:
        n0 = mass * (motion[2, 0] + _seen(now, 4, real, imaginary, pairs))
    last, nm, ne = n0, n0, n0  # force in the last step
    for index in range(motion.shape[1] - 1):
        if not sticks:
            # nearly always it goes on as it went
            _look(rows, real, imaginary, pairs, motion, middles, index, 2, free)
            wholem, wholee = _beyond(last, nm, ne)
            wholem, wholee, wholez = _slip(free, sums, step, n0, q0, v0, z, wholem, wholee,
                                           level * slip, terms, parameters, functions, count,
                                           constants, states)
            vm = _motion(free, sums, 0, 1, n0, wholem, wholee)
            ve = _motion(free, sums, 1, 1, n0, wholem, wholee)
            if vm * slip >= 0 and ve * slip >= 0:
                q0, v0, z = _motion(free, sums, 1, 0, n0, wholem, wholee), ve, wholez
                if count:
                    states[0] = states[2]
                _advance(rows, gains, real, imaginary, pairs, n0, wholem, wholee)
                last, n0, nm, ne = n0, wholee, wholem, wholee
                result[index + 1] = q0 - motion[0, index + 1]
                continue
        position = 0.0
        for split in range(_SPLITS):
            left = 1.0 - position
            r, g, s = rows, gains, sums
            if position == 0:
                _look(r, real, imaginary, pairs, motion, middles, index, 3, free)
            else:
                r, g, s = part_rows, part_gains, part_sums
                _prepare(step * left, poles, residues, pairs, r, g, s)
                _look_at_part(r, real, imaginary, pairs, motion, index, position, left, free)
            smooth = _power_terms(terms, q0) + strength * z + _follow_laws(
                functions, count, constants, states[0], states[1], q0, v0, q0, v0, 0.0)
            changes = False
            if sticks:
                nm, ne = _stick(free, s, n0, mass)
                changes = abs(nm - smooth) > level or abs(ne - smooth) > level
                if changes:
                    share = _crossing(n0 - smooth, nm - smooth, ne - smooth, level)
                    left *= share
                    nm, ne = _parabola(n0, nm, ne, share / 2), _parabola(n0, nm, ne, share)
                    r, g, s = part_rows, part_gains, part_sums
                    _prepare(step * left, poles, residues, pairs, r, g, s)
                if count:
                    _follow_laws(functions, count, constants, states[0], states[1], q0, 0.0, q0,
                                 0.0, step * left)
                    states[0] = states[1]
                qe, ve, _ = _between(motion, index, position + left)
                _advance(r, g, real, imaginary, pairs, n0, nm, ne)
                _add(real, imaginary, q0 - qe - _seen(now, 0, real, imaginary, pairs),
                     of_displacement)
                _add(real, imaginary, -ve - _seen(now, 2, real, imaginary, pairs), of_velocity)
                last, n0 = n0, ne
                if changes:
                    sticks, slip = False, np.sign(n0 - smooth)
                    n0 = smooth + level * slip
                    last, nm, ne = n0, n0, n0
            else:
                friction = level * slip
                z0 = z
                nextm, nexte = _beyond(last, nm, ne)
                nm, ne, z = _slip_in_part(free, s, step * left, n0, q0, v0, z0, nextm, nexte,
                                          friction, terms, parameters, functions, count,
                                          constants, states)
                vm = _motion(free, s, 0, 1, n0, nm, ne)
                ve = _motion(free, s, 1, 1, n0, nm, ne)
                changes = (vm * slip < 0 or ve * slip < 0) and split < _SPLITS - 1
                if changes:
                    # the part of the step after which the velocity is zero
                    _, _, a0 = _between(motion, index, position)
                    a0 += _seen(now, 4, real, imaginary, pairs) - n0 / mass
                    am = _motion(free, s, 0, 2, n0, nm, ne) - nm / mass
                    ae = _motion(free, s, 1, 2, n0, nm, ne) - ne / mass
                    length = step * left
                    share = _turn(v0, vm, ve, length * a0, length * am, length * ae, slip)
                    r, g, s = part_rows, part_gains, part_sums
                    rest, wholem, wholee = left, nm, ne
                    for _ in range(_TURN_PASSES):
                        left = share * rest
                        _prepare(step * left, poles, residues, pairs, r, g, s)
                        _look_at_part(r, real, imaginary, pairs, motion, index, position, left,
                                      free)
                        nm, ne, z = _slip_in_part(free, s, step * left, n0, q0, v0, z0,
                                                  _parabola(n0, wholem, wholee, share / 2),
                                                  _parabola(n0, wholem, wholee, share),
                                                  friction, terms, parameters, functions, count,
                                                  constants, states)
                        vm = _motion(free, s, 0, 1, n0, nm, ne)
                        ve = _motion(free, s, 1, 1, n0, nm, ne)
                        slope = (v0 - 4 * vm + 3 * ve) / share
                        if slope * slip >= 0 or abs(ve) <= _TURNED * abs(slope):
                            break
                        share = min(max(share - ve / slope, 0.1 * share), 1.0)
                q0 = _motion(free, s, 1, 0, n0, nm, ne)
                v0 = ve
                if count:
                    states[0] = states[2]
                _advance(r, g, real, imaginary, pairs, n0, nm, ne)
                last, n0 = n0, ne
                if changes:
                    smooth = _power_terms(terms, q0) + strength * z + _follow_laws(
                        functions, count, constants, states[0], states[1], q0, 0.0, q0, 0.0, 0.0)
                    _, _, ae = _between(motion, index, position + left)
                    n0 = mass * (ae + _seen(now, 4, real, imaginary, pairs))
                    sticks = abs(n0 - smooth) <= level
                    if sticks:
                        _add(real, imaginary, -v0, of_velocity)
                    else:
                        slip = np.sign(n0 - smooth)
                        n0 = smooth + level * slip
                    v0 = 0.0
                    last, nm, ne = n0, n0, n0
            position = position + left if changes else 1.0
            if position > 1 - _SHORTEST:
                break
        if not np.isfinite(q0):
            break
        result[index + 1] = _seen(now, 0, real, imaginary, pairs)
    return result
