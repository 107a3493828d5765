"""First-order change of a sensor's output by a force of its spring, for screening."""

import numba
import numpy as np

from ..model.core.bouc_wen import follow_one_way
from ..model.core.static_force import StaticForce
from ..model.effects.base import CORE
from ..signals.convolution import Convolution


def force_response(model, effect, motion, sampling_rate_hz, lag_s=0.0):
    """What a small force adds to the output of a linear sensor.

    The force N that belongs to a motion acts on the linear core: the first term of the Born series
    of the equation of motion.

    Parameters
    ----------
    model : AxisModel
        Without forces.
    effect : Effect
        One that adds a force.
    motion : ndarray, shape (n,)
        Of the mass [output units].
    sampling_rate_hz : float
    lag_s : float
        Time [s] by which the output's instants are later than the motion's.

    Returns
    -------
    ndarray, shape (n,)
    """
    core = model.effective_core
    force = static_force(effect.add_force(StaticForce(core=core)), motion, sampling_rate_hz)
    convolution = Convolution(force - force[0], sampling_rate_hz, abs(model.delay_s - lag_s))
    s = convolution.s
    transfer = -core.transfer_function(s) / core.sensitivity * np.exp(-s * (model.delay_s - lag_s))
    for link in model.dynamics[1:]:
        if link.stage > CORE:
            transfer = transfer * link.transfer_function(s)
    return convolution.response(transfer)


def static_force(force, motion, sampling_rate_hz):
    """Force of a spring along a motion, shape (n,)."""
    step = 2 * np.pi * force.natural_frequency_hz / sampling_rate_hz
    velocity = np.gradient(motion) / step
    total = sum((coefficient * motion**power for power, coefficient in
                 enumerate(force.polynomial, 2)), np.zeros(len(motion)))
    if force.friction_level:
        total = total + force.friction_level * np.sign(velocity)
    if force.strength:
        total = total + force.strength * _hysteresis(motion, force.beta, force.gamma)
    for law in force.laws:
        total = total + law.along(motion, velocity, step)[0]
    return total


_follow = numba.njit(cache=True)(follow_one_way)


@numba.njit(cache=True)
def _hysteresis(motion, beta, gamma):
    """Bouc-Wen variable along a motion; turns between two samples are taken as at one of them."""
    z = np.zeros(len(motion))
    for i in range(1, len(motion)):
        z[i] = _follow(z[i - 1], motion[i] - motion[i - 1], beta, gamma)
    return z
