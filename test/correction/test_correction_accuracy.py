"""The bar: records at 60 dB, corrected against the reference, in band, to 1 % and ten times better.

The records come from the independent simulator. "Raw" is the sensor's output over its sensitivity,
its offset and its own delay taken out: what a user without a model of the dynamics has. The raw
record is moved by the delay in whole samples only, as a user without a model could.
"""

import numpy as np
import pytest
import rig
from random_models import draw_sensor, model_of

from frac_accel import Corrector
from frac_accel.correction.design import reference_gain
from frac_accel.model.effects import Circumstances
from frac_accel.signals.metrics import error_metrics, interpolate

RATE = 2000.0
SNR_DB = 60
KINDS = ("classical", "fractional")
# Within these the sensor keeps a tenth of its gain over the whole band that it is excited in.
RANGES = {"natural_frequency": (0.03, 0.3), "damping_ratio": (0.02, 1.0),
          "damping_order": (0.4, 1.6)}


def random_case(seed):
    """Sensor, model, and its record; also for sweeps over more seeds."""
    rng = np.random.default_rng([2, seed])
    sensor = draw_sensor(rng, RATE, KINDS, **RANGES)
    model = model_of(sensor)
    corrector = Corrector(model, RATE)
    bands = [axis.band_hz for axis in corrector.design.axes]
    low, high = max(band[0] for band in bands), min(band[1] for band in bands)
    excitation = rig.band_noise(rng, RATE, 4.0, (max(low, 2.0), high), lead_s=0.5)
    return sensor, corrector, rig.simulate_record(sensor, excitation, rng, SNR_DB), (
        max(low, 2.0), high)


def errors(sensor, corrector, record, band):
    """NRMSE in band of the corrected and of the raw record, worst axis, shape (2,)."""
    corrected = corrector.process(record.sensor_stamps_ns, record.sensor)
    reference = interpolate(record.stamps_ns, record.reference, corrected.stamps_ns, RATE)
    usable = np.isfinite(reference).all(axis=1)
    model = model_of(sensor)
    shift = round(model.axes[0].delay_s * RATE)
    offset = model.live_simulation(RATE)(np.zeros((1, 3)), Circumstances.at_rest(1))
    raw = (record.sensor - offset)[shift:]
    raw_reference = record.reference[:len(raw)]
    result = []
    for axis in range(3):
        own = error_metrics(reference[usable, axis], corrected.values[usable, axis], RATE, [band])
        before = error_metrics(raw_reference[:, axis],
                               raw[:, axis] / reference_gain(model.axes[axis]), RATE, [band])
        result.append((own.total.nrmse, before.total.nrmse))
    return np.array(result)


@pytest.mark.parametrize("seed", range(12))
def test_corrected_to_one_percent_and_ten_times_better(seed):
    for corrected, raw in errors(*random_case(seed)):
        assert corrected <= 0.01
        assert raw >= 10 * corrected
