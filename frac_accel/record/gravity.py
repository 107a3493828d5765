"""Whether one of two sensors shows gravity and the other one does not."""

import numpy as np

# [m/s²], by the third CGPM (1901).
STANDARD_GRAVITY = 9.80665
# How near to gravity the size of an acceleration is most of the time where it shows that [of it],
# and up to which part of it the mean of one is none.
_NEAR, _NONE = 0.05, 0.2
# Ratios of what moves between which both are in the same unit.
_ALIKE = 1 / 3, 3.0


def gravity_words(reference, sensor):
    """Words where one of both shows gravity and the other one moves alike, but about zero; or none.

    Parameters
    ----------
    reference, sensor : ndarray, shape (n, 3)

    Returns
    -------
    list of str
    """
    with np.errstate(over="ignore", invalid="ignore"):  # of numbers beyond all measure
        one, two = (np.linalg.norm(np.std(values, axis=0)) for values in (reference, sensor))
        alike = one > 0 and _ALIKE[0] < two / one < _ALIKE[1]
    if not alike:
        return []
    there, none = ([], [])
    for values, name in ((reference, "reference"), (sensor, "sensor")):
        size = np.median(np.linalg.norm(values, axis=1)) / STANDARD_GRAVITY
        if abs(size - 1) < _NEAR:
            there.append(name)
        elif np.linalg.norm(values.mean(axis=0)) < _NONE * STANDARD_GRAVITY:
            none.append(name)
    if not there or not none:
        return []
    return [f"the {there[0]} shows gravity and the {none[0]} does not: a high-pass, or software "
            "that takes it off as the attitude says; what is slow cannot be compared"]
