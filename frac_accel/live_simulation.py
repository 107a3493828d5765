"""Simulation of a sensor live, sample by sample."""

from .correction.design import design_simulator
from .correction.stream import Stream
from .effects import Circumstances


class LiveSimulator(Stream):
    """Turns the acceleration of a base into what a sensor on it would say, sample by sample.

    Parameters
    ----------
    model : SensorModel
    sample_rate_hz : float
        Sampling rate [Hz]; 0: estimated from the first hundred stamps.

    Raises
    ------
    DesignError
        If the sensor cannot be played to the tolerance of `design_simulator`.

    Notes
    -----
    See `Stream` for how samples flow. Each keeps the stamp of the reference sample that it belongs
    to, so the sensor's own delay is in the values, as in `simulate`.
    """

    def _design(self, model, sample_rate_hz, **wishes):
        return design_simulator(model, sample_rate_hz, **wishes)

    def _after(self, values):
        return self._model.apply_sample_effects(values, Circumstances.at_rest(len(values)))
