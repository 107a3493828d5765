"""`identify --structure arx` is consistent where least squares is not, and honest about the rest.

Truth is the rig's exact frequency response; errors are relative to its RMS in the excited band.
"""

import numpy as np
import pytest
import rig

from frac_accel import Corrector, SensorModel, identify
from frac_accel.errors import IdentificationError
from frac_accel.identification.fit.arx import Orders, fit_arx, least_squares
from frac_accel.identification.fit.continuous_poles import continuous_poles
from frac_accel.io.samples import Samples
from frac_accel.record import Record

pytestmark = pytest.mark.long

RATE_HZ = 2000.0
BAND_HZ = np.geomspace(10.0, 600.0, 60)
S = 2j * np.pi * BAND_HZ
TRUE_ORDERS = Orders(2, 3, 0)


def measured(rng, kind, snr_db=20.0, noise_ar=(), effects=(), duration_s=5.0, **draw):
    """A random sensor and the pair that a bench would record of it, in mid-motion."""
    sensor = rig.draw_sensor(rng, RATE_HZ, kind, effects, **draw)
    excitation = rig.band_noise(rng, RATE_HZ, duration_s, (5.0, 700.0), (1.0, 0.0, 0.0),
                                lead_s=1.0)
    return sensor, rig.simulate_record(sensor, excitation, rng, snr_db=snr_db, noise_ar=noise_ar)


def pair_of(record, keep=slice(None), late_ns=0):
    return Record.of(Samples.of(record.stamps_ns, record.reference),
                     Samples.of(record.sensor_stamps_ns[keep] + late_ns, record.sensor[keep]))


def columns(pair):
    return pair.reference[:, 0], pair.sensor[:, 0]


def response_of(model):
    axis = model.axes[0]
    return axis.transfer_function(S) * np.exp(-S * axis.delay_s)


def rational(a, b, delay):
    """Response of a1..., b0... in z."""
    z = np.exp(S / RATE_HZ)
    return z**-delay * np.polyval(b[::-1], 1 / z) / np.polyval(np.r_[1, a][::-1], 1 / z)


def error(response, sensor):
    truth = rig.transfer_function(sensor, "x", S)
    return np.sqrt(np.mean(np.abs(response - truth)**2) / np.mean(np.abs(truth)**2))


@pytest.mark.parametrize("kind, effects", [("arx", ["offset"]), ("classical", ["time_delay"])])
def test_least_squares_is_biased_and_the_answer_is_not(kind, effects):
    rng = np.random.default_rng(40261)
    refined, ordinary = [], []
    for _ in range(4):
        sensor, record = measured(rng, kind, effects=effects)
        pair = pair_of(record)
        fit = fit_arx(*columns(pair), RATE_HZ, pair.valid, pair.lag_s)
        biased = least_squares(*columns(pair), fit.orders)
        a, b = np.split(biased, [fit.orders.poles])
        ordinary.append(error(rational(a, b, fit.orders.delay), sensor))
        refined.append(error(fit.core().transfer_function(S) * np.exp(-S * fit["delay_s"]),
                             sensor))
    assert np.median(refined) < 0.004 and max(refined) < 0.01
    assert np.median(ordinary) > 10 * np.median(refined)


def test_a_longer_record_is_more_accurate():
    """Consistent: sixteen times the samples, a quarter of the error."""
    rng = np.random.default_rng(40262)
    short, long = [], []
    for _ in range(6):
        sensor, record = measured(rng, "arx", duration_s=12.0)
        start = (TRUE_ORDERS, np.r_[sensor.core["denominator"][1:], sensor.core["numerator"]])
        for errors, part in ((short, slice(1500)), (long, slice(24000))):
            reference, output = columns(pair_of(record))
            fit = fit_arx(reference[part], output[part], RATE_HZ, start=start)
            errors.append(error(fit.core().transfer_function(S), sensor))
    assert np.median(np.divide(short, long)) > 2.5


@pytest.mark.parametrize("noise_ar", [(), (0.9,)], ids=["white", "coloured"])
def test_intervals_cover_the_truth(noise_ar):
    """Parameters, offset and poles in s, with the orders known."""
    rng = np.random.default_rng(40263)
    scores = []
    for _ in range(40):
        sensor, record = measured(rng, "arx", noise_ar=noise_ar, effects=["offset"],
                                  damping_ratio=(0.02, 0.5), duration_s=4.0)
        truth = np.r_[sensor.core["denominator"][1:], sensor.core["numerator"],
                      0.0, sensor.effects["offset"]["offset"]]
        fit = fit_arx(*columns(pair_of(record)), RATE_HZ, start=(TRUE_ORDERS, truth[:5]))
        estimated = np.arange(len(truth)) != 5
        found, = fit.continuous_equivalent()["poles"]
        exact, = continuous_poles(sensor.core["denominator"], np.eye(2), RATE_HZ)
        scores.append([*((fit.values - truth) / np.where(estimated, fit.std, 1))[estimated],
                       *((found[name]["value"] - exact[name]["value"]) / found[name]["std"]
                         for name in found)])
    # 320 correlated trials of 0.95
    assert 0.9 <= np.mean(np.abs(scores) < 1.96) <= 0.99
    assert 0.85 < np.sqrt(np.mean(np.square(scores))) < 1.2


@pytest.mark.parametrize("kind, effects", [("arx", []), ("classical", ["time_delay"])])
def test_intervals_of_the_response_cover_the_truth_whatever_the_orders(kind, effects):
    """Amplitude and phase where excited; of a classical sensor no orders in z are the true ones."""
    rng = np.random.default_rng(40276)
    scores = []
    for i in range(10):
        sensor, record = measured(rng, kind, rng.uniform(20, 40), ((), (0.9,))[i % 2], effects,
                                  duration_s=2.5)
        fit = fit_arx(*columns(pair_of(record)), RATE_HZ)
        count = fit.orders.coefficients
        a, b = np.split(fit.values[:count], [fit.orders.poles])
        found = rational(a, b, fit.orders.delay)
        back = np.exp(-S / RATE_HZ)
        # derivatives of the logarithm of the response
        slopes = np.concatenate([
            -back**np.arange(1, len(a) + 1)[:, None] / np.polyval(np.r_[1, a][::-1], back),
            back**np.arange(len(b))[:, None] / np.polyval(b[::-1], back)])
        wrong = np.log(rig.transfer_function(sensor, "x", S) / found)
        for part in (np.real, np.imag):
            std = np.sqrt(np.einsum("if,ij,jf->f", part(slopes), fit.covariance[:count, :count],
                                    part(slopes)))
            scores.append(part(wrong) / std)
    assert 0.89 <= np.mean(np.abs(scores) < 1.96) <= 0.995
    assert np.sqrt(np.mean(np.square(scores))) < 1.3


def test_true_orders_are_found():
    rng = np.random.default_rng(40264)
    found = []
    for _ in range(10):
        _, record = measured(rng, "arx", snr_db=50.0, duration_s=2.5)
        pair = pair_of(record)
        orders = fit_arx(*columns(pair), RATE_HZ).orders
        # the numerator has one more at either end than was chosen
        found.append(Orders(orders.poles, orders.inputs - 2, orders.delay + 1))
    # a zero close to the origin is a pole there to all that noise lets see: the split may differ
    assert [orders.coefficients for orders in found].count(TRUE_ORDERS.coefficients) >= 9
    assert found.count(TRUE_ORDERS) > 5


def test_poles_go_to_s_through_the_logarithm():
    """The rig's oscillator, sampled: its poles come back exactly, and the uncertainties add up."""
    rng = np.random.default_rng(40265)
    for ratio in (0.02, 0.4, 0.95, 1.3):
        natural = rng.uniform(50, 300)
        s = 2 * np.pi * natural * (-ratio + np.array([1, -1]) * np.sqrt(ratio**2 - 1 + 0j))
        a = np.poly(np.exp(s / RATE_HZ)).real
        covariance = np.array([[4.0, 1.0], [1.0, 2.0]]) * 1e-18
        pair, = continuous_poles(a, covariance, RATE_HZ)
        assert pair["natural_frequency_hz"]["value"] == pytest.approx(natural, rel=1e-9)
        assert pair["damping_ratio"]["value"] == pytest.approx(ratio, rel=1e-9)
        drawn = [continuous_poles(a + [0, *step], covariance, RATE_HZ)[0]
                 for step in rng.multivariate_normal([0, 0], covariance, 2000)]
        for name, entry in pair.items():
            spread = np.std([values[name]["value"] for values in drawn])
            assert entry["std"] == pytest.approx(spread, rel=0.06)
    assert continuous_poles([1, 0.5], np.eye(1), RATE_HZ) == []


def test_result_says_what_its_numbers_mean(tmp_path):
    sensor, record = measured(np.random.default_rng(40266), "classical", snr_db=40.0,
                              natural_frequency=(0.05, 0.1), damping_ratio=(0.05, 0.2))
    result = identify(pair_of(record), structure="arx")
    assert result.parameters["a1"]["unit"] == "1" and result.parameters["a1"]["std"] > 0
    assert result.parameters["b0"]["unit"] == "output units per m/s^2"
    assert result.held_out_nrmse == pytest.approx(0.01, rel=0.2)
    result.model.save(tmp_path / "m.yaml")
    model = SensorModel.load(tmp_path / "m.yaml")
    assert model.core.type == "arx" and model.core.sampling_rate_hz == RATE_HZ
    equivalent = model.metadata["continuous_equivalent"]
    assert "ln(z)" in equivalent["method"]
    found = min(equivalent["poles"], key=lambda pair: abs(
        pair["natural_frequency_hz"]["value"] - sensor.core["natural_frequency_hz"]))
    for name, entry in found.items():
        assert entry["value"] == pytest.approx(sensor.core[name], rel=0.02)
    notes = " ".join(result.notes)
    assert "chosen by BIC and on held-out data" in notes
    assert "hold in z at 2000 Hz only" in notes and "Hz with damping ratio" in notes


def test_lag_between_the_topics_goes_into_the_delay():
    sensor, record = measured(np.random.default_rng(40267), "arx", snr_db=60.0)
    late_ns = int(0.3e9 / RATE_HZ)
    result = identify(pair_of(record, late_ns=late_ns), structure="arx")
    assert result.parameters["delay_s"]["value"] % (1 / RATE_HZ) == pytest.approx(late_ns * 1e-9,
                                                                                  rel=1e-3)
    truth = rig.transfer_function(sensor, "x", S) * np.exp(-S * late_ns * 1e-9)
    assert np.max(np.abs(response_of(result.model) / truth - 1)) < 0.005
    assert any("stamps are later" in note for note in result.notes)


def test_missing_samples_do_not_count():
    rng = np.random.default_rng(40268)
    sensor, record = measured(rng, "arx", snr_db=60.0)
    keep = rng.random(len(record.sensor)) > 0.05
    result = identify(pair_of(record, keep), structure="arx")
    assert error(response_of(result.model), sensor) < 1e-3
    assert any("have no sample" in note for note in result.notes)


def test_no_pole_rings_where_nothing_excites_it():
    """It would live on its initial values alone, and ring in every simulation of the model."""
    rng = np.random.default_rng(0)
    for noise_ar in ((), (0.9,)) * 3:
        _, record = measured(rng, "arx", 40.0, noise_ar, ["time_delay"])
        result = identify(pair_of(record), structure="arx")
        assert result.held_out_nrmse < 1.5 * result.nrmse
        poles = np.roots(result.model.core.denominator)
        above = np.abs(np.angle(poles)) > 2 * np.pi * 720.0 / RATE_HZ
        assert np.all(np.abs(poles[above]) < 0.999)


def test_corrected_record_is_the_motion():
    rng = np.random.default_rng(40269)
    for kind in ("arx", "classical"):
        sensor, record = measured(rng, kind, snr_db=60.0, effects=["offset"],
                                  natural_frequency=(0.1, 0.2), damping_ratio=(0.05, 0.7))
        pair = pair_of(record)
        model = identify(pair, structure="arx").model
        corrected = Corrector(model, RATE_HZ, bandwidth_hz=300.0).process(
            record.sensor_stamps_ns, record.sensor)
        seconds = 1e-9 * (corrected.stamps_ns - record.stamps_ns[0])
        motion = pair.reference[:, 0]
        frequency = np.fft.rfftfreq(4096, 1 / RATE_HZ)
        band = (frequency > 20) & (frequency < 280)
        # stamps of the estimates lie between samples where the sensor has a delay
        shift = seconds[2000] * RATE_HZ - round(seconds[2000] * RATE_HZ)
        begin = int(round(seconds[2000] * RATE_HZ))
        window = np.hanning(4096)
        estimate = np.fft.rfft(corrected.values[2000:6096, 0] * window)
        truth = np.fft.rfft(motion[begin:begin + 4096] * window) \
            * np.exp(2j * np.pi * frequency * shift / RATE_HZ)
        difference = np.linalg.norm((estimate - truth)[band]) / np.linalg.norm(truth[band])
        assert difference < 0.02


def test_one_sine_is_refused():
    rng = np.random.default_rng(40270)
    sensor = rig.draw_sensor(rng, RATE_HZ, "arx")
    excitation = rig.sines(RATE_HZ, 4.0, [300.0], [0.0], (1.0, 0.0, 0.0), lead_s=1.0)
    record = rig.simulate_record(sensor, excitation, rng, snr_db=60)
    with pytest.raises(IdentificationError, match="only 300 Hz: .* order 2, .* at least 2 freq"):
        identify(pair_of(record), structure="arx")


def test_few_sines_allow_few_coefficients():
    rng = np.random.default_rng(40271)
    sensor = rig.draw_sensor(rng, RATE_HZ, "arx")
    excitation = rig.sines(RATE_HZ, 4.0, [100.0, 300.0], [0.0, 1.0], (1.0, 0.0, 0.0), lead_s=1.0)
    record = rig.simulate_record(sensor, excitation, rng, snr_db=60)
    pair = pair_of(record)
    assert fit_arx(*columns(pair), RATE_HZ).orders.coefficients <= 4


def test_unrelated_signals_are_refused():
    rng = np.random.default_rng(40272)
    for _ in range(5):
        with pytest.raises(IdentificationError, match="nothing to do with the reference"):
            fit_arx(rng.standard_normal(2000), rng.standard_normal(2000), RATE_HZ)


def test_shock_record():
    rng = np.random.default_rng(40274)
    core = {"type": "oscillator", "natural_frequency_hz": 40e3, "damping_ratio": 0.02,
            "damping_order": 1.0, "sensitivity": 0.227}
    record = rig.simulate_record(rig.Sensor(core), rig.shock(1e6, 0.01, 40e-6,
                                                             amplitude=(8e4, 0.0, 0.0)),
                                 rng, snr_db=50)
    result = identify(pair_of(record), structure="arx")
    response = result.model.axes[0].transfer_function(2j * np.pi * np.array([100.0, 1e4]))
    truth = rig.transfer_function(rig.Sensor(core), "x", 2j * np.pi * np.array([100.0, 1e4]))
    assert np.abs(response) == pytest.approx(np.abs(truth), rel=0.01)


def test_weak_relation_is_found():
    """At 0 dB the reference is still the cause."""
    sensor, record = measured(np.random.default_rng(40275), "arx", snr_db=0.0)
    pair = pair_of(record)
    fit = fit_arx(*columns(pair), RATE_HZ)
    assert error(fit.core().transfer_function(S) * np.exp(-S * fit["delay_s"]), sensor) < 0.1


def test_short_records_are_refused():
    rng = np.random.default_rng(40273)
    with pytest.raises(IdentificationError, match="the record has 60 samples, expected at least"):
        fit_arx(rng.standard_normal(60), rng.standard_normal(60), RATE_HZ)
