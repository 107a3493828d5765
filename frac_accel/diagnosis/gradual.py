"""Whether what jumps at an instant may as well have changed gradually, or not at all."""

import dataclasses

import numpy as np

from ..signals.normal_equations import solve

# Degree of the gradual change that is looked for on both sides of a jump; share of the jump that
# must be left beside it, and standard uncertainties that it must then be above none.
_DEGREE = 2
_LEFT = 0.5
_SURE = 3.0
# Share of what a jump changes on one side of it (RMS) that it must change on the other one.
_MOVES = 0.05
# Times what is left there (RMS) from which the jump shows, whatever it changes on the other side.
_SHOWS = 3.0
# Blocks of the record from whose errors the uncertainty is taken.
_BLOCKS = 40


def gradual(engine, fitted, causes):
    """Causes that jump, where a gradual change on both sides leaves little of it, or nothing moves
    that would show it on one of them, in words.

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
        p, at_s = engine.problem, getattr(fitted.effects[unknown.cause], unknown.name)
        always = _if_always(p, fitted, unknown.cause, unknown.name)
        since_s = (p.record.since_start_s + p.time - at_s)[p.used]
        after, residual = since_s >= 0, fitted.residual[p.used]
        (less, left_there), (more, _) = sorted(
            ((_rms(always[side]), _rms(residual[side])) for side in (after, ~after)),
            key=lambda entry: entry[0])
        # one event on one side takes nothing from what the other shows
        if less < min(_MOVES * more, _SHOWS * left_there):
            found[unknown.cause] = "the motion that would show it is on one side of it only: it " \
                                   f"changes {less:.3g} RMS on the other, {more:.3g} there"
            continue
        left, std = _jump_left(residual, always, since_s)
        if left < max(_LEFT, _SURE * std):
            found[unknown.cause] = "beside a gradual change before and after it " \
                                   f"{max(left, 0.0):.0%} ± {std:.0%} of the jump are left: it " \
                                   "may be none"
    return found


def _rms(values):
    """RMS of values; 0 of none."""
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0


def _if_always(problem, fitted, cause, name):
    """What a jump would change if it had happened before the record, where samples count."""
    rest = {other: effect for other, effect in fitted.effects.items() if other != cause}
    early = dataclasses.replace(fitted.effects[cause], **{name: 0.0})
    return (problem.simulate({**rest, cause: early}) - problem.simulate(rest))[problem.used]


def _jump_left(residual, always, since_s):
    """Share of a jump that is left beside a gradual change on both sides of it, and its standard
    uncertainty from blocks of the record (M. H. Quenouille, *Biometrika* 43 (1956) 353-360)."""
    after, place = since_s >= 0, since_s / max(np.abs(since_s).max(), 1e-9)
    bent = [side * place**power for side in (after, ~after) for power in range(1, _DEGREE + 1)]
    columns = np.stack([after, np.ones(len(place)), *bent], axis=1) * always[:, None]
    error = residual + after * always
    edges = np.linspace(0, len(place), _BLOCKS + 1).astype(int)
    grams = np.array([columns[a:b].T @ columns[a:b] for a, b in zip(edges, edges[1:])])
    sides = np.array([columns[a:b].T @ error[a:b] for a, b in zip(edges, edges[1:])])
    gram, side = grams.sum(axis=0), sides.sum(axis=0)
    share = solve(gram, side)[0]
    without = np.array([solve(gram - own, side - of)[0] for own, of in zip(grams, sides)])
    return float(share), float(np.sqrt((_BLOCKS - 1) / _BLOCKS * np.sum((without - share)**2)))
