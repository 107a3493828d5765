"""A mass without a spring, held back by viscous and dry friction."""

import dataclasses

import numpy as np

from ..core import Gain
from ..parameters import parameter
from .base import CORE, Effect
from .fit_starts import finite

# Half width of the stretches over which a start is read off, in samples, and the largest asymmetry
# that it begins with, and that friction has.
_SMOOTH = 2
_LOPSIDED = 0.5


@dataclasses.dataclass(frozen=True)
class FreeMassFriction(Effect):
    r"""The output is the velocity q of a free mass that the core's output x drives:

    .. math:: q' = 2 \pi f_c (x - q - n), \qquad n = c\,(\mathrm{sgn}\,q + \epsilon)

    with the corner :math:`f_c` of the viscous friction, the Coulomb level c and its asymmetry
    :math:`\epsilon`: c (1 + ε) forward and c (1 - ε) backward. At rest n is what holds the mass.
    Only a flat core can be the force on it.
    """

    cause = "free_mass_friction"
    stage = CORE
    explanation = ("The output follows the velocity of a mass without a spring, which viscous and "
                   "dry friction hold back.")
    experiment = ("Apply a small constant force, and double it step by step: dry friction holds "
                  "the mass until a certain step, and from then on its speed grows evenly.")
    # without dry friction it is a low-pass
    nested = ("level",)

    # with a corner far above the sampling rate it is a dead zone of the force
    corner_hz: float = parameter("Hz", above=0, scale="rate", reach=(1e-6, 2.0), null=np.inf)
    level: float = parameter("output units", minimum=0, scale=(0.1, "level"), null=0.0)
    asymmetry: float = parameter("1", above=-1, below=1, scale=0.1, default=0.0)

    @classmethod
    def acts_on(cls, core):
        return isinstance(core, Gain)

    def degenerate(self, scales):
        return "friction that is so much larger one way is mostly a constant force" \
            if abs(self.asymmetry) > _LOPSIDED else None

    def transfer_function(self, s):
        return 1 / (1 + s / (2 * np.pi * self.corner_hz))

    def poles(self):
        return np.array([-2 * np.pi * self.corner_hz])

    def change_motion(self, motion, step_s):
        """The force that is left of `motion` for the viscous friction, which is the link."""
        from ..core.free_mass import friction_along
        return motion - friction_along(
            np.ascontiguousarray(motion), 2 * np.pi * self.corner_hz * step_s,
            self.level * (1 + self.asymmetry), self.level * (1 - self.asymmetry))

    def live(self, sampling_rate_hz):
        """The inverse remembers what friction has taken."""
        return _Undone(self, 2 * np.pi * self.corner_hz / sampling_rate_hz)

    @classmethod
    def starts(cls, view):
        """By least squares on the equation, which is linear in what is sought, and around it."""
        from scipy.ndimage import uniform_filter1d
        x, q, sign = (uniform_filter1d(values, 2 * _SMOOTH + 1) for values in
                      (view.simulated, view.measured, np.sign(view.measured)))
        rows = view.used & (np.abs(sign) > 1 - 1e-9)
        columns = np.stack([np.gradient(q) * view.rate, q, sign, np.ones(len(q))], axis=1)[rows]
        around = [finite(cls(corner, share * view.level, 0.0))
                  for corner in view.rate * np.geomspace(0.002, 0.05, 6) for share in (0.1, 0.4)]
        if len(columns) < 100:
            return around
        slope, viscous, dry, bias = np.linalg.lstsq(columns, x[rows], rcond=None)[0]
        if not (viscous and slope / viscous > 0 and dry / viscous > 0):
            return around
        lopsided = np.clip(bias / dry, -_LOPSIDED, _LOPSIDED)
        return [finite(cls(float(viscous / slope / (2 * np.pi)), float(dry / viscous),
                           float(lopsided))), *around]


class _Undone:
    """Velocity as it were without the dry friction n, which the direction tells.

    That is more by what n has taken, n behind the link. Where noise or a turn hides the direction,
    and at rest, n is only known to be within its level.
    """

    def __init__(self, effect, rate):
        self._effect, self._share = effect, -np.expm1(-rate)
        # velocity, friction, and what that has taken
        self._last = None

    def simulate(self, values, circumstances):
        return values

    def invert(self, values, variance, circumstances):
        if not len(values):
            return values, variance
        from scipy.signal import lfilter
        from scipy.special import erf
        level, asymmetry = self._effect.level, self._effect.asymmetry
        velocity, friction, taken = self._last or (values[0], level * (
            np.sign(values[0]) + asymmetry), level * (np.sign(values[0]) + asymmetry))
        spread = variance + np.diff(values, prepend=velocity)**2 / 12
        with np.errstate(divide="ignore", invalid="ignore"):
            sign = erf(values / np.sqrt(2 * spread))
        sign = np.where(spread > 0, sign, np.sign(values))
        along = level * (sign + asymmetry)
        mean = (along + np.concatenate([[friction], along[:-1]])) / 2
        added, (state,) = lfilter([self._share], [1, self._share - 1], mean,
                                  zi=[(1 - self._share) * taken])
        self._last = values[-1], along[-1], state / (1 - self._share)
        return values + added, variance + (self._share * level)**2 * (1 - sign**2)
