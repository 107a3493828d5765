"""Uncertainty of a model's frequency response."""

import dataclasses

import numpy as np
from scipy.special import ndtr

from .parameters import LINEAR, UncertainAxis

# Draws of a Monte Carlo: the 95 % interval's ends are then known to 3 % of a standard uncertainty.
_DRAWS = 10_000
_FREQUENCIES_AT_ONCE = 500
# Share of the values within the interval: two standard deviations of a Gaussian.
COVERAGE = float(ndtr(2) - ndtr(-2))


@dataclasses.dataclass(frozen=True, eq=False)
class ResponseUncertainty:
    """Amplitude and phase of a model with their uncertainty.

    Attributes
    ----------
    frequency_hz : ndarray, shape (m,)
    amplitude : ndarray, shape (m,)
        Of the model as it is [output units per m/s²].
    amplitude_std : ndarray, shape (m,)
        Standard uncertainty over the amplitude.
    amplitude_interval : ndarray, shape (m, 2)
        Ends of the 95.4 % interval [output units per m/s²].
    phase_deg : ndarray, shape (m,)
        Within ± 180 degrees.
    phase_std_deg : ndarray, shape (m,)
    phase_interval_deg : ndarray, shape (m, 2)
        Around `phase_deg`; may reach beyond ± 180 degrees.
    method : str
        ``first order`` or ``Monte Carlo``.
    nonlinearity : float
        What decided between them; see `UncertainAxis.nonlinearity`.
    """

    frequency_hz: np.ndarray
    amplitude: np.ndarray
    amplitude_std: np.ndarray
    amplitude_interval: np.ndarray
    phase_deg: np.ndarray
    phase_std_deg: np.ndarray
    phase_interval_deg: np.ndarray
    method: str
    nonlinearity: float

    def as_dict(self):
        """Plain numbers and lists."""
        return {field.name: value.tolist() if isinstance(value, np.ndarray) else value
                for field in dataclasses.fields(self)
                for value in [getattr(self, field.name)]}


def response_uncertainty(model, frequency_hz, axis="x"):
    r"""Propagate the uncertainty of a model's parameters to its amplitude and phase.

    First order where amplitude and phase are straight lines in the parameters,

    .. math:: u^2(\ln|H|) = g^T C g,\quad
              g_i = \operatorname{Re} \partial \ln H / \partial \theta_i

    and the imaginary part for the phase (JCGM 102:2011, 6.2). At two standard uncertainties along
    the eigenvectors of the covariance, neither may be further from its line than a tenth of its
    change, at any frequency asked for; otherwise by Monte Carlo (JCGM 102:2011, 7), whose draws
    respect the parameters' physical bounds (`UncertainAxis.draws`). A resonance that the
    frequency's uncertainty moves by more than its own width is such a case.

    Parameters
    ----------
    model : SensorModel
        With a ``covariance``, as `identify` gives it.
    frequency_hz : array_like, shape (m,)
    axis : {"x", "y", "z"}

    Returns
    -------
    ResponseUncertainty

    Raises
    ------
    ModelError
        If the model has no covariance, or not a valid one.

    Examples
    --------
    >>> import frac_accel
    >>> model = frac_accel.identify("bags/classical_bench.mcap").model
    >>> known = frac_accel.response_uncertainty(model, [50.0, 180.0])
    >>> [bool(value) for value in known.amplitude_std < 1e-3 * known.amplitude]
    [True, True]
    """
    uncertain = UncertainAxis.of(model, axis)
    frequency_hz = np.atleast_1d(np.asarray(frequency_hz, float))
    s = 2j * np.pi * frequency_hz
    response = model.frequency_response(frequency_hz, axis)
    amplitude, phase = np.abs(response), np.degrees(np.angle(response))

    def change(drawn):
        ratio = uncertain.ratio(drawn, s)
        return np.stack([np.abs(ratio) - 1, np.angle(ratio)])

    nonlinearity = max(uncertain.nonlinearity(lambda drawn, part=part: change(drawn)[part])
                       for part in (0, 1))
    if nonlinearity <= LINEAR:
        slopes = uncertain.slopes(s)
        std = np.sqrt(np.stack([np.einsum("im,ij,jm->m", part, uncertain.covariance, part)
                                for part in (slopes.real, slopes.imag)]))
        interval = std[..., None] * np.array([-2.0, 2.0])
    else:
        std, interval = _monte_carlo(uncertain, s)
    return ResponseUncertainty(
        frequency_hz, amplitude, std[0], amplitude[:, None] * (1 + interval[0]), phase,
        np.degrees(std[1]), phase[:, None] + np.degrees(interval[1]),
        "first order" if nonlinearity <= LINEAR else "Monte Carlo", nonlinearity)


def _monte_carlo(uncertain, s):
    """Standard deviations and intervals of the relative change of amplitude and of the phase's."""
    models = uncertain.draws(_DRAWS)
    tail = (1 - COVERAGE) / 2
    std, interval = np.empty((2, len(s))), np.empty((2, len(s), 2))
    for first in range(0, len(s), _FREQUENCIES_AT_ONCE):
        part = slice(first, first + _FREQUENCIES_AT_ONCE)
        ratio = np.stack([uncertain.ratio(model, s[part]) for model in models])
        for i, change in enumerate((np.abs(ratio) - 1, np.angle(ratio))):
            std[i, part] = change.std(axis=0)
            interval[i, part] = np.quantile(change, [tail, 1 - tail], axis=0).T
    return std, interval
