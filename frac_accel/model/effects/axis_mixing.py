"""Outputs of three axes mixed by a matrix, for the effects that bring something across."""

import numpy as np

# Share of its own axis of the reference from which on an axis does not follow another one.
_OWN = 0.5


def mixing_matrix(by_axis):
    """3 by 3 matrix of the shares of all axes in each, from the effect of each axis that has one.

    Parameters
    ----------
    by_axis : dict of int to Effect
    """
    matrix = np.eye(3)
    for axis, effect in by_axis.items():
        matrix[axis] = effect.share_of_axes(axis)
    return matrix


def mixed_by(effects):
    """The same of some effects one after the other, as one axis has them."""
    matrix = np.eye(3)
    for effect in effects:
        matrix = np.stack([effect.share_of_axes(i) for i in range(3)]) @ matrix
    return matrix


def turn_back(axes, axis):
    """Matrix that turns samples of three axes into the reference's, where one axis is, by its
    effects, mostly another one of the reference or the opposite of its own; otherwise None.

    Parameters
    ----------
    axes : sequence of AxisModel
    axis : {0, 1, 2}
    """
    matrix = mixed_by(effect for effect in axes[axis].effects if effect.mixes_axes)
    astray = matrix[axis, axis] < _OWN and np.allclose(matrix @ matrix.T, np.eye(3), atol=1e-6)
    return matrix.T if astray else None


def mix(values, matrix):
    """values @ matrix.T, summed in a fixed order: BLAS would round by the block's length."""
    return sum(values[:, [axis]] * matrix[:, axis] for axis in range(3))
