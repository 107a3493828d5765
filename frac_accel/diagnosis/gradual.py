"""Whether what jumps at an instant may as well have changed gradually."""

import dataclasses

import numpy as np

from ..signals.normal_equations import solve

# Degree of the gradual change that is looked for on both sides of a jump; share of the jump that
# must be left beside it, and standard uncertainties that it must then be above none.
_DEGREE = 2
_LEFT = 0.5
_SURE = 3.0
# Blocks of the record from whose errors the uncertainty is taken.
_BLOCKS = 40


def gradual(engine, fitted, causes):
    """Causes that jump, where a gradual change on both sides leaves little of it, in words.

    Parameters
    ----------
    engine : Engine
    fitted : Fitted
    causes : collection of str
    """
    found = {}
    for unknown in fitted.unknowns:
        if not unknown.jumps or unknown.cause not in causes:
            continue
        left, std = _jump_left(engine.problem, fitted, unknown.cause, unknown.name)
        if left < max(_LEFT, _SURE * std):
            found[unknown.cause] = "beside a gradual change before and after it " \
                                   f"{max(left, 0.0):.0%} ± {std:.0%} of the jump are left: it " \
                                   "may be none"
    return found


def _jump_left(problem, fitted, cause, name):
    """Share of a jump that is left beside a gradual change on both sides of it, and its standard
    uncertainty from blocks of the record (M. H. Quenouille, *Biometrika* 43 (1956) 353-360)."""
    effects, p = fitted.effects, problem
    at_s = getattr(effects[cause], name)
    rest = {other: effect for other, effect in effects.items() if other != cause}
    always = p.simulate({**rest, cause: dataclasses.replace(effects[cause], **{name: 0.0})}) \
        - p.simulate(rest)
    since_s = p.record.since_start_s + p.time - at_s
    place = (since_s / max(np.abs(since_s).max(), 1e-9))[p.used]
    always, after = always[p.used], place >= 0
    bent = [side * place**power for side in (after, ~after) for power in range(1, _DEGREE + 1)]
    columns = np.stack([after, np.ones(len(place)), *bent], axis=1) * always[:, None]
    error = fitted.residual[p.used] + after * always
    edges = np.linspace(0, len(place), _BLOCKS + 1).astype(int)
    grams = np.array([columns[a:b].T @ columns[a:b] for a, b in zip(edges, edges[1:])])
    sides = np.array([columns[a:b].T @ error[a:b] for a, b in zip(edges, edges[1:])])
    gram, side = grams.sum(axis=0), sides.sum(axis=0)
    share = solve(gram, side)[0]
    without = np.array([solve(gram - own, side - of)[0] for own, of in zip(grams, sides)])
    return float(share), float(np.sqrt((_BLOCKS - 1) / _BLOCKS * np.sum((without - share)**2)))
