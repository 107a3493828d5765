"""Spring whose force depends on where it has been."""

import dataclasses

from ..parameters import parameter
from .base import CORE, Effect, require_oscillator
from .fit_starts import positive

# Times that -gamma may exceed beta: beyond it the branches only bend.
_BENDS = 3.0


@dataclasses.dataclass(frozen=True)
class Hysteresis(Effect):
    r"""Restoring force :math:`\omega_0^2 \lambda z`.

    .. math:: z' = q' - \beta |q'| z - \gamma q' |z|

    R. Bouc (1967); Y.-K. Wen, J. Eng. Mech. Div. ASCE 102 (1976) 249-263. With beta + gamma below 0
    the branches bend away from the middle, and z has a bound only as long as the motion has one
    (F. Ikhouane, J. Rodellar, *Systems with Hysteresis* (2007), table 2.1).
    """

    cause = "hysteresis"
    stage = CORE
    # without it there is no loop: a spring of another stiffness, or a bent one
    nested = ("beta",)
    explanation = "The spring's force depends on its path, so that it takes another way back."
    experiment = ("Drive one slow sine at several levels: output over acceleration is a loop, "
                  "which stays open however slow.")

    strength: float = parameter("1", scale=0.1, null=0.0)
    beta: float = parameter("1/(output units)", scale="per_level", minimum=0, null=0.0)
    gamma: float = parameter("1/(output units)", scale="per_level")

    def change_core(self, core):
        return require_oscillator(core, self.cause)

    def degenerate(self, scales):
        return "it bends without a loop, as a law of the spring without memory does" \
            if self.gamma < -_BENDS * self.beta else None

    def add_force(self, force):
        return dataclasses.replace(force, strength=self.strength, beta=self.beta, gamma=self.gamma)

    @classmethod
    def starts(cls, view):
        return [positive(cls(0.02, beta / view.level, share * beta / view.level), "strength")
                for beta in (0.3, 1.0, 3.0) for share in (-1.4, -0.4, 0.4)]
