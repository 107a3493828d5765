"""Gain of a cause on data that the fit has not seen."""

import dataclasses
import math

import numpy as np

# Share of the held-out error that a cause must take away to matter.
_RELEVANT = 0.005
_BLOCKS = 40
_RESAMPLES = 1000


@dataclasses.dataclass(frozen=True)
class Gain:
    """Held-out error without and with a cause.

    Attributes
    ----------
    before, after : float
        RMSE [output units] on held-out samples.
    reduction : float
        1 - after / before.
    ci95 : tuple of float
        Interval of the reduction by a bootstrap over blocks.
    """

    before: float
    after: float
    reduction: float
    ci95: tuple

    @property
    def is_relevant(self):
        """Whether it matters, and is above zero for certain."""
        return self.matters and self.ci95[0] > 0

    @property
    def matters(self):
        """Whether it takes away enough."""
        return self.reduction > _RELEVANT

    @property
    def taken(self):
        """RMS of the error that is taken away [output units]."""
        return float(np.sqrt(max(self.before**2 - self.after**2, 0.0)))

    def as_dict(self):
        """As the result file has it."""
        return {"held_out_rmse_before": self.before, "held_out_rmse_after": self.after,
                "reduction": self.reduction, "ci95": list(self.ci95)}


def gain(before, after):
    """Gain from the errors on held-out samples in their order, both of shape (n,).

    The interval resamples blocks of consecutive samples, since neighbouring errors are alike
    (H. Kuensch, *Ann. Statist.* 17 (1989) 1217-1241).
    """
    edges = np.linspace(0, len(before), _BLOCKS + 1).astype(int)[:-1]
    powers = np.stack([np.add.reduceat(np.square(error), edges) for error in (before, after)])
    rng = np.random.default_rng(0)
    drawn = rng.multinomial(_BLOCKS, np.full(_BLOCKS, 1 / _BLOCKS), _RESAMPLES) @ powers.T
    ratios = np.sqrt(drawn[:, 1] / np.maximum(drawn[:, 0], 1e-300))
    low, high = np.quantile(1 - ratios, (0.025, 0.975))
    rms = np.sqrt(powers.sum(axis=1) / len(before))
    return Gain(float(rms[0]), float(rms[1]), float(1 - rms[1] / max(rms[0], 1e-300)),
                (float(low), float(high)))


def certainty(g):
    """Chance that a `Gain` is above zero, as its bootstrap interval has it."""
    std = max((g.ci95[1] - g.ci95[0]) / 3.92, 1e-12)
    return 0.5 + 0.5 * math.erf(g.reduction / std / math.sqrt(2))
