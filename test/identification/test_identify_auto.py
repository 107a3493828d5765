"""`auto` takes the model that names no cause only where no oscillator describes the sensor."""

import numpy as np
import pytest
import rig

from frac_accel import identify
from frac_accel.identification.response.frequency_response import linear_share
from frac_accel.io.samples import Samples
from frac_accel.record import Record

RATE_HZ = 2000.0


def measured(rng, kind, snr_db, effects=("time_delay",), noise_ar=(), **draw):
    sensor = rig.draw_sensor(rng, RATE_HZ, kind, effects, **draw)
    excitation = rig.band_noise(rng, RATE_HZ, 4.0, (5.0, 700.0), (1.0, 0.0, 0.0), lead_s=1.0)
    record = rig.simulate_record(sensor, excitation, rng, snr_db=snr_db, noise_ar=noise_ar)
    return Record.of(Samples.of(record.stamps_ns, record.reference),
                     Samples.of(record.sensor_stamps_ns, record.sensor))


@pytest.mark.parametrize("effects", [(), ("mounting_resonance",)])
def test_more_than_an_oscillator_is_told_from_one(effects):
    rng = np.random.default_rng(50261)
    kind = "classical" if effects else "arx"
    pair = measured(rng, kind, 40.0, effects, natural_frequency=(0.05, 0.15),
                    damping_ratio=(0.05, 0.4))
    result = identify(pair)
    assert result.structure == "arx"
    assert "clearly better than an oscillator" in result.reason
    assert "held-out residual" in result.reason and "cannot name" in result.reason
    seismic = identify(pair, structure="oscillator")
    assert result.held_out_nrmse < 0.7 * seismic.held_out_nrmse


@pytest.mark.parametrize("kind, structure", [("classical", "oscillator"),
                                             ("fractional", "fractional")])
def test_an_oscillator_is_not_replaced(kind, structure):
    """Noise, coloured too, is nothing that another model could explain."""
    rng = np.random.default_rng(50262)
    for noise_ar in ((), (0.9,)):
        result = identify(measured(rng, kind, 40.0, noise_ar=noise_ar, damping_ratio=(0.1, 0.6),
                                   damping_order=(0.4, 0.8)))
        assert result.structure == structure
        assert "transfer function" not in result.reason


def test_a_distortion_is_not_explained_by_another_linear_model():
    """Two thirds and more of what cubic stiffness leaves follow no linear model."""
    rng = np.random.default_rng(50263)
    result = identify(measured(rng, "classical", 50.0, ("cubic_stiffness",),
                               natural_frequency=(0.05, 0.1), damping_ratio=(0.05, 0.1)))
    assert result.structure != "arx"


def test_linear_share():
    rng = np.random.default_rng(50264)
    reference, noise = rng.standard_normal((2, 20_000))
    caused = np.convolve(reference, [1.0, -0.5, 0.25])[:len(reference)]
    for share in (0.0, 0.3, 0.7, 1.0):
        residual = np.sqrt(share) * caused / np.std(caused) + np.sqrt(1 - share) * noise
        residual[:40] = np.nan
        # by chance each of 63 overlapping segments has some of it
        assert linear_share(reference, residual) == pytest.approx(share, abs=0.04)
    assert linear_share(reference, np.zeros(len(reference))) == 0.0
