"""Causes that a record shows by itself: limits, lattice, stamps, bursts."""

import numpy as np

from .finding import Finding
from .gain import certainty, gain
from .seen import readings
from .words import gain_words

# Samples of a stretch, and share of a record for which it must move, so that the size of what is
# left can be compared with the motion's: not in a shock.
_STRETCH = 64
_LASTS = 0.1


def _moving_share(reference):
    """Share of a record for which the reference moves: its mean power's square over the mean square
    of the power, in stretches."""
    count = max(len(reference) // _STRETCH, 1)
    moving = (reference - reference.mean())[:count * _STRETCH].reshape(count, -1)
    power = np.mean(np.square(moving), axis=1)
    return float(power.mean()**2 / max(np.mean(power**2), 1e-300))


def read_off(engine, fitted, found, shown):
    """Findings that the record shows by itself: limits, lattice, stamps.

    Parameters
    ----------
    engine : Engine
    fitted : Fitted
    found : Integrity
    shown : dict of str to Effect
        What `of_record` found, by cause.
    """
    findings = []
    # what the size of a residual tells presumes that it is noise, or bursts of it
    is_noise = all(part == "bursts" for _, part in engine.structure(fitted)) \
        and _moving_share(engine.problem.record.reference[:, engine.problem.axis]) > _LASTS
    for cause, effect, reading in readings(engine, fitted, found, shown):
        if cause not in shown and not is_noise and reading.added is None:
            continue
        g = engine.held_out(fitted, cause) if cause in engine.search.base \
            else gain(reading.before, reading.after)
        if g.is_relevant or (reading.evident and g.matters):
            findings.append(Finding(effect, reading.std, certainty(g), [], [
                reading.evidence, *gain_words(cause, g, np.inf, [])], g))
    return findings


def drowned(engine, fitted, found):
    """Mask, shape (n,), of the samples in which something that the residual shows by itself drowns
    whatever else may be wrong; arguments as those of `read_off`."""
    masks = [reading.drowned for _, _, reading in
             readings(engine, fitted, found, {}) if reading.drowned is not None]
    return np.any(masks, axis=0) if masks else np.zeros(len(engine.problem.record), bool)
