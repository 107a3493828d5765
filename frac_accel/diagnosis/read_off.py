"""Causes that a record shows by itself: limits, lattice, stamps, bursts."""

import numpy as np

from .finding import Finding
from .gain import certainty, gain
from .seen import is_noise, readings
from .words import gain_words

# Standard uncertainties, and share of its size, within which a parameter is where the model in use
# has it.
_SAME_STDS, _SAME_SHARE = 3.0, 1e-3


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
    noise = is_noise(engine, fitted)
    for cause, effect, reading in readings(engine, fitted, found, shown):
        if not (cause in shown or noise or reading.evident or reading.added is not None):
            continue
        if _is_known(engine.problem, effect, reading.std):
            continue
        g = engine.held_out(fitted, cause) if cause in engine.search.base \
            else gain(reading.before, reading.after)
        if g.is_relevant or (reading.evident and g.matters):
            findings.append(Finding(effect, reading.std, certainty(g), [], [
                reading.evidence, *gain_words(cause, g, np.inf, [])], g))
    return findings


def _is_known(problem, effect, stds):
    """Whether the model in use has a cause as the record shows it."""
    own = next((other for other in problem.baseline.axis(problem.axis).effects
                if other.cause == effect.cause), None)

    def agrees(name, std):
        here, known = getattr(effect, name), getattr(own, name)
        return known is not None and abs(here - known) <= max(_SAME_STDS * std,
                                                              _SAME_SHARE * abs(known))
    return own is not None and bool(stds) and all(agrees(*entry) for entry in stds.items())


def drowned(engine, fitted, found):
    """Mask, shape (n,), of the samples in which something that the residual shows by itself drowns
    whatever else may be wrong; arguments as those of `read_off`."""
    masks = [reading.drowned for _, _, reading in
             readings(engine, fitted, found, {}) if reading.drowned is not None]
    return np.any(masks, axis=0) if masks else np.zeros(len(engine.problem.record), bool)
