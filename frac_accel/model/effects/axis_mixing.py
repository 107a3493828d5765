"""Outputs of three axes mixed by a matrix, for the effects that bring something across."""

import numpy as np


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


def mix(values, matrix):
    """values @ matrix.T, summed in a fixed order: BLAS would round by the block's length."""
    return sum(values[:, [axis]] * matrix[:, axis] for axis in range(3))
