r"""The general equation written with a sensor's parameters.

.. math:: D^{\nu_2} y / \omega_0^{\nu_2} + 2 \zeta D^{\nu_1} y / \omega_0^{\nu_1} + y
          = S (\beta D^\mu a / \omega_0^\mu + a)

Equation (5) of the seed paper with three terms against one or two; :math:`\omega_0 = 2 \pi f_0`.
"""

import numpy as np

from ...errors import ModelError
from .fractional_transfer_function import FractionalTransferFunction


def from_sensor_parameters(values):
    """Core with these parameters.

    Parameters
    ----------
    values : mapping
        ``sensitivity``, ``natural_frequency_hz``, ``damping_ratio``, ``damping_order``,
        ``inertia_order``; with a term on the right also ``slope_ratio`` and ``slope_order``.

    Returns
    -------
    FractionalTransferFunction
    """
    omega = 2 * np.pi * values["natural_frequency_hz"]
    inertia, damper = values["inertia_order"], values["damping_order"]
    gain, numerator, orders = values["sensitivity"], (), ()
    if "slope_ratio" in values:
        orders = (values["slope_order"],)
        numerator = (gain * values["slope_ratio"] * omega**-orders[0],)
    return FractionalTransferFunction(
        denominator_coefficients=(omega**-inertia, 2 * values["damping_ratio"] * omega**-damper,
                                  1.0),
        denominator_orders=(inertia, damper, 0.0),
        numerator_coefficients=(*numerator, gain), numerator_orders=(*orders, 0.0))


def sensor_parameters(core):
    """Parameters of a core, as `from_sensor_parameters` takes them.

    Raises
    ------
    ModelError
        If it has other terms.
    """
    inertia, damper, *left = sorted(zip(core.denominator_orders, core.denominator_coefficients),
                                    reverse=True) if len(core.denominator_orders) == 3 else ((), ())
    *slope, right = sorted(zip(core.numerator_orders, core.numerator_coefficients), reverse=True)
    if not left or left[0][0] != 0 or right[0] != 0 or len(slope) > 1 \
            or left[0][1] * inertia[1] <= 0:
        raise ModelError("core: has other terms than a sensor's: three on the left and one or two "
                         "on the right, the last of either side of order 0")
    static = left[0][1]
    omega = (inertia[1] / static)**(-1 / inertia[0])
    values = {"sensitivity": right[1] / static, "natural_frequency_hz": omega / (2 * np.pi),
              "damping_ratio": damper[1] / static * omega**damper[0] / 2,
              "damping_order": damper[0], "inertia_order": inertia[0]}
    if slope:
        order, coefficient = slope[0]
        values.update(slope_ratio=coefficient / right[1] * omega**order, slope_order=order)
    return {name: float(value) for name, value in values.items()}
