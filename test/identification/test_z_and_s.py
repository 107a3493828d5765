"""A model in z stays what it is at any rate, and the way from z to s is exact and named.

`test_model_file.py` refuses coefficients in z where an equation in s is expected.
"""

import numpy as np
import pytest
import rig

from frac_accel import Corrector, identify, simulate
from frac_accel.identification.fit.continuous_poles import METHOD
from frac_accel.io.samples import Samples
from frac_accel.model import SensorModel
from frac_accel.model.core import Arx
from frac_accel.record import Record

RATE_HZ = 2000.0


def drawn(rng, band_hz, snr_db=None, **draw):
    sensor = rig.draw_sensor(rng, RATE_HZ, "arx", **draw)
    excitation = rig.band_noise(rng, RATE_HZ, 3.0, band_hz, (1.0, 0.0, 0.0))
    noise = {} if snr_db is None else {"rng": rng, "snr_db": snr_db}
    return sensor, rig.simulate_record(sensor, excitation, **noise)


def test_simulation_at_a_lower_rate_is_the_same_system():
    """Every other sample; the same coefficients at half the rate would be another sensor."""
    rng = np.random.default_rng(60261)
    for _ in range(4):
        sensor, record = drawn(rng, (5.0, 300.0))
        model = SensorModel.from_dict(sensor.to_model())
        truth = record.sensor[::2, 0]
        # the end of a record that ends in mid-motion depends on what would come after it
        inner = slice(0, -64)
        found = simulate(model, record.reference[::2, 0], RATE_HZ / 2, axis="x")
        assert np.std((found - truth)[inner]) < 1e-3 * np.std(truth)
        mistaken = SensorModel(Arx(model.core.numerator, model.core.denominator, RATE_HZ / 2))
        wrong = simulate(mistaken, record.reference[::2, 0], RATE_HZ / 2, axis="x")
        assert np.std((wrong - truth)[inner]) > 0.02 * np.std(truth)


def test_correction_at_a_lower_rate_is_the_same_system():
    sensor, record = drawn(np.random.default_rng(60262), (20.0, 200.0),
                           natural_frequency=(0.1, 0.2), damping_ratio=(0.1, 0.5))
    model = SensorModel.from_dict(sensor.to_model())
    corrected = Corrector(model, RATE_HZ / 2, bandwidth_hz=250.0).process(
        record.sensor_stamps_ns[::2], record.sensor[::2])
    place = np.searchsorted(record.stamps_ns, corrected.stamps_ns)
    motion = record.reference[place, 0]
    settled = slice(len(place) // 2, None)
    assert np.std((corrected.values[:, 0] - motion)[settled]) < 0.005 * np.std(motion)


def test_poles_in_s_come_with_their_method():
    """Each oscillating pair of the saved model, mapped by hand from its denominator."""
    _, record = drawn(np.random.default_rng(60263), (5.0, 700.0), 40.0,
                      natural_frequency=(0.05, 0.1), damping_ratio=(0.05, 0.3))
    pair = Record.of(Samples.of(record.stamps_ns, record.reference),
                     Samples.of(record.sensor_stamps_ns, record.sensor))
    result = identify(pair, structure="arx")
    equivalent = result.model.metadata["continuous_equivalent"]
    assert equivalent["method"] == METHOD
    assert any(METHOD in note for note in result.notes)
    z = np.roots(result.model.core.denominator)
    s = RATE_HZ * np.log(z[z.imag > 0])
    assert [pair["natural_frequency_hz"]["value"] for pair in equivalent["poles"]] \
        == pytest.approx(sorted(np.abs(s) / (2 * np.pi)), rel=1e-9)
