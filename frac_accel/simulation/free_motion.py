"""Motions of a sensor that the time before a record may have left: they fade by its poles."""

import numpy as np
from scipy.optimize import lsq_linear

from ..errors import FracAccelError
from ..model.core.oscillator import tail_rates, tail_sizes

# Logarithm of the size that a fading motion has left where it ends.
_GONE = -60.0
# Time constants that a record must hold: what fades more slowly is hardly a motion of its own.
_FADES = 0.999
# Size of a fading motion, where samples count, below which it is none.
_NOTHING = 1e-9
# Share of the largest singular value below which columns are the same.
_SEEN = 1e-6
# Largest size, where the output is nothing.
_LEAST = 1e-300
# Times the output's level (RMS) that the motion before a record may have been.
_LOUDER = 10.0


def free_motions(model, time_s, counted):
    """Free motions of an axis.

    Behind a high-pass of the reference that is turned back, a constant and a drift are among them:
    the reference has lost both.

    Parameters
    ----------
    model : AxisModel
        With faults of the reference among its effects, if any.
    time_s : ndarray, shape (n,)
        Uniform, from the record's start.
    counted : ndarray of bool, shape (n,)
        Samples that count.

    Returns
    -------
    columns : ndarray, shape (n, m)
    most : ndarray, shape (m,)
        Largest size of each, over the output's level (RMS): without it, decays that stand for a
        faint memory would follow any drift. Infinite where it may be anything.
    """
    try:
        poles = np.atleast_1d(model.poles())
    except (FracAccelError, ArithmeticError):
        poles = np.array([])
    columns, core = fading(poles[poles != 0], time_s, counted), model.effective_core
    if np.any(poles == 0):
        columns = np.c_[columns, np.ones(len(time_s)), time_s / time_s[-1]]
    most = np.full(columns.shape[1], np.inf)
    if getattr(core, "damping_order", 1.0) != 1.0:
        rates = tail_rates(core.natural_frequency_hz, time_s[-1])
        decays = [fading([-rate + 0j], time_s, counted) for rate in rates]
        columns = np.hstack([columns, *decays])
        most = np.r_[most, _LOUDER * np.repeat(tail_sizes(core, rates),
                                               [decay.shape[1] for decay in decays])]
    return columns, most


def shares_within(columns, most, level, values):
    """Sizes of some columns, shape (m,), that describe values best, each at most `most` times a
    level."""
    if not columns.size:
        return np.zeros(columns.shape[1])
    shares = np.linalg.lstsq(columns, values, rcond=_SEEN)[0]
    most = at_level(most, level)
    if np.all(np.abs(shares) <= most):
        return shares
    basis, products = np.linalg.qr(columns)
    return lsq_linear(products, basis.T @ values, (-most, most), method="bvls").x


def at_level(most, level):
    """Largest sizes at a level, whatever that is: above zero, and infinite where nothing bounds."""
    bounds, bounded = np.full(len(most), np.inf), np.isfinite(most)
    bounds[bounded] = np.maximum(level * most[bounded], _LEAST)
    return bounds


def fading(poles, time_s, counted):
    """Motions that fade by some poles, shape (n, m); those that the record cannot show left out.

    Parameters
    ----------
    poles : sequence of complex
        [1/s]; of a pair, the one with the negative imaginary part counts for nothing.
    time_s, counted
        As those of `free_motions`.
    """
    columns, interval_s = [], time_s[-1] / (len(time_s) - 1)
    for pole in poles:
        if pole.imag < 0 or -pole.real * time_s[-1] < _FADES:
            continue
        # as far as there is anything left of it
        time = time_s[:1 + int(min(_GONE / (pole.real * interval_s), len(time_s)))]
        decay, turn = np.exp(pole.real * time), pole.imag * time
        columns += [decay] if pole.imag == 0 else [decay * np.cos(turn), decay * np.sin(turn)]
    columns = [column for column in columns
               if np.max(np.abs(column * counted[:len(column)])) > _NOTHING]
    # before the first sample that counts, they would grow backwards without bound
    first = int(np.argmax(counted))
    result = np.zeros((len(time_s), len(columns)))
    for i, column in enumerate(columns):
        result[first:len(column), i] = column[first:]
    return result
