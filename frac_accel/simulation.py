"""Simulation of a sensor model from a sampled reference."""

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from .core import Arx
from .errors import FracAccelError, ModelError
from .model import AXES

# Fall of the damped kernel over one period of the transform: what wraps around is below 1e-8
# of the response, and undoing the damping over half the period costs four of sixteen digits.
_DAMPING = np.log(1e8)


def simulate(model, reference, sampling_rate_hz, axis=None, initial="rest"):
    r"""Output of a sensor, from the acceleration of its base.

    Parameters
    ----------
    model : SensorModel
    reference : array_like, shape (n, 3) or (n,)
        Acceleration [m/s²] at uniform instants; one column needs `axis`.
    sampling_rate_hz : float
    axis : {"x", "y", "z"}, optional
        The axis of a one-column reference. The other two axes are then at rest.
    initial : {"rest", "steady"}
        Motion before the record: none, or the first sample's value for ever (gravity).

    Returns
    -------
    ndarray, same shape as `reference`
        Output in the sensor's units at the same instants.

    Raises
    ------
    FracAccelError
        If the reference is not finite, empty or of the wrong shape.
    ModelError
        If an ``arx`` core holds at a lower rate than the record's.

    Notes
    -----
    The reference is taken as band-limited, and the response is the exact convolution with it from
    rest, by the numerical Laplace transform: with damped samples :math:`a_n e^{-\sigma n T}` and
    the transfer function on the line :math:`\sigma + j\omega`, the product of the two transforms
    has no wrap-around and needs no discretisation of the derivative of order :math:`\nu`
    (D. J. Wilcox, *Int. J. Elect. Eng. Educ.* 15 (1978) 247-265). O(n log n).
    """
    values = np.asarray(reference, float)
    single = values.ndim == 1
    if single:
        if axis not in tuple(AXES):
            raise FracAccelError(f"axis: {axis!r} given for a reference of one column, "
                                 "expected x, y or z")
        column = AXES.index(axis)
        values = np.zeros((len(values), 3))
        values[:, column] = reference
    if values.ndim != 2 or values.shape[1] != 3 or not len(values):
        raise FracAccelError(f"reference: shape {np.shape(reference)} given, expected (n, 3)")
    if not np.isfinite(values).all():
        first = int(np.flatnonzero(~np.isfinite(values).all(axis=1))[0])
        raise FracAccelError(f"reference: sample {first} is not finite")
    if not np.isfinite(sampling_rate_hz) or sampling_rate_hz <= 0:
        raise FracAccelError(f"sampling_rate_hz: {sampling_rate_hz} given, expected above 0")
    if initial not in ("rest", "steady"):
        raise FracAccelError(f"initial: {initial!r} given, expected rest or steady")
    result = np.empty_like(values)
    for i, axis_model in enumerate(model.axes):
        result[:, i] = _respond(axis_model, values[:, i], sampling_rate_hz, initial)
    result = model.apply_sample_effects(result)
    return result[:, column] if single else result


def _respond(model, reference, rate, initial):
    """Composite linear response of one axis, pure delay included."""
    core = model.effective_core
    if isinstance(core, Arx) and rate > core.sampling_rate_hz * (1 + 1e-6):
        raise ModelError(f"core.sampling_rate_hz: the model holds at {core.sampling_rate_hz:g} Hz, "
                         f"the record has {rate:g} Hz")
    level = reference[0] if initial == "steady" else 0.0
    moving = reference - level
    result = np.full(len(reference), level * static_gain(model) if level else 0.0)
    if moving.any():
        convolution = Convolution(moving, rate, abs(model.delay_s))
        s = convolution.s
        result += convolution.response(model.transfer_function(s) * np.exp(-s * model.delay_s))
    return result


class Convolution:
    """Responses of linear systems to one input, each from rest before the first sample.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Input.
    rate : float
        Its sampling rate [Hz].
    memory_s : float
        Time [s] by which a response may come before its cause (a negative delay), which needs
        room.
    """

    def __init__(self, values, rate, memory_s=0.0):
        self._n = len(values)
        self._length = _fast_length(2 * self._n + int(np.ceil(memory_s * rate)))
        sigma = _DAMPING / self._length
        self._damping = np.exp(-sigma * np.arange(self._n))
        self._s = (sigma + 2j * np.pi * np.arange(self._length // 2 + 1) / self._length) * rate
        self._spectrum = rfft(values * self._damping, self._length)

    @property
    def s(self):
        """Complex frequencies [rad/s] on which a transfer function is needed."""
        return self._s

    def response(self, transfer):
        """Responses of systems, shape (..., n), from their transfer functions (...) at `s`."""
        spectrum = self._spectrum * _smooth_at_nyquist(transfer)
        return irfft(spectrum, self._length)[..., :self._n] / self._damping


def _smooth_at_nyquist(response):
    """Turn the phase towards a multiple of pi in the last fifth below the Nyquist frequency.

    Anything else there jumps to its conjugate, and the jump rings through the record from both its
    ends with an amplitude that falls only as 1/n.
    """
    first = int(0.8 * response.shape[-1])
    ramp = np.linspace(0, 1, response.shape[-1] - first)
    angle = np.angle(response[..., -1:])
    excess = angle - np.round(angle / np.pi) * np.pi
    smooth = response.copy()
    smooth[..., first:] *= np.exp(-1j * excess * ramp * ramp * (3 - 2 * ramp))
    return smooth


def static_gain(model):
    """Response to a constant acceleration [output units per m/s²]; 0 behind a high-pass."""
    # the limit, since orders below zero and high-passes make s = 0 itself undefined
    gain = model.transfer_function(np.array([1e-9 + 0j]))[0]
    return float(gain.real) if np.isfinite(gain) and abs(gain) > 1e-6 * _reference_gain(model) \
        else 0.0


def _reference_gain(model):
    gain = np.abs(model.transfer_function(2j * np.pi * np.geomspace(1e-3, 1e5, 200)))
    return np.max(gain[np.isfinite(gain)], initial=0.0)


def _fast_length(n):
    """Even length of at least `n` that the transform is fast at."""
    return 2 * next_fast_len((n + 1) // 2, real=True)
