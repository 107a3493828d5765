"""`identify` finds a fractional damping where there is one, and only there."""

import numpy as np
import pytest
import rig

from frac_accel import identify
from frac_accel.identification.fit.output_error import fit_output_error
from frac_accel.identification.fit.structures import FractionalStructure
from frac_accel.io.samples import Samples
from frac_accel.model.core import Oscillator
from frac_accel.record import Record
from frac_accel.uncertainty import response_uncertainty

pytestmark = pytest.mark.long

RATE_HZ = 2000.0


def measured(rng, kind, snr_db, noise_ar=(), **draw):
    sensor = rig.draw_sensor(rng, RATE_HZ, kind, ["time_delay"], **draw)
    excitation = rig.band_noise(rng, RATE_HZ, 5.0, (5.0, 700.0), (1.0, 0.0, 0.0), lead_s=1.0)
    record = rig.simulate_record(sensor, excitation, rng, snr_db=snr_db, noise_ar=noise_ar)
    return sensor.core, Record.of(Samples.of(record.stamps_ns, record.reference),
                                  Samples.of(record.sensor_stamps_ns, record.sensor))


@pytest.mark.parametrize("noise_ar", [(), (0.9,)], ids=["white", "coloured"])
def test_order_is_found_and_covered(noise_ar):
    rng = np.random.default_rng(30261)
    scores, errors = [], []
    for _ in range(12):
        core, pair = measured(rng, "fractional", 40.0, noise_ar)
        result = identify(pair, structure="fractional")
        names = ("natural_frequency_hz", "damping_ratio", "damping_order", "sensitivity")
        scores.append([(result.parameters[name]["value"] - core[name])
                       / result.parameters[name]["std"] for name in names])
        errors.append(abs(result.parameters["damping_order"]["value"] - core["damping_order"]))
    assert np.median(errors) < 0.01
    # 48 correlated trials of 0.95, of which at least 12 are independent: the 1 % limit
    assert np.mean(np.abs(scores) < 1.96) > 0.8


def test_response_is_known_where_its_parameters_are_not():
    """Beyond the band, frequency and damping replace one another; within, the response is plain."""
    rng = np.random.default_rng(30265)
    at_hz = np.array([50.0, 100.0, 200.0])
    s = 2j * np.pi * at_hz
    for _ in range(4):
        core = {"type": "oscillator", "natural_frequency_hz": rng.uniform(600, 750),
                "damping_ratio": rng.uniform(0.5, 0.8), "damping_order": 1.0, "sensitivity": 1.0}
        excitation = rig.band_noise(rng, RATE_HZ, 3.0, (5.0, 400.0), (1.0, 0.0, 0.0), lead_s=0.2)
        record = rig.simulate_record(rig.Sensor(core, {}), excitation, rng, snr_db=20.0)
        pair = Record.of(Samples.of(record.stamps_ns, record.reference),
                         Samples.of(record.sensor_stamps_ns, record.sensor))
        result = identify(pair, structure="fractional")
        frequency = result.parameters["natural_frequency_hz"]
        assert frequency["std"] > 0.03 * frequency["value"]
        found = response_uncertainty(result.model, at_hz)
        truth = np.abs(Oscillator(core["natural_frequency_hz"],
                                  core["damping_ratio"]).transfer_function(s))
        assert np.all(found.amplitude_std < 0.01)
        assert np.all(np.abs(found.amplitude - truth) < 4 * found.amplitude_std)


def test_search_does_not_end_in_the_valley():
    """Weak damping: frequency, damping ratio and order can all but replace one another."""
    rng = np.random.default_rng(30264)
    for order in ((0.4, 0.6), (1.4, 1.6)) * 2:
        core, pair = measured(rng, "fractional", 40.0, damping_order=order,
                              damping_ratio=(0.02, 0.05))
        structure = FractionalStructure()
        record = (structure, pair.reference[:, 0], pair.sensor[:, 0], RATE_HZ)
        found = fit_output_error(*record)
        # the unknowns at the truth, by inverting what makes parameters of them
        truth = np.r_[[core[name] for name in structure.names]]
        unknowns = found.unknowns.copy()
        unknowns[2] = truth[2]
        for place in (1, 0):
            unknowns[place] += np.log(truth[place] / structure.physical(unknowns[:-1])[0][place])
        from_truth = fit_output_error(*record, start=unknowns)
        assert found.rmse <= from_truth.rmse * (1 + 1e-6)


@pytest.mark.parametrize("snr_db", [20.0, 40.0])
def test_classical_sensor_stays_classical(snr_db):
    rng = np.random.default_rng(30262)
    for _ in range(6):
        _, pair = measured(rng, "classical", snr_db)
        result = identify(pair)
        assert result.structure == "oscillator"
        assert "not significant" in result.reason or "not predict better" in result.reason


def test_fractional_sensor_is_found():
    rng = np.random.default_rng(30263)
    for low, high in [(0.4, 0.9), (1.1, 1.6)] * 3:
        core, pair = measured(rng, "fractional", 40.0, damping_order=(low, high))
        result = identify(pair)
        assert result.structure == "fractional", core
        assert result.model.core.damping_order == pytest.approx(core["damping_order"], abs=0.1)


def test_a_bound_of_the_search_is_named_and_does_not_feign_certainty():
    """A damping of order 1.3 with a structure whose order may not exceed 1.1."""
    class Limited(FractionalStructure):
        def bounds(self, rate, n):
            low, high = super().bounds(rate, n)
            return low, [*high[:2], 1.1]

    rng = np.random.default_rng(50262)
    sensor = rig.draw_sensor(rng, RATE_HZ, "fractional", damping_order=(1.3, 1.3),
                             damping_ratio=(0.2, 0.2), natural_frequency=(0.08, 0.08))
    excitation = rig.band_noise(rng, RATE_HZ, 2.0, (5.0, 700.0), (1.0, 0.0, 0.0), lead_s=1.0)
    record = rig.simulate_record(sensor, excitation, rng, snr_db=40.0)
    pair = record.reference[:, 0], record.sensor[:, 0], RATE_HZ
    free, limited = (fit_output_error(structure, *pair)
                     for structure in (FractionalStructure(), Limited()))
    assert free.at_bounds == () and limited.at_bounds == ("damping_order",)
    scores = [(fit["damping_order"] - 1.3) / fit.std[fit.names.index("damping_order")]
              for fit in (free, limited)]
    assert np.all(np.abs(scores) < 4)
    assert limited.std[1] > 5 * free.std[1]
