"""A static curve that describes what no known cause explains."""

import numpy as np

from ..errors import FracAccelError
from ..model.effects import effect_of
from .empirical import EmpiricalFit
from .gain import gain

# Numbers of knots; two are a gain and an offset, which other causes are for.
_KNOTS = (2, 4, 6, 9, 13)
# Share of the samples beyond the outermost knots: the ends are straight.
_ENDS = 2e-3
# Stretches by turns fitted and predicted, and samples that each knot needs.
_STRETCHES = 40
_FEWEST = 50
# A map with more knots must bring the error on the other stretches below this share.
_CLEARLY = 0.99


def fit_empirical_map(measured, simulated, used, held_out):
    """Monotonic curve from simulated to measured output, by least squares.

    Knots stand at even steps between the outermost values. Their number is the smallest that
    predicts every other stretch about as well as any; only then are the held-out samples asked.

    Parameters
    ----------
    measured, simulated : ndarray, shape (n,)
        Outputs [output units].
    used, held_out : ndarray of bool, shape (n,)
        Samples that count, and those that the fit may not see.

    Returns
    -------
    EmpiricalFit
        Its `order` is the number of knots.

    Raises
    ------
    FracAccelError
        If there are too few samples, or no monotonic curve is better than a straight line.
    """
    rows = np.flatnonzero(used & ~held_out)
    if len(rows) < _FEWEST * _KNOTS[-1]:
        raise FracAccelError(f"{len(rows)} samples to learn a map from, expected "
                             f"{_FEWEST * _KNOTS[-1]}")
    turn = (np.arange(len(rows)) * _STRETCHES // len(rows)) % 2 == 0
    ends = np.quantile(simulated[rows], (_ENDS, 1 - _ENDS))
    best, chosen = np.inf, _KNOTS[0]
    for count in _KNOTS:
        knots, error = np.linspace(*ends, count), 0.0
        for one, other in ((rows[turn], rows[~turn]), (rows[~turn], rows[turn])):
            values, _ = _knot_values(knots, simulated[one], measured[one])
            error += np.sum((measured[other] - _hats(knots, simulated[other]) @ values)**2)
        if error < _CLEARLY * best:
            best, chosen = error, count
    values, stds = _knot_values(np.linspace(*ends, chosen), simulated[rows], measured[rows])
    if chosen == _KNOTS[0] or not np.all(np.diff(values) > 0):
        raise FracAccelError("no monotonic curve describes the output better than a straight line")
    effect = effect_of("empirical_map")(*(tuple(part.tolist()) for part in (
        np.linspace(*ends, chosen), values, stds)))
    mean = float(np.mean((measured - simulated)[rows]))
    rows = used & held_out
    described = effect.simulate(simulated[rows], None)
    return EmpiricalFit(effect, chosen, None, gain((measured - simulated)[rows] - mean,
                                                   measured[rows] - described))


def _hats(knots, x):
    """Weights of the values at the knots in a piecewise straight line, straight beyond, too."""
    place = np.clip(np.searchsorted(knots, x) - 1, 0, len(knots) - 2)
    share = (x - knots[place]) / (knots[place + 1] - knots[place])
    matrix = np.zeros((len(x), len(knots)))
    rows = np.arange(len(x))
    matrix[rows, place], matrix[rows, place + 1] = 1 - share, share
    return matrix


def _knot_values(knots, x, y):
    """Values at the knots, and their standard uncertainties as for white noise."""
    matrix = _hats(knots, x)
    inverse = np.linalg.pinv(matrix.T @ matrix)
    values = inverse @ (matrix.T @ y)
    noise = np.mean((y - matrix @ values)**2)
    return values, np.sqrt(noise * np.diag(inverse))
