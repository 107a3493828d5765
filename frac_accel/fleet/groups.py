"""Groups of vehicles by the columns that somebody has given."""

import math

import numpy as np

# Fewest vehicles whose estimates are pooled, and that make a group.
FEWEST = 8
# Words of a column beyond which its values are names, not kinds.
_MOST_KINDS = 50
# Parts into which a column of numbers is cut.
_PARTS = 4

ALL = "all vehicles"


def groups_of(columns, count):
    """Groups of at least `FEWEST` vehicles, and all of them.

    Parameters
    ----------
    columns : dict of str to list of str
        One value a vehicle; empty where it is not known.
    count : int
        Of vehicles.

    Returns
    -------
    dict of str to ndarray of bool, shape (count,)
    """
    groups = {ALL: np.ones(count, bool)}
    for name, values in columns.items():
        kinds = sorted(set(values) - {""})
        numbers = [_number(value) for value in values]
        if all(math.isfinite(number) for number, value in zip(numbers, values) if value) \
                and len(kinds) > _PARTS:
            groups.update(_by_size(name, np.array(numbers)))
        elif len(kinds) <= _MOST_KINDS:
            groups.update({f"{name} = {kind}": np.array([value == kind for value in values])
                           for kind in kinds})
    return {name: rows for name, rows in groups.items() if rows.sum() >= FEWEST or rows.all()}


def _by_size(name, numbers):
    known = numbers[np.isfinite(numbers)]
    edges = np.unique(np.quantile(known, np.linspace(0, 1, _PARTS + 1)))
    for low, high in zip(edges[:-1], edges[1:]):
        last = high == edges[-1]
        rows = (numbers >= low) & ((numbers <= high) if last else (numbers < high))
        yield f"{name} {low:g} to {high:g}", rows


def _number(text):
    try:
        return float(text)
    except ValueError:
        return math.nan
