"""Stop that the mass runs against."""

import dataclasses

import numpy as np

from ...errors import ModelError
from ..parameters import parameter
from .base import CORE, Effect, require_oscillator
from .fit_starts import positive

# Where a stop is looked for: shares of the largest output that was measured on its side.
_SHARES = (0.25, 0.4, 0.6, 0.75, 0.9)
_STIFFNESS = 20.0
# Largest simulated values that tell whether there is a stop, at least, and how much smaller the
# measured ones must be on average, in RMS of the residual.
_EXTREMES = 16
_BEHIND = 0.5
# Tenths of the output's standard deviation within which each swing reaches a stop.
_SWING = 3.0


@dataclasses.dataclass(frozen=True)
class ImpactStop(Effect):
    r"""Adds :math:`\kappa (q - g)` to the spring's bracket beyond the gap g.

    With `sides` 2, the same beyond -g; with 1, only on the side of the gap's sign.
    """

    cause = "impact_stop"
    stage = CORE
    explanation = "The mass runs against a stop and bounces off it."
    experiment = ("Repeat at half the level: the mass no longer reaches the stop, and the output "
                  "follows again.")

    gap: float = parameter("output units", scale=(0.1, "level"))
    stiffness: float = parameter("1", above=0, scale=10.0, reach=(1e-3, 1e3), null=0.0)
    sides: float = parameter("1", default=2.0, minimum=1, maximum=2)

    def __post_init__(self):
        if self.sides not in (1, 2):
            raise ModelError(f"effects: impact_stop with sides {self.sides:g} given, expected 1 or "
                             "2")
        if self.gap == 0:
            raise ModelError("effects: impact_stop with gap 0 given, expected another number")

    @classmethod
    def fitted_parameters(cls, axis, excited):
        return ["gap", "stiffness"]

    def change_core(self, core):
        return require_oscillator(core, self.cause)

    def add_force(self, force):
        return force.with_law(_stop, self.gap, self.stiffness, self.sides, slope=self.stiffness)

    def degenerate(self, scales):
        if abs(self.gap) < _SWING * scales["gap"]:
            return (f"its gap of {self.gap:.3g} lies within every swing: a gain that differs by "
                    "direction does the same")
        return None

    @classmethod
    def starts(cls, view):
        measured, simulated, residual = (
            values[view.used] for values in (view.measured, view.simulated, view.residual))
        reached = [(side, 1.0) for side in (1.0, -1.0)
                   if len(measured) and _held_back(side * simulated, side * residual)]
        if len(reached) == 2:
            reached = [(1.0, 2.0), *reached]
        return [positive(cls(float(share * way * np.max(way * measured)), _STIFFNESS, sides),
                         "stiffness")
                for way, sides in reached for share in _SHARES if np.max(way * measured) > 0]


def _held_back(simulated, residual):
    """Whether the measured output stays behind where the simulated one is largest."""
    count = max(_EXTREMES, len(simulated) // 1000)
    top = np.argpartition(simulated, -count)[-count:]
    return residual[top].mean() < -_BEHIND * np.sqrt(np.mean(residual**2))


def _stop(q0, v0, state, q1, v1, duration, parameters):
    gap = parameters[0]
    way = 1.0 if gap > 0 else -1.0
    if parameters[2] == 2 and q1 * way < 0:
        way, gap = -way, -gap
    beyond = (q1 - gap) * way
    return parameters[1] * beyond * way if beyond > 0 else 0.0, 0.0
