"""Rules that a fitted cause must pass before it is named."""

import numpy as np

# Standard uncertainties that at least one parameter must be from the value that changes nothing.
DETERMINED = 3.0
# Relative standard uncertainty above which a parameter that is above zero is open.
_OPEN = 0.5
# Share of the record above which the uncertainty of an instant leaves it open.
_ANY_TIME = 0.1
# Distance from a bound of the search, in its own scale, at which a parameter lies on it.
_ON_BOUND = 1e-3
# Two causes that together do less than this share of what the weaker one does alone cancel.
_CANCEL = 0.5
# Standard uncertainties within which a parameter has the value that makes its cause a special case.
_COMPATIBLE = 2.0


def undetermined(effect, unknowns, theta, stds, core, duration_s):
    """Why a record leaves a fitted cause open, in words; None where it does not.

    Parameters
    ----------
    effect : Effect
    unknowns : sequence of Unknown
        Of this effect.
    theta : sequence of float
        Their values as the search sees them.
    stds : dict of str to float
    core : object
        Core of the model in use.
    duration_s : float
        Of the record.
    """
    degenerate = effect.degenerate({unknown.name: unknown.scale for unknown in unknowns})
    if degenerate:
        return degenerate
    moved = []
    for unknown, place in zip(unknowns, theta):
        value, std = getattr(effect, unknown.name), stds.get(unknown.name, np.inf)
        if on_bound(unknown, place):
            return f"{unknown.name} lies at the end of the range that was searched"
        if unknown.logarithmic and not std < _OPEN * abs(value):
            return f"{unknown.name} is open: {value:.3g} ± {std:.1g}"
        if unknown.jumps and std > _ANY_TIME * duration_s:
            return f"{unknown.name} is open: {value:.3g} s ± {std:.1g} s"
        null = null_value(effect, unknown.name, core)
        if null is not None and np.isfinite(null):
            moved.append(abs(value - null) > DETERMINED * std)
    special = special_case(effect, stds, core)
    if special:
        return special
    # one that has no such value, as an instant, does not tell that anything happens
    if moved and not any(moved):
        return "no parameter differs from the value that changes nothing"
    return None


def on_bound(unknown, place):
    """Whether a parameter lies at an end of a range that is searched between two."""
    ends = unknown.low, unknown.high
    return bool(np.isfinite(ends).all()) and any(abs(place - end) < _ON_BOUND for end in ends)


def null_value(effect, name, core):
    """Value of a parameter with which its cause changes nothing, or None."""
    field = next(f for f in type(effect).__dataclass_fields__.values() if f.name == name)
    null = field.metadata.get("null")
    return getattr(core, name, None) if null == "core" else null


def special_case(effect, stds, core):
    """Words for a cause that is, within its uncertainty, another one's special case; or None."""
    for name in effect.nested:
        value, null = getattr(effect, name), null_value(effect, name, core)
        if null is not None and abs(value - null) < _COMPATIBLE * stds.get(name, 0.0):
            return f"{name} is compatible with {null:g} ({value:.4g} ± {stds[name]:.2g})"
    return None


def cancelling(changes):
    """Pairs of causes whose changes of the output nearly cancel.

    Parameters
    ----------
    changes : dict of str to ndarray, shape (n,)
        By cause, the output less the output without it, all else as it is.

    Returns
    -------
    list of tuple of str
    """
    causes = sorted(changes)
    sizes = {cause: np.linalg.norm(changes[cause]) for cause in causes}
    return [(one, other) for i, one in enumerate(causes) for other in causes[i + 1:]
            if np.linalg.norm(changes[one] + changes[other])
            < _CANCEL * min(sizes[one], sizes[other])]
