"""Functions sum(c_i s**v_i) of real orders: their zeros on the principal sheet |arg s| <= pi."""

import numpy as np


def evaluate(coefficients, orders, s):
    """sum(c_i s**v_i) at complex `s` (any shape)."""
    s = np.asarray(s, complex)
    total = np.zeros(s.shape, complex)
    for coefficient, order in zip(coefficients, orders):
        total += coefficient * (s**order if order else 1.0)
    return total


def fractional_root(coefficients, orders):
    """Zero in the open upper half of the principal sheet that is nearest to the imaginary axis.

    Returns
    -------
    complex or None
        None where there is none: a strongly damped fractional sensor has no resonant mode.
    """
    scale = time_scales(coefficients, orders)
    derivative = np.multiply(coefficients, orders), np.subtract(orders, 1.0)
    angles, radii = np.meshgrid(np.pi * np.array([0.5, 0.6, 0.75, 0.9]), scale)
    s = (radii * np.exp(1j * angles)).ravel()
    with np.errstate(all="ignore"):
        for _ in range(60):
            step = evaluate(coefficients, orders, s) / evaluate(*derivative, s)
            far, size = np.abs(step), np.abs(s)
            s = s - step * np.minimum(1, 0.5 * size / far)
            if not np.any((far > 1e-15 * size) & (s.imag > 0)):
                break
        residual = np.abs(evaluate(coefficients, orders, s))
        size = evaluate(np.abs(coefficients), orders, np.abs(s)).real
    found = s[np.isfinite(residual) & (residual < 1e-10 * size) & (s.imag > 1e-9 * np.abs(s))]
    return found[np.argmax(found.real / np.abs(found))] if found.size else None


def count_right_half_plane_zeros(coefficients, orders):
    """Number of zeros with positive real part, by the argument principle.

    Along ``s = j w`` from 0 to infinity the phase of the function grows by
    ``(max order - min order) pi / 2``, less ``pi`` for each zero in the right half-plane.
    A zero on the axis itself counts as half a zero or more.
    """
    orders = np.asarray(orders, float)
    present = np.flatnonzero(coefficients)
    scale = time_scales(np.asarray(coefficients)[present], orders[present])
    omega = np.geomspace(scale[0] * 1e-6, scale[-1] * 1e6, 400_000)
    values = evaluate(coefficients, orders, 1j * omega)
    ends = evaluate(coefficients, orders, 1j * omega[[0, -1]])
    highest, lowest = present[np.argmax(orders[present])], present[np.argmin(orders[present])]
    steps = np.angle(values[1:] / values[:-1])
    # half a turn at once is a zero on the axis, to the grid's resolution: not a stable one
    growth = np.where(np.abs(steps) > 3, -np.abs(steps), steps).sum()
    # what the arcs outside the grid still add
    growth += np.angle(coefficients[highest] * (1j)**orders[highest] / ends[1])
    growth -= np.angle(coefficients[lowest] * (1j)**orders[lowest] / ends[0])
    return ((orders[highest] - orders[lowest]) * np.pi / 2 - growth) / np.pi


def time_scales(coefficients, orders):
    """Radii [rad/s] at which two terms are equal in size: where zeros can lie."""
    radii = [abs(a / b)**(1 / (v - u))
             for i, (a, u) in enumerate(zip(coefficients, orders))
             for b, v in list(zip(coefficients, orders))[i + 1:]
             if a and b and u != v]
    return np.sort(radii) if radii else np.array([1.0])
