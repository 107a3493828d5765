"""The experiment done properly: on records of the independent simulator, and the map's logic."""

import dataclasses
from pathlib import Path

import numpy as np
import paper_records
import pytest
import rig

from frac_accel import SensorModel
from frac_accel.errors import BagError, IdentificationError
from frac_accel.paper.study.answer import answer
from frac_accel.paper.study.bench import SENSORS, bags_of, judge_sensor, refusal
from frac_accel.paper.study.candidates import (
    AS_MANY,
    CLASSICAL,
    FRACTIONAL,
    LOW_PASS,
    SLOPE,
    STRUCTURES,
    FixedOrdersStructure,
    fit_all,
)
from frac_accel.paper.study.judge import Sines, judge
from frac_accel.paper.study.map import DOES_NOT, HELPS, OPEN, SEEMS, Cell
from frac_accel.paper.study.sweep import best
from frac_accel.paper.study.virtual import Case, Outcome, outcome
from frac_accel.record import Record

BAGS = Path(__file__).resolve().parents[2] / "bags"
FEW_ORDERS = ([(0.94, 2.0), (1.0, 2.0), (1.06, 2.0), (2.0, 2.0)], [(1.0, 2.0), (1.04, 1.96)])


@pytest.fixture(scope="module")
def bench():
    return {name: judge_sensor(name, paths, orders=FEW_ORDERS)
            for name, paths in bags_of(BAGS).items() if name in SENSORS}


def test_classical_sensor_is_found_classical(bench):
    result = bench["classical"]
    assert result.chosen == "oscillator"
    assert result.judged[CLASSICAL].p_value > 0.01
    low, high = result.judged[CLASSICAL].noise_ratio_interval
    assert 0.98 < low < 1.0 < high < 1.02
    fit = result.fitted[FRACTIONAL].fit
    std = fit.std[fit.names.index("damping_order")]
    assert abs(fit["damping_order"] - 1) < 3 * std < 2e-3
    swept = best(result.by_damping_order)
    assert (swept.v1, swept.v2) == (1.0, 2.0)
    assert best(result.by_table_4).v1 == 1.0
    assert result.by_damping_order[-1].judged is None


def test_fractional_sensor_needs_a_fractional_model(bench):
    """At the noise floor with it; far above with any classical model of as many parameters."""
    result = bench["fractional"]
    assert result.chosen == "fractional"
    own = result.judged[FRACTIONAL]
    assert own.p_value > 0.01
    assert own.rms_interval[0] <= own.floor and own.rms < 2 * own.floor
    assert own.noise_ratio_interval[0] < 1.01 and own.noise_ratio < 1.01
    for name in AS_MANY:
        other = result.judged[name]
        assert result.fitted[name].parameters == result.fitted[FRACTIONAL].parameters == 5
        assert other.p_value < 1e-6
        assert other.rms_interval[0] > 100 * own.rms
        assert other.noise_ratio_interval[0] > 5


def test_fractional_model_only_stands_in_for_a_low_pass(bench):
    result = bench["lagging"]
    order = result.fitted[FRACTIONAL].fit["damping_order"]
    assert abs(order - 1) > 0.1
    assert result.judged[FRACTIONAL].rms < result.judged[CLASSICAL].rms
    assert result.judged[LOW_PASS].rms < 0.05 * result.judged[FRACTIONAL].rms
    assert result.fitted[LOW_PASS].fit["corner_hz"] == pytest.approx(2500, rel=0.01)


@pytest.mark.parametrize("name", SENSORS)
def test_substitution_gives_a_constant_for_any_sensor(bench, name):
    """The paper's flat error is no property of its sensor; converted properly, G(z) is right."""
    found = bench[name].sampled
    error = np.array(found["substituted_error_percent"])
    assert np.ptp(error) < 0.05
    assert error == pytest.approx(100 * abs(1 - found["leading_coefficient"]), abs=0.02)
    assert found["held_out_rms"] < 0.01
    if name != "fractional":
        pole = found["poles"][0]
        assert pole["natural_frequency_hz"]["value"] == pytest.approx(650, rel=1e-3)
        assert pole["damping_ratio"]["value"] == pytest.approx(0.12, rel=1e-2)


def test_the_papers_excitation_is_refused():
    assert "persistently exciting of order 2" in refusal(bags_of(BAGS)["one_sine"][0])


def test_missing_bags_are_named(tmp_path):
    with pytest.raises(BagError, match="paper_bench_classical.mcap.*--quick"):
        bags_of(tmp_path)


def test_other_records_are_no_judges():
    with pytest.raises(IdentificationError, match="expected a stepped sine"):
        Sines.of(Record.load(bags_of(BAGS)["classical"][0]))


def test_bags_are_small_and_hold_the_bench(bench):
    for name in SENSORS:
        for path in bags_of(BAGS)[name]:
            assert path.stat().st_size < 100_000
        truth = SensorModel.load(BAGS / f"paper_bench_{name}.yaml")
        assert truth.axis("x").delay_s == pytest.approx(paper_records.bench.SKEW_S)
    assert bench["classical"].frequency_hz == pytest.approx(paper_records.bench.SINES_HZ, abs=0.01)


@pytest.mark.filterwarnings("error::RuntimeWarning")  # a covariance that is none
@pytest.mark.parametrize("seed", range(3))
def test_random_sensors_of_the_independent_simulator(seed):
    """What the bags show holds for sensors that were never looked at."""
    rng = np.random.default_rng(700 + seed)
    order = rng.uniform(0.5, 0.8) if seed % 2 else rng.uniform(1.25, 1.5)
    core = {"type": "oscillator", "natural_frequency_hz": rng.uniform(500, 900),
            "damping_ratio": rng.uniform(0.08, 0.25), "damping_order": order,
            "sensitivity": rng.uniform(0.5, 2)}
    sensor = rig.Sensor(core, {"time_delay": {"delay_s": rng.uniform(0, 2e-4)}})
    noise, sines = paper_records.noise_and_sines(sensor, rng)
    fits = fit_all(noise.reference[:, 0], noise.sensor[:, 0], noise.sampling_rate_hz, noise.valid,
                   noise.lag_s)
    judged = {name: judge(fit, Sines.of(sines)) for name, fit in fits.items()}
    fit = fits[FRACTIONAL].fit
    assert abs(fit["damping_order"] - order) < 4 * fit.std[fit.names.index("damping_order")]
    assert judged[FRACTIONAL].p_value > 1e-3
    for name in AS_MANY:
        assert judged[name].p_value < 1e-6
        assert judged[name].rms > 10 * judged[FRACTIONAL].rms


@pytest.mark.parametrize("order", [0.6, 1.0, 1.4])
def test_map_agrees_with_the_independent_simulator(order):
    """Virtual records of the package and records of the rig lead to the same errors."""
    case = Case(order, False, 40.0, 1500.0, 1)
    core = {**paper_records.bench.oscillator(order)}
    sensor = rig.Sensor(core, paper_records.bench.LATE)
    rng = np.random.default_rng(round(10 * order))
    excitation = rig.band_noise(rng, 1e4, 0.2048, (10.0, 1500.0), (30.0, 0.0, 0.0), lead_s=0.2)
    record = rig.simulate_record(sensor, excitation, rng, snr_db=case.noise_db)
    theirs = outcome(case, (record.reference[:, 0], record.sensor[:, 0]))
    ours = outcome(case)
    # where a model lacks something its error is the same whatever the noise
    if order != 1:
        for name in (CLASSICAL, LOW_PASS):
            assert theirs.inside[name] == pytest.approx(ours.inside[name], rel=0.25)
        assert theirs.rival > 5 * theirs.inside[FRACTIONAL]
    # where it lacks nothing, both are what the uncertainty says
    for one in (ours, theirs):
        assert one.inside[FRACTIONAL] < 3 * one.floor
    assert theirs.floor == pytest.approx(ours.floor, rel=0.4)
    assert (theirs.significant, ours.significant) == (order != 1, order != 1)


@pytest.mark.parametrize("structure", [STRUCTURES[LOW_PASS], STRUCTURES[SLOPE],
                                       FixedOrdersStructure(0.7, 1.96)])
def test_slopes_of_the_structures(structure):
    rng = np.random.default_rng(3)
    s = 2j * np.pi * np.array([50.0, 300.0, 900.0])
    theta = np.array([np.log(rng.uniform(300, 900)), np.log(rng.uniform(0.05, 0.5)),
                      rng.uniform(0.2, 0.5)])[:len(structure.names)]
    if structure is STRUCTURES[LOW_PASS]:
        theta[2] = np.log(rng.uniform(800, 4000))
    prepared = structure.prepare(s)
    _, slopes = structure.gradient(prepared, theta)
    for i, slope in enumerate(slopes):
        step = np.zeros(len(theta))
        step[i] = 1e-6
        numeric = (structure.gradient(prepared, theta + step)[0]
                   - structure.gradient(prepared, theta - step)[0]) / 2e-6
        assert slope == pytest.approx(numeric, rel=1e-6, abs=1e-9)


def test_covariance_of_the_response_is_that_of_repeated_records():
    """Errors of the fractional fit over seeds scatter as each fit says."""
    outcomes = [outcome(Case(0.7, False, 40.0, 1500.0, seed)) for seed in range(12)]
    observed = np.sqrt(np.mean([one.inside[FRACTIONAL]**2 for one in outcomes]))
    stated = np.sqrt(np.mean([one.floor**2 for one in outcomes]))
    assert 0.6 < observed / stated < 1.6
    orders = np.array([(one.order - 0.7) / one.order_std for one in outcomes])
    assert np.sqrt(np.mean(orders**2)) < 1.8


def cell(fractional, classical, low_pass):
    """Cell with given errors, one per record."""
    case = Case(0.8, False, 40.0, 600.0, 0)
    return Cell(case, tuple(
        Outcome(case, {CLASSICAL: c, FRACTIONAL: f, LOW_PASS: p, SLOPE: c}, {},
                {CLASSICAL: 0.2, FRACTIONAL: 0.1}, 0.1, 0.8, 0.1)
        for f, c, p in zip(fractional, classical, low_pass)))


def test_verdicts_of_the_map():
    spread = np.array([0.9, 1.0, 1.1, 1.05])
    assert cell(spread, 10 * spread[::-1], 9 * spread).verdict == HELPS
    assert cell(spread, 10 * spread, 0.1 * spread[::-1]).verdict == SEEMS
    assert cell(spread, 0.5 * spread[::-1], 2 * spread).verdict == DOES_NOT
    assert cell(spread, spread[::-1], 1.2 * spread).verdict == OPEN
    low, high = cell(spread, 10 * spread[::-1], 9 * spread).gain_interval
    assert low < cell(spread, 10 * spread[::-1], 9 * spread).gain < high


def test_answer_follows_from_the_numbers(bench):
    told = answer(bench, [cell([1.0] * 4, [9.0, 9.5, 10, 11], [8.0] * 4)], "refused")
    assert len(told) == 5
    assert "helps" in told[0] and "at the noise floor" in told[0]
    assert "does not help" in told[1] and "is classical" in told[1]
    assert "only seems to help" in told[3]
    assert "cannot decide it" in told[4]
    # the same bench with the errors of the two models exchanged says the opposite
    result = bench["fractional"]
    exchanged = dataclasses.replace(result, judged={
        name: result.judged[LOW_PASS if name == FRACTIONAL else FRACTIONAL]
        for name in result.judged})
    other = answer({**bench, "fractional": exchanged}, [], "")
    assert "does not help" in other[0] and "above the noise floor" in other[0]
    assert "helps nowhere" in other[2]
