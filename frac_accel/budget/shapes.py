"""Functions of the motion that nonlinear sensors add: even and odd ones."""

import numpy as np

# Velocity, of its RMS, at which a smooth sign has turned.
_TURN = 0.02
# Lags at which what a filter would take is taken out of a shape.
_LAGS = (-2, 2)
# Samples that are enough to tell what.
_ENOUGH = 100_000


def standardised(values, used):
    """Values without mean and of RMS 1 where they count."""
    centred = values - values[used].mean()
    return centred / max(np.sqrt(np.mean(centred[used]**2)), 1e-300)


def even(motion, used):
    """Shapes that stay as they are when the motion changes its sign; the likeliest ones first."""
    y, v = _motion_and_velocity(motion, used)
    return cleared([y**2, v**2, y * v, np.abs(y), np.abs(v)], y, used)


def odd(motion, used):
    """Shapes that change their sign with the motion; the likeliest ones first."""
    y, v = _motion_and_velocity(motion, used)
    return cleared([y**3, np.tanh(v / _TURN), v * np.abs(v), np.tanh(y / 0.3), y**5, y * v**2,
                     y**2 * v], y, used)


def even_of_input(motion, used):
    """The same of what drives the sensor, before it rings."""
    x = standardised(motion, used)
    return cleared([x**2, np.abs(x), x**4], x, used)


def odd_of_input(motion, used):
    """Shapes of what drives the sensor that change their sign with it."""
    x = standardised(motion, used)
    return cleared([x**3, np.tanh(x / 0.3), x * np.abs(x), np.tanh(x / 0.05), x**5], x, used)


def _motion_and_velocity(motion, used):
    y = standardised(motion, used)
    return y, standardised(np.gradient(y), used)


def cleared(shapes, y, used):
    """Shapes without what a short filter of the motion makes of them, each of RMS 1.

    It is no more than their linear part, which the linear part of the budget has taken already.
    """
    n = len(y)
    padded = np.pad(y, max(-_LAGS[0], _LAGS[1]))
    lags = range(_LAGS[0], _LAGS[1] + 1)
    columns = [padded[_LAGS[1] - k:_LAGS[1] - k + n] for k in lags]
    some = np.flatnonzero(used)[::max(1, n // _ENOUGH)]
    matrix = np.stack([column[some] for column in columns], axis=1)
    gram = matrix.T @ matrix
    gram[np.diag_indices_from(gram)] += 1e-9 * np.trace(gram)
    result = []
    for shape in shapes:
        shape = shape - shape[used].mean()
        weights = np.linalg.solve(gram, matrix.T @ shape[some])
        for weight, column in zip(weights, columns):
            shape -= weight * column
        result.append(standardised(shape, used))
    return result
