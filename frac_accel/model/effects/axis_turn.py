"""Turn of a sensor against its reference, as the shares of the axes in each other show it."""

import numpy as np

_AXES = "xyz"
# Standard deviations by which a turn must stand out, and what the shares may differ from those of a
# turn: over what the turn adds, and besides in standard deviations. A share in one axis only
# differs by as much as it would add.
_SURE = 6.0
_LIKE, _WITHIN = 0.2, 3.0
# With one axis measured: own share, over that of all, above which nothing tells a turn; but for
# one that has lost as much as this by it, and kept the length of all shares: noise of the reference
# makes a gain of less.
_FAR = 0.85
_LOST = 0.02


def turn_of(view):
    """Roll, pitch and yaw [deg] by which the axes of a record are turned, or None.

    The shares of the axes in each other (`View.mixing`) are compared with the nearest rotation
    (P. H. Schoenemann, *Psychometrika* 31 (1966) 1-10). Where only one axis was measured, small
    shares of the others are no turn, as they may as well be its cross-axis sensitivity; unless its
    own share has lost just what a turn takes from it.
    """
    shares, stds, moving, own = _shares(view)
    if moving is None:
        return None
    block = shares[np.ix_(moving, moving)]
    apart = ~np.eye(len(moving), dtype=bool)
    turned = np.eye(3)
    if np.isfinite(block).all():
        left, sizes, right = np.linalg.svd(block)
        nearest = left @ right
        if np.linalg.det(nearest) < 0:
            nearest = left @ np.diag([*[1.0] * (len(moving) - 1), -1.0]) @ right
        scale = np.abs(np.trace(nearest.T @ block)) / len(moving)
        error = np.linalg.norm((block / scale - nearest)[apart])
        noise = np.linalg.norm(stds[np.ix_(moving, moving)][apart]) / scale
        size = np.linalg.norm((nearest - np.eye(len(moving)))[apart])
        if size < _SURE * noise or error > _LIKE * size + _WITHIN * noise:
            return None
        turned[np.ix_(moving, moving)] = nearest
    else:
        row, std = np.nan_to_num(shares[own]), np.nan_to_num(stds[own])
        length = np.linalg.norm(row)
        if length == 0 or (row[own] > _FAR * length and not _keeps_length(row, std, own)):
            return None
        turned = _shortest_turn(own, row / np.linalg.norm(row))
    return _angles(turned.T)


def small_turn_of(view):
    """The same of the only axis that was measured, whatever else its shares may be; or None."""
    shares, _, moving, own = _shares(view)
    if moving is None or np.isfinite(np.delete(shares, own, axis=0)).any():
        return None
    row = np.nan_to_num(shares[own])
    return _angles(_shortest_turn(own, row / np.linalg.norm(row)).T) if row[own] > 0 else None


def _shares(view):
    """Shares, their standard uncertainties, axes that move, and the one that is asked for; all None
    where no other one moves."""
    moving = [axis for axis in range(3) if view.excited[_AXES[axis]]]
    own = _AXES.index(view.axis)
    if view.mixing is None or len(moving) < 2 or own not in moving:
        return (None,) * 4
    return (*view.mixing, moving, own)


def _keeps_length(row, std, own):
    """Whether an axis' own share is less than one by as much as a turn makes it."""
    length = np.linalg.norm(row)
    return abs(length - 1) < _WITHIN * np.linalg.norm(row * std) / length \
        and 1 - row[own] > max(_SURE * std[own], _LOST)


def _shortest_turn(axis, row):
    """Rotation, shape (3, 3), whose row `axis` is the unit vector `row` (O. Rodrigues, 1840)."""
    unit = np.eye(3)[axis]
    across, along = np.cross(unit, row), float(unit @ row)
    if along < -1 + 1e-9:
        return np.diag(np.where(np.arange(3) == (axis + 2) % 3, 1.0, -1.0))
    x, y, z = across
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return (np.eye(3) + skew + skew @ skew / (1 + along)).T


def _angles(rotation):
    """Roll, pitch and yaw [deg] of R = Rz Ry Rx."""
    return tuple(float(angle) for angle in np.degrees([
        np.arctan2(rotation[2, 1], rotation[2, 2]), -np.arcsin(np.clip(rotation[2, 0], -1, 1)),
        np.arctan2(rotation[1, 0], rotation[0, 0])]))
