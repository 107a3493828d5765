"""Orders swept as in the paper, on records of the bench."""

import dataclasses
import itertools

import numpy as np

from ...errors import FracAccelError
from .. import curves, published
from .candidates import FixedOrdersStructure, fitted
from .judge import judge


@dataclasses.dataclass(frozen=True)
class SweptOrder:
    """A model with given orders, all its other parameters fitted, on the held-out sines.

    Attributes
    ----------
    v1, v2 : float
        Orders of damping and inertia.
    nrmse : float
        Residual of the fit over the output's standard deviation.
    judged : Judged or None
    why_not : str
        Why it could not be judged.
    """

    v1: float
    v2: float
    nrmse: float
    judged: object
    why_not: str = ""

    def as_dict(self):
        """Plain numbers."""
        result = {"v1": self.v1, "v2": self.v2, "nrmse": self.nrmse, "why_not": self.why_not}
        if self.judged is not None:
            result.update(rms=self.judged.rms, beyond=self.judged.beyond,
                          measure_percent=self.judged.measure_percent)
        return result


def damping_orders():
    """Pairs of orders of section 4: the damping's from 0.94 to 2.08, the inertia's 2."""
    return [(order, 2.0) for order in curves.orders()]


def table_4():
    """All pairs of orders of Table 4."""
    return list(itertools.product(published.TABLE_4_V1, published.TABLE_4_V2))


def sweep(pairs_of_orders, pair, sines, progress=lambda: None):
    """Fit a model with each pair of orders, and judge it.

    Parameters
    ----------
    pairs_of_orders : sequence of (float, float)
    pair : Record
        To identify from.
    sines : Sines
        To judge on.
    progress : callable
        Called after each.

    Returns
    -------
    list of SweptOrder
    """
    result = []
    spread = float(pair.sensor[pair.valid, 0].std())
    for v1, v2 in pairs_of_orders:
        if v1 == v2:
            result.append(SweptOrder(v1, v2, float("nan"), None,
                                     "damping and inertia are one term, nothing is damped"))
            progress()
            continue
        try:
            # a damping of nearly the inertia's order leads to extreme parameters
            with np.errstate(all="ignore"):
                found = fitted(f"{v1:g}, {v2:g}", FixedOrdersStructure(v1, v2),
                               pair.reference[:, 0], pair.sensor[:, 0], pair.sampling_rate_hz,
                               pair.valid, pair.lag_s)
                result.append(SweptOrder(v1, v2, found.fit.rmse / spread, judge(found, sines)))
        except FracAccelError as error:
            result.append(SweptOrder(v1, v2, float("nan"), None, str(error)))
        progress()
    return result


def best(swept):
    """The one with the smallest residual: chosen on the record that was fitted, not the sines."""
    return min((one for one in swept if one.judged is not None), key=lambda one: one.nrmse)
