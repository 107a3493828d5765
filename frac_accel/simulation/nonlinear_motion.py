r"""Nonlinear motion of an oscillator, as a deviation from its linear motion, compiled.

With :math:`q = q_{lin} + d` the equation of motion leaves, in the time :math:`\tau = \omega_0 t`,

.. math:: d'' + 2 \zeta D^\nu d + d = -N(q_{lin} + d, q'_{lin} + d')

which the modes of the oscillator (`modes`) turn into uncoupled equations y' = pole y - residue N.
Their step is exact for an N that is a parabola through its values at the step's ends and middle
(exponential collocation: M. Hochbruck, A. Ostermann, Acta Numerica 19 (2010) 209-286, section 2.2);
these values are found by fixed-point iteration. Without nonlinear terms d is zero to the last bit.

With Coulomb friction, `friction_motion` follows the mass.

This module needs numba; it is imported when a nonlinear model is simulated.
"""

import functools
import warnings

import numba
import numpy as np
from numba import types

from ..model.core.static_force import no_force
from .exponential_step import (
    advance,
    beyond,
    derivative,
    displace,
    fast,
    follow_laws,
    look,
    power_terms,
    prepare,
    slip,
)
from .friction_motion import integrate_with_friction


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
    return integrate_with_friction(poles, residues, displacement, velocity, pairs, modes.mass,
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


@fast
def _integrate(poles, residues, of_displacement, pairs, terms, parameters, functions, count,
               constants, begin, step, motion, middles, start):
    m = len(poles)
    rows, gains, sums, now = (np.empty((12, m)), np.empty((6, m)), np.empty((2, 3, 3)),
                              np.empty((6, m)))
    free = np.zeros((2, 3))
    real, imaginary = np.zeros(m), np.zeros(m)
    prepare(step, poles, residues, pairs, rows, gains, sums)
    displace(poles, now, real, imaginary, start, of_displacement)
    orders = motion.shape[0]
    result = np.full(motion.shape[1], np.nan)
    result[0] = start
    q0, v0, z = motion[0, 0] + start, motion[1, 0] if orders > 1 else 0.0, 0.0
    states = np.zeros((3, len(functions)))
    states[0] = begin
    n0 = power_terms(terms, q0) + follow_laws(functions, count, constants, states[0], states[0],
                                              q0, v0, q0, v0, 0.0)
    nm, ne = n0, n0
    for index in range(motion.shape[1] - 1):
        look(rows, real, imaginary, pairs, motion, middles, index, orders, free)
        nextm, nexte = beyond(n0, nm, ne)
        n0 = ne
        nm, ne, z = slip(free, sums, step, n0, q0, v0, z, nextm, nexte, 0.0, terms, parameters,
                         functions, count, constants, states)
        if count:
            states[0] = states[2]
        q0 = derivative(free, sums, 1, 0, n0, nm, ne)
        if orders > 1:
            v0 = derivative(free, sums, 1, 1, n0, nm, ne)
        advance(rows, gains, real, imaginary, pairs, n0, nm, ne)
        if not np.isfinite(q0):
            break
        result[index + 1] = q0 - motion[0, index + 1]
    return result
