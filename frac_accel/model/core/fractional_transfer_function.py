"""General linear differential equation with real orders."""

import dataclasses
from typing import ClassVar

import numpy as np

from ...errors import ModelError
from ..parameters import coefficients
from . import principal_sheet


@dataclasses.dataclass(frozen=True)
class FractionalTransferFunction:
    r"""Equation (5) of the seed paper, :math:`\sum A_i D^{\nu_i} y = \sum B_i D^{\mu_i} a`.

    Attributes
    ----------
    denominator_coefficients, denominator_orders : tuple of float
        :math:`A_i` [s**order] and :math:`\nu_i`.
    numerator_coefficients, numerator_orders : tuple of float
        :math:`B_i` [output units per m/s², times s**order] and :math:`\mu_i`.
    """

    type: ClassVar[str] = "fractional_transfer_function"

    denominator_coefficients: tuple = coefficients()
    denominator_orders: tuple = coefficients()
    numerator_coefficients: tuple = coefficients()
    numerator_orders: tuple = coefficients()

    def __post_init__(self):
        for side in ("denominator", "numerator"):
            values, orders = self._side(side)
            if len(values) != len(orders):
                raise ModelError(f"core.{side}_orders: {len(orders)} given, expected "
                                 f"{len(values)}, one for each coefficient")
            if not any(values):
                raise ModelError(f"core.{side}_coefficients: only zeros given, "
                                 "expected one that is not")
            if min(orders) < 0 or len(set(orders)) < len(orders):
                raise ModelError(f"core.{side}_orders: {list(orders)} given, expected different "
                                 "numbers of at least 0")

    def _side(self, side):
        return getattr(self, f"{side}_coefficients"), getattr(self, f"{side}_orders")

    def transfer_function(self, s):
        """Transfer function at complex `s` [rad/s], same shape."""
        return (principal_sheet.evaluate(*self._side("numerator"), s)
                / principal_sheet.evaluate(*self._side("denominator"), s))

    def poles(self):
        """Resonant pole pair on the principal sheet [rad/s], where there is one."""
        return self._pair("denominator")

    def zeros(self):
        """Resonant pair of zeros on the principal sheet [rad/s], where there is one."""
        return self._pair("numerator")

    def _pair(self, side):
        root = principal_sheet.fractional_root(*self._side(side))
        return np.array([] if root is None else [root, np.conj(root)])

    def reference_gain(self):
        """Static gain, or without one the median over the decades of its own time scales."""
        lowest = [side[np.argmin(orders)] for side, orders in
                  (self._present("numerator"), self._present("denominator"))]
        starts = [min(orders) for _, orders in
                  (self._present("numerator"), self._present("denominator"))]
        if starts[0] == starts[1]:
            return abs(lowest[0] / lowest[1])
        scale = principal_sheet.time_scales(*self._side("denominator"))
        omega = np.geomspace(scale[0] / 100, scale[-1] * 100, 1000)
        return float(np.median(np.abs(self.transfer_function(1j * omega))))

    def _present(self, side):
        """Non-zero coefficients of one side, and their orders."""
        values, orders = map(np.asarray, self._side(side))
        return values[values != 0], orders[values != 0]

    def require_stable(self, where):
        """Raise ModelError where a pole lies in the right half-plane or on its edge."""
        values, orders = self._present("denominator")
        # such terms all lie in one half-plane, and not all on its edge: they cannot cancel
        if values.min() > 0 and orders.max() <= 2 and np.any((orders > 0) & (orders < 2)):
            return
        count = principal_sheet.count_right_half_plane_zeros(*self._side("denominator"))
        if count > 0.25:
            raise ModelError(f"{where}.denominator_coefficients: unstable, {max(1, round(count))} "
                             "of its poles not in the left half-plane")
