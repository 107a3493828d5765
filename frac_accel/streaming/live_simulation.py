"""Simulation of a sensor live, sample by sample."""

import numpy as np

from ..correction.design import design_simulator
from .stream import Stream
from .time_steps import moved


class LiveSimulator(Stream):
    """Turns the acceleration of a base into what a sensor on it would say, sample by sample.

    Parameters
    ----------
    model : SensorModel
    sampling_rate_hz : float
        Sampling rate [Hz]; 0: estimated from the first hundred stamps.

    Raises
    ------
    DesignError
        If the sensor cannot be played to the tolerance of `design_simulator`.

    Notes
    -----
    See `Stream` for how samples flow. Each keeps the stamp of the reference sample that it belongs
    to, so the sensor's own delay is in the values, as in `simulate`; only a clock that is skewed or
    jumps changes stamps. A nonlinear spring and friction are simulated offline alone.

    Examples
    --------
    >>> import numpy as np, frac_accel
    >>> model = frac_accel.SensorModel.load("bags/classical_bench.yaml")
    >>> live = frac_accel.LiveSimulator(model, 1000.0)
    >>> still = live.process(np.arange(2000) * 1_000_000, np.tile([0.0, 0.0, 9.81], (2000, 1)))
    >>> bool(abs(still.values[-1, 2] / 9.81 - model.axes[2].core.sensitivity) < 1e-3)
    True
    """

    _is_watched = False

    def _design(self, model, sampling_rate_hz, **wishes):
        return design_simulator(model, sampling_rate_hz, **wishes)

    def _begin(self):
        super()._begin()
        self._effects = self._model.live_simulation(self.sampling_rate_hz)

    def _before(self, values, variance, index, stamps_ns):
        return self._model.along_sensor(values), variance

    def _after(self, values, variance, index, stamps_ns):
        return self._effects(values, self._circumstances(index, stamps_ns)), variance

    def _stamps(self, stamps_ns):
        """A clock that runs slow puts the same instant at an earlier stamp."""
        ratio = self._model.axes[0].clock_ratio
        steps = self._model.axes[0].time_steps
        if ratio == 1 and not steps:
            return stamps_ns
        since = stamps_ns - self._record_start_ns
        stamps_ns = self._record_start_ns + moved(since, steps)
        return stamps_ns + np.round((1 / ratio - 1) * since).astype(np.int64)
