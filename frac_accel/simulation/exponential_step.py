r"""One step of the modes of an oscillator with a force, compiled.

The uncoupled equations y' = pole y - residue N of `nonlinear_motion`; the force N is a parabola
through its values at the step's start, in its middle and at its end.
"""

import numba
import numpy as np

from ..model.core.bouc_wen import follow_one_way
from . import compiling

# Iterations of a step at most, and the change of the force at which they end.
_PASSES = 40
_CONVERGED = 1e-7      # of the force

compiling.watch()
fast = numba.njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract"})
exact = numba.njit(cache=True, error_model="numpy", fastmath={"contract"})
inlined = numba.njit(cache=True, error_model="numpy", inline="always", fastmath={"contract"})

_follow_one_way = inlined(follow_one_way)


@inlined
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


@inlined
def _twice_as_far(m0, m1, m2, half):
    """The moments of 2 z from those of z."""
    return ((half + 1) * m0 / 2, ((half + 1) * m1 + m0) / 4,
            ((half + 1) * m2 + m0 + 2 * m1) / 8, half * half)


@inlined
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


@exact
def prepare(length, poles, residues, pairs, rows, gains, sums):
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


@inlined
def seen(rows, row, real, imaginary, pairs):
    """Real part of the sum of the states, each times its factor in a row (and the next)."""
    total = 0.0
    for j in range(len(real)):
        total += rows[row, j] * real[j]
    for j in range(pairs):
        total -= rows[row + 1, j] * imaginary[j]
    return total


@inlined
def advance(rows, gains, real, imaginary, pairs, n0, nm, ne):
    """Move the states to the end of a step with the parabola through n0, nm and ne."""
    for j in range(pairs):
        before = real[j]
        real[j] = (rows[6, j] * before - rows[7, j] * imaginary[j]
                   - (gains[0, j] * n0 + gains[2, j] * nm + gains[4, j] * ne))
        imaginary[j] = (rows[6, j] * imaginary[j] + rows[7, j] * before
                        - (gains[1, j] * n0 + gains[3, j] * nm + gains[5, j] * ne))
    for j in range(pairs, len(real)):
        real[j] = rows[6, j] * real[j] - (gains[0, j] * n0 + gains[2, j] * nm + gains[4, j] * ne)


@exact
def add(real, imaginary, share, states):
    for j in range(len(real)):
        real[j] += share * states[j].real
        imaginary[j] += share * states[j].imag


@inlined
def power_terms(terms, q):
    total = 0.0
    for coefficient in terms:
        total = (total + coefficient) * q
    return total * q


@inlined
def _follow(z, q0, v0, q1, v1, duration, beta, gamma):
    """Bouc-Wen variable after q has gone from q0 to q1 with the velocities v0 and v1 at the ends.

    If the velocity turns on the way, it is taken as linear in time.
    """
    if v0 * v1 < 0:
        turn = q0 + 0.5 * duration * v0 * v0 / (v0 - v1)
        z = _follow_one_way(z, turn - q0, beta, gamma)
        return _follow_one_way(z, q1 - turn, beta, gamma)
    return _follow_one_way(z, q1 - q0, beta, gamma)


@inlined
def derivative(free, sums, i, order, n0, nm, ne):
    """Derivative of the output in the middle (i = 0) or at the end (1) of a step."""
    return (free[i, order] - n0 * sums[i, order, 0]
            - (nm * sums[i, order, 1] + ne * sums[i, order, 2]))


@inlined
def beyond(n0, nm, ne):
    """Middle and end of the next step of the same length, if the parabola goes on."""
    return n0 - 3 * nm + 3 * ne, 3 * n0 - 8 * nm + 6 * ne


@inlined
def follow_laws(functions, count, constants, states, after, q0, v0, q1, v1, duration):
    """Sum of the further laws' forces after a part of a step; `after`: their states then."""
    total = 0.0
    for i in range(count):
        force, after[i] = functions[i](q0, v0, states[i], q1, v1, duration, constants[i])
        total += force
    return total


@inlined
def slip(free, sums, length, n0, q0, v0, z0, nm, ne, friction, terms, parameters, functions,
         count, constants, states):
    """Force in the middle and at the end of a step without a turn, and the hysteresis there.

    free (2, 3): q, q', q'' in the middle and at the end without a force in this step; n0, q0, v0,
    z0: force and motion at the start; nm, ne: a guess; states (3, count): of the further laws at
    the start, and, as found here, in the middle and at the end.
    """
    strength, beta, gamma = parameters[1], parameters[2], parameters[3]
    zm, ze, vm, ve, before = z0, z0, v0, v0, 0.0
    for _ in range(_PASSES):
        qm = derivative(free, sums, 0, 0, n0, nm, ne)
        qe = derivative(free, sums, 1, 0, n0, nm, ne)
        if strength != 0:
            vm = derivative(free, sums, 0, 1, n0, nm, ne)
            ve = derivative(free, sums, 1, 1, n0, nm, ne)
            if v0 * vm >= 0 and vm * ve >= 0:
                zm = _follow_one_way(z0, qm - q0, beta, gamma)
                ze = _follow_one_way(z0, qe - q0, beta, gamma)
            else:
                zm = _follow(z0, q0, v0, qm, vm, length / 2, beta, gamma)
                ze = _follow(zm, qm, vm, qe, ve, length / 2, beta, gamma)
        newm = power_terms(terms, qm) + strength * zm + friction
        newe = power_terms(terms, qe) + strength * ze + friction
        if count:
            if strength == 0:
                vm = derivative(free, sums, 0, 1, n0, nm, ne)
                ve = derivative(free, sums, 1, 1, n0, nm, ne)
            newm += follow_laws(functions, count, constants, states[0], states[1], q0, v0, qm, vm,
                                 length / 2)
            newe += follow_laws(functions, count, constants, states[1], states[2], qm, vm, qe, ve,
                                 length / 2)
        change = abs(newm - nm) + abs(newe - ne)
        nm, ne = newm, newe
        enough = _CONVERGED * (abs(n0) + abs(nm) + abs(ne))
        # changes shrink by a constant factor: what the next one would be
        if change <= enough or change * change <= enough * before:
            break
        before = change
    return nm, ne, ze


@inlined
def look(rows, real, imaginary, pairs, motion, middles, index, orders, free):
    """Fill `free` for a whole step."""
    for order in range(orders):
        free[0, order] = middles[order, index] + seen(rows, 2 * order, real, imaginary, pairs)
        free[1, order] = (motion[order, index + 1]
                          + seen(rows, 6 + 2 * order, real, imaginary, pairs))


@exact
def displace(poles, now, real, imaginary, start, of_displacement):
    """Fill `now` (6, m): what d, d' and d'' see of the states as they are; displace these."""
    for j in range(len(poles)):
        power = 1 + 0j
        for p in range(3):
            now[2 * p, j], now[2 * p + 1, j] = power.real, power.imag
            power *= poles[j]
    add(real, imaginary, start, of_displacement)
