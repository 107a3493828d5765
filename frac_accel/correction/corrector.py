"""Correction of raw samples, for node and command alike."""

from ..effects import Circumstances
from .design import design_inverse
from .stream import Stream


class Corrector(Stream):
    """Turns raw samples into the acceleration that made them, sample by sample.

    Parameters
    ----------
    model : SensorModel
    sample_rate_hz : float
        Sampling rate [Hz]; 0: estimated from the first hundred stamps.
    noise_std : float or sequence of three, optional
        Standard deviation of the raw samples' white noise [output units], used where a sample
        comes without a variance. Default: the model's, if it has one.
    **wishes
        ``bandwidth_hz``, ``max_delay_s``, ``lowest_hz``, ``tolerance`` as in `design_inverse`.

    Raises
    ------
    DesignError
        If the inverse cannot be met.

    Notes
    -----
    See `Stream` for how samples flow. A corrected sample's stamp is that of the raw sample that it
    belongs to, less the sensor's own delay.
    """

    def _design(self, model, sample_rate_hz, **wishes):
        return design_inverse(model, sample_rate_hz, **wishes)

    def _before(self, values):
        return self._model.remove_sample_effects(values, Circumstances.at_rest(len(values)))
