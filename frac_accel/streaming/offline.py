"""Correction of a whole record at once."""

from __future__ import annotations

from typing import Any

from ..io.samples import Samples
from ..model import SensorModel
from ..record.ordering import in_order
from ..record.sources import is_bag, samples_of
from . import Corrector


def correct(source: Any, model: SensorModel, sampling_rate_hz: float | None = None,
            axis: str = "x", temperature_c: float | None = None, sensor: str | None = None,
            **wishes: Any) -> Samples:
    """Acceleration that made a sensor's samples.

    Parameters
    ----------
    source : str, Path, Samples or array_like, shape (n,) or (n, 3)
        A bag, or the sensor's samples [output units].
    model : SensorModel
    sampling_rate_hz : float, optional
        Needed by an array.
    axis : {"x", "y", "z"}
        Axis of an array of one column.
    temperature_c : float, optional
        Temperature [°C], for models that depend on it.
    sensor : str, optional
        Topic, where the source is a bag.
    **wishes
        ``bandwidth_hz``, ``max_delay_s``, ``lowest_hz``, ``noise_std`` as for `Corrector`.

    Returns
    -------
    Samples
        Accelerations [m/s²], shape (m, 3), their variance, and the instants that they show; fewer
        than were given, by what the filter needs at both ends.

    Raises
    ------
    FracAccelError
        If the samples cannot be used; DesignError if the model cannot be inverted as asked for.

    Examples
    --------
    >>> import numpy as np, frac_accel
    >>> from frac_accel.model.core import Oscillator
    >>> model = frac_accel.SensorModel(Oscillator(200.0, 0.5, sensitivity=2.0))
    >>> motion = np.hanning(2000) * np.sin(2 * np.pi * 30 * np.arange(2000) / 1000)
    >>> output = frac_accel.simulate(model, motion, 1000.0, "x")
    >>> corrected = frac_accel.correct(output, model, 1000.0)
    >>> place = corrected.stamps_ns // 1_000_000
    >>> bool(np.max(np.abs(corrected.values[:, 0] - motion[place])) < 1e-3)
    True
    """
    if is_bag(source):
        from ..io.bag import RAW_TOPIC, read_bag
        topic = sensor or RAW_TOPIC
        samples, _ = in_order(read_bag(source, [topic])[topic])
    else:
        samples = samples_of(source, sampling_rate_hz, axis, "sensor")
    corrector = Corrector(model, sampling_rate_hz or 0.0, **wishes)
    if temperature_c is not None:
        corrector.set_temperature(temperature_c)
    blocks = [corrector.process(samples.stamps_ns, samples.values, samples.variance),
              corrector.finish()]
    return Samples.concatenate([Samples.of(block.stamps_ns, block.values, block.variance,
                                           samples.frame_id) for block in blocks])
