"""Whether another model is better than the one in use, on data that neither has seen."""

import numpy as np
from scipy.special import stdtrit

# Windows from which on a trial can be won, and after which it is lost.
_FEWEST = 6
_MOST = 60
# One-sided chance that a model that is no better wins at one look; it is looked after each window.
_LUCK = 1e-4
# Share by which the residual must be smaller.
_WORTH_IT = 0.01


class Trial:
    """Compares two models window by window.

    Attributes
    ----------
    verdict : str
        ``open``, ``won`` or ``lost``.
    gain : float
        Share by which the residual is smaller, so far.
    """

    def __init__(self):
        self._ratios, self.verdict, self.gain = [], "open", 0.0

    @property
    def windows(self):
        """How many have been compared."""
        return len(self._ratios)

    def add(self, in_use_rms, other_rms):
        """Take in the residuals of both over a window [output units]."""
        if self.verdict != "open":
            return
        self._ratios.append(np.log(max(other_rms, 1e-300) / max(in_use_rms, 1e-300)))
        ratios = np.array(self._ratios)
        self.gain = float(1 - np.exp(ratios.mean()))
        if len(ratios) < _FEWEST:
            return
        spread = max(ratios.std(ddof=1), 1e-6) / np.sqrt(len(ratios))
        reach = stdtrit(len(ratios) - 1, 1 - _LUCK / _MOST) * spread
        if ratios.mean() + reach < np.log(1 - _WORTH_IT):
            self.verdict = "won"
        elif ratios.mean() - reach > 0 or len(ratios) >= _MOST:
            self.verdict = "lost"
