"""Correction of raw samples, for node and command alike."""

import functools

import numpy as np

from ..correction.design import design_inverse, reference_gain
from ..model.effects import Circumstances
from .bridging import MEMBERS
from .plausibility import stated_range
from .stream import Stream
from .time_steps import moved

# Sensors of one kind share their filters' design, which nothing changes.
_shared_design = functools.lru_cache(16)(design_inverse)


class Corrector(Stream):
    """Turns raw samples into the acceleration that made them, sample by sample.

    Parameters
    ----------
    model : SensorModel
    sampling_rate_hz : float
        Sampling rate [Hz]; 0: estimated from the first hundred stamps.
    noise_std : float or sequence of three, optional
        Standard deviation of the raw samples' white noise [output units], used where a sample
        comes without a variance. Default: the model's, if it has one.
    plausible_range : sequence of two floats, optional
        Lowest and highest raw value that can be true [output units]; default: the model's key of
        that name, else its limits of clipping, else what the record itself says (`plausibility`).
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

    Examples
    --------
    >>> import frac_accel
    >>> raw = frac_accel.read_bag("bags/classical_bench.mcap")["/imu/data_raw"]
    >>> live = frac_accel.Corrector(frac_accel.SensorModel.load("bags/classical_bench.yaml"))
    >>> blocks = [live.process(raw.stamps_ns[i:i + 50], raw.values[i:i + 50])
    ...           for i in range(0, 500, 50)]
    >>> sum(map(len, blocks)) + live.counters["warm_up"] + live.counters["waiting"]
    500
    """

    def _design(self, model, sampling_rate_hz, **wishes):
        return _shared_design(model, sampling_rate_hz, **wishes)

    def _adopt(self, model):
        super()._adopt(model)
        self._clips = bool(np.isfinite(model.limits).any())
        self._has_effects = any(axis.effects for axis in model.axes)
        self._needs_temperature = model.needs_temperature
        self._changes_base = any(axis.changes_base for axis in model.axes)

    def _count(self, values):
        found = {}
        if self._clips:
            found["clipped"] = int(self._is_clipped(values).any(axis=1).sum())
        if self._needs_temperature and not self._temperature.is_known:
            found["without_temperature"] = len(values)
        for name, count in found.items():
            self._totals[name] = self._totals.get(name, 0) + count

    def _begin(self):
        super()._begin()
        self._inverse = self._model.live_inverse(self.sampling_rate_hz)
        self._skew = self._model.axes[0].clock_ratio - 1
        self._steps = [(at_s, -step_s) for at_s, step_s in self._model.axes[0].time_steps]

    def _before(self, values, variance, index, stamps_ns):
        if self._clips:
            # of a clipped sample no more is known than that it is beyond the limit
            low, high = self._model.limits
            variance = np.where(self._is_clipped(values), ((high - low) / 2)**2, variance)
        if self._has_effects:
            values, variance = self._inverse(values, variance,
                                             self._circumstances(index, stamps_ns))
        return values, variance

    def _after(self, values, variance, index, stamps_ns):
        if self._changes_base:
            time_s = 1e-9 * (self._stamps(stamps_ns) - self._record_start_ns)
            gain = np.stack([np.broadcast_to(axis.base_gain(time_s), len(time_s))
                             for axis in self._model.axes], axis=1)
            values, variance = values / gain, variance / gain**2
        return self._model.along_reference(values, variance)

    def _stated_range(self):
        model = self._model
        gain = np.array([reference_gain(axis, model.band_hz) for axis in model.axes])
        return stated_range(self._plausible_range or model.plausible_range, model.limits, gain)

    def _limits(self):
        return self._model.limits

    def _errors_before(self, members, values, index, stamps_ns):
        if not self._has_effects:
            return members
        at = self._circumstances(index, stamps_ns)
        every = Circumstances(*(None if part is None else np.tile(part, MEMBERS) for part in at))
        wrong = (values[:, :, None] + members).transpose(2, 0, 1).reshape(-1, 3)
        right = self._model.without_sample_effects(values, at)
        wrong = self._model.without_sample_effects(wrong, every)
        return wrong.reshape(MEMBERS, -1, 3).transpose(1, 2, 0) - right[:, :, None]

    def _stamps(self, stamps_ns):
        """Instants that the samples with these stamps show."""
        since_start = stamps_ns - self._record_start_ns
        if self._steps:
            stamps_ns = self._record_start_ns + moved(since_start, self._steps)
        if self._skew:
            stamps_ns = stamps_ns + np.round(self._skew * since_start).astype(np.int64)
        return stamps_ns - self.design.sensor_delay_ns

    def _is_clipped(self, values):
        low, high = self._model.limits
        return (values <= low) | (values >= high)
