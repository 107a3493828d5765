"""Digital filter of linear phase: moving averages, one after the other."""

import dataclasses

import numpy as np

from ..parameters import parameter
from .base import CONDITIONER, Effect
from .fit_starts import matching_alone, of_orders

_MOST = 4


@dataclasses.dataclass(frozen=True)
class LinearPhaseFilter(Effect):
    r"""So many moving averages of one length.

    .. math:: \left(\frac{1 - e^{-s L}}{s L}\right)^n
              = e^{-s n L / 2} \left(\frac{\sinh(s L / 2)}{s L / 2}\right)^n

    On the frequency axis :math:`|\mathrm{sinc}(L f)|^n`. The delay :math:`n L / 2` moves the
    signal as it is, so that a correction takes it out of the stamps. E. B. Hogenauer, "An
    economical class of digital filters for decimation and interpolation", *IEEE Trans. ASSP* 29
    (1981) 155-162.
    """

    cause = "linear_phase_filter"
    stage = CONDITIONER
    explanation = ("A digital filter averages over a stretch of time: fast motion becomes smaller, "
                   "and all of it equally later.")
    experiment = ("Excite up to the inverse of the averaged length: a moving average has a notch "
                  "there, and its phase stays a straight line.")

    length_s: float = parameter("s", above=0, scale="interval", reach=(1e-3, 1e4), null=0.0)
    order: int = parameter("1", minimum=1, maximum=_MOST, whole=True)

    def pure_delay_s(self):
        return self.order * self.length_s / 2

    def transfer_function(self, s):
        half = np.asarray(s, complex) * self.length_s / 2
        small = np.abs(half) < 1e-4
        safe = np.where(small, 1.0, half)
        return np.where(small, 1 + half**2 / 6, np.sinh(safe) / safe)**self.order

    def alternatives(self):
        return of_orders(self, (self.order - 1, self.order + 1), _MOST)

    @classmethod
    def starts(cls, view):
        return matching_alone(view, [
            cls(float(length), order) for length in np.geomspace(0.3, 100, 80) / view.rate
            for order in range(1, _MOST + 1)])
