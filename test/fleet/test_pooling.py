"""A fleet finds what no single bag shows, and next to nothing that is not there."""

import fleet_rig
import numpy as np
import pytest

from frac_accel.fleet.estimates import Estimates
from frac_accel.fleet.false_discoveries import discoveries
from frac_accel.fleet.groups import ALL, groups_of
from frac_accel.fleet.peers import common_causes, odd_vehicles
from frac_accel.fleet.random_effects import pool
from frac_accel.fleet.weak_effects import weak_effects
from frac_accel.model import SensorModel

VEHICLES, WEAK = 70, 30


@pytest.mark.parametrize("spread", [0.0, 0.5, 3.0])
def test_the_mean_of_a_group_lies_in_its_interval(spread):
    rng = np.random.default_rng(3)
    draws, inside, found = 600, 0, []
    for _ in range(draws):
        stds = rng.uniform(0.3, 2.0, 12)
        values = rng.normal(1.7, np.hypot(stds, spread))
        pooled = pool(values, stds)
        inside += pooled.low <= 1.7 <= pooled.high
        found.append(pooled.spread)
    # three standard errors of a share below 95 %; the factor not below one makes it cover more
    assert inside / draws > 0.95 - 3 * np.sqrt(0.05 * 0.95 / draws)
    assert np.median(found) == pytest.approx(spread, rel=0.2, abs=0.4)


def test_p_values_of_no_effect_are_no_smaller_than_chance():
    rng = np.random.default_rng(4)
    p_values = []
    for _ in range(2000):
        stds = rng.uniform(0.3, 2.0, 10)
        p_values.append(pool(rng.normal(0.0, np.hypot(stds, 0.5)), stds).p_value)
    for level in (0.01, 0.1):
        assert np.mean(np.array(p_values) < level) < level + 3 * np.sqrt(level / 2000)


def test_discoveries_are_those_of_benjamini_and_yekutieli():
    rng = np.random.default_rng(5)
    for _ in range(20):
        p_values = np.r_[rng.random(200), rng.random(30) * 10**rng.uniform(-8, -2)]
        ranks = np.arange(1, len(p_values) + 1)
        below = np.sort(p_values) <= 0.01 * ranks / len(p_values) / np.sum(1 / ranks)
        expected = p_values <= np.sort(p_values)[below][-1] if below.any() else below
        assert list(discoveries(p_values, 0.01)) == list(expected)
    with_gap = np.r_[np.nan, 1e-9, np.nan]
    assert list(discoveries(with_gap, 0.01)) == [False, True, False]
    assert not len(discoveries([], 0.01)) and not any(discoveries([np.nan], 0.01))


@pytest.fixture(scope="module")
def fleet():
    model = SensorModel.from_dict(fleet_rig.model())
    rng = np.random.default_rng(17)
    causes = ["cubic_stiffness", "sensitivity_error", "gain_drift"]
    vehicles = [fleet_rig.vehicle(rng, causes if i < WEAK else (), 3.0) for i in range(VEHICLES)]
    return [fleet_rig.ScreenedVehicle(own, model) for own in vehicles]


def test_each_cause_is_screened_by_the_number_that_it_moves():
    own = fleet_rig.vehicle(np.random.default_rng(6), duration_s=1.0)
    screened = fleet_rig.ScreenedVehicle(own, SensorModel.from_dict(fleet_rig.model()))
    rows = screened.drawn(np.random.default_rng(1))["estimates"]
    moved = {row["cause"]: row["parameter"] for row in rows}
    assert moved["stiffness_drift"] == "rate_per_s"  # what it reads is a word
    assert set(fleet_rig.CAUSES) <= set(moved) and all(moved[cause] for cause in fleet_rig.CAUSES)


def test_first_order_estimates_are_the_parameters_that_the_rig_had():
    model, size = SensorModel.from_dict(fleet_rig.model()), 2e-3
    own = fleet_rig.vehicle(np.random.default_rng(6), fleet_rig.CAUSES, 3.0)
    screened = fleet_rig.ScreenedVehicle(own, model)
    for cause, parameters in fleet_rig.CAUSES.items():
        [(name, value)] = parameters(size).items()
        without = parameters(0.0)[name]
        before, after = (screened.drawn(np.random.default_rng(1), cause, scale)["estimates"]
                         for scale in (0.0, size))
        [change] = [b["value"] - a["value"] for a, b in zip(before, after)
                    if (a["cause"], a["parameter"]) == (cause, name)]
        # at 500 Hz the turns of the motion, at which friction changes its sign, lie between samples
        rel = 0.15 if cause == "coulomb_friction" else 0.02
        assert change == pytest.approx(value - without, rel=rel), cause


def lots(seed):
    """Groups: a lot with the vehicles in which something may be hidden, and columns of chance."""
    rng = np.random.default_rng(seed)
    return groups_of({
        "lot": ["B" if i < WEAK else "A" if i % 2 else "C" for i in range(VEHICLES)],
        "firmware": [f"{v}" for v in rng.integers(1, 4, VEHICLES)],
        "mileage": [f"{v:.0f}" for v in rng.uniform(1e3, 1e5, VEHICLES)]}, VEHICLES)


@pytest.mark.parametrize("cause", ["cubic_stiffness", "sensitivity_error", "gain_drift"])
def test_an_effect_too_weak_for_a_bag_is_found_in_its_lot(fleet, cause):
    # a bag names nothing below 30 variances; this is a quarter of that size
    size = np.sqrt(30) / 4 / np.median([one.own_part(cause) for one in fleet[:WEAK]])
    draws, seen = 10, 0
    for seed in range(7, 7 + draws):
        rng = np.random.default_rng(seed)
        estimates = Estimates.of([one.drawn(rng, cause, size) if i < WEAK else one.drawn(rng)
                                  for i, one in enumerate(fleet)])
        place = next(i for i, (name, _) in enumerate(estimates.names) if name == cause)
        alone = np.abs(estimates.values[:WEAK, place] / estimates.stds[:WEAK, place])
        assert np.max(alone) < np.sqrt(30)
        found, rest = weak_effects(estimates, lots(seed))
        assert len(found) <= 1, found
        for first in found:
            assert first.group == "lot = B"
            assert cause == first.cause or cause in first.confusable_with
            assert odd_vehicles(rest, list(range(VEHICLES))) == []
        seen += len(found)
    # measured: 9 or 10 of 10; each cause of the catalogue is one more hypothesis to stand against
    assert seen >= 8


def test_a_fleet_without_effects_shows_none(fleet):
    rng = np.random.default_rng(8)
    for seed in range(5):
        estimates = Estimates.of([one.drawn(rng) for one in fleet])
        found, rest = weak_effects(estimates, lots(seed))
        assert found == [] and odd_vehicles(rest, list(range(VEHICLES))) == []


def test_a_vehicle_that_differs_from_its_peers_is_named(fleet):
    rng = np.random.default_rng(9)
    drawn = [one.drawn(rng, *(("gain_drift", 12 / one.own_part("gain_drift")) if i == 5 else ()))
             for i, one in enumerate(fleet)]
    _, rest = weak_effects(Estimates.of(drawn), {ALL: np.ones(VEHICLES, bool)})
    odd = odd_vehicles(rest, [f"car {i}" for i in range(VEHICLES)])
    assert [entry["vehicle"] for entry in odd] == ["car 5"]
    assert abs(odd[0]["deviations"]) > 6


def screened_of(columns, residual, std=1.0):
    """As `Screen` tells it, of columns for causes a, b, c, ..."""
    size = np.linalg.norm(columns, axis=0)
    cosines = (columns / size).T @ (columns / size)
    return {"estimates": [
        {"cause": name, "parameter": "", "unit": "1", "value": float(column @ residual / own**2),
         "std": float(std / own), "size": float(own / np.sqrt(len(column)))}
        for name, column, own in zip("abcdef", columns.T, size)],
        "correlations": cosines[np.triu_indices(len(size), 1)].tolist()}


def alike(rng, count=5, samples=80):
    """Columns of which the first ones look alike, as those of a delay and a filter do."""
    columns = rng.normal(size=(samples, count))
    columns[:, 1] = columns[:, 0] + 0.3 * columns[:, 1]
    columns[:, 2] = columns[:, 0] - columns[:, 1] * 0.5 + 0.5 * columns[:, 2]
    return columns * rng.uniform(0.3, 3.0, count)


def test_beside_other_causes_an_estimate_is_that_of_a_joint_fit():
    rng = np.random.default_rng(12)
    columns, residual = alike(rng), rng.normal(size=80)
    columns[:, 4] = columns[:, 0] * 3 + 1e-3 * columns[:, 4]
    rest = Estimates.of([screened_of(columns, residual)]).beside(np.ones(1, bool), [0, 2])
    for cause in (1, 3):
        own = columns[:, [cause, 0, 2]]
        assert rest.values[0, cause] == pytest.approx(np.linalg.lstsq(own, residual)[0][0])
        assert rest.stds[0, cause] == pytest.approx(np.sqrt(np.linalg.inv(own.T @ own)[0, 0]))
    assert np.isnan(rest.values[0, [0, 2, 4]]).all()  # themselves, and one that is the same
    left = [np.ones(1)] * 5
    for cause in (1, 3):
        left[cause] = columns[:, cause] - columns[:, [0, 2]] @ np.linalg.lstsq(
            columns[:, [0, 2]], columns[:, cause])[0]
    assert rest.correlations[0, 1, 3] == pytest.approx(
        left[1] @ left[3] / np.linalg.norm(left[1]) / np.linalg.norm(left[3]), abs=1e-5)


def test_bags_of_a_vehicle_are_as_one_fit_to_all_of_them():
    rng = np.random.default_rng(13)
    parts = [(alike(rng), rng.normal(size=80)) for _ in range(3)]
    each = Estimates.of([screened_of(*part) for part in parts])
    _, own = each.by_owner(["car"] * 3)
    whole = Estimates.of([screened_of(np.vstack([columns for columns, _ in parts]),
                                      np.concatenate([residual for _, residual in parts]))])
    assert own.values == pytest.approx(whole.values)
    assert own.correlations == pytest.approx(whole.correlations, abs=1e-6)


@pytest.mark.parametrize("hidden", [(0,), (1,), (3,), (0, 3)])
def test_the_causes_that_are_named_hold_the_one_that_is_hidden(hidden):
    """Half of a hundredth may be wrong, of causes that look alike nearly all of the time."""
    rng = np.random.default_rng(14)
    lot = {"lot = B": np.arange(100) < 30, ALL: np.ones(100, bool)}
    fleet = [alike(rng) for _ in range(100)]
    sizes = []
    for _ in range(20):
        spread = rng.uniform(0.5, 1.5, 100)  # an effect that differs from vehicle to vehicle
        estimates = Estimates.of([screened_of(
            columns, rng.normal(size=80) + (i < 30) * spread[i] * sum(
                2 * columns[:, cause] / np.linalg.norm(columns[:, cause]) for cause in hidden))
            for i, columns in enumerate(fleet)])
        [effect], _ = weak_effects(estimates, lot)
        named = {effect.cause, *effect.confusable_with}
        assert effect.group == "lot = B" and {"abcde"[cause] for cause in hidden} <= named
        assert effect.at_work == len(hidden)
        sizes.append(len(named))
    # what looks like nothing else is named alone, what looks alike together
    assert np.mean(sizes) < 1.2 if hidden == (3,) else 2 <= np.median(sizes) < 5


def test_bags_of_a_vehicle_are_one_estimate():
    rng = np.random.default_rng(10)
    screened = [{"estimates": [{"cause": "a", "parameter": "b", "unit": "1", "value": value,
                                "std": 0.5, "size": 1.0}], "correlations": []}
                for value in rng.normal(2.0, 0.5, 8)]
    estimates = Estimates.of(screened)
    owners, own = estimates.by_owner(["one"] * 4 + ["two"] * 4)
    assert owners == ["one", "two"]
    assert own.values[:, 0] == pytest.approx([np.mean(estimates.values[:4, 0]),
                                              np.mean(estimates.values[4:, 0])])
    assert np.all(own.stds >= 0.25)


def test_a_cause_that_one_lot_names_more_often_is_told():
    lot = np.arange(60) < 20
    named = [{"a"} if lot[i] and i % 2 else {"b"} if i % 7 == 0 else set() for i in range(60)]
    found = common_causes(named, {ALL: np.ones(60, bool), "lot = B": lot, "lot = A": ~lot})
    assert [(entry["group"], entry["cause"]) for entry in found] == [("lot = B", "a")]
    assert (found[0]["vehicles"], found[0]["of"], found[0]["elsewhere"]) == (10, 20, 0)


def test_groups_of_columns():
    groups = groups_of({"lot": ["A"] * 12 + ["B"] * 8 + ["C"] * 4,
                        "mileage": [str(i) for i in range(24)], "note": [""] * 24}, 24)
    assert {"lot = A", "lot = B", ALL} <= groups.keys() and "lot = C" not in groups
    assert sum("mileage" in name for name in groups) == 0  # six in each part are too few
    groups = groups_of({"mileage": [str(i) for i in range(40)]}, 40)
    parts = [rows for name, rows in groups.items() if "mileage" in name]
    assert len(parts) == 4 and np.sum(parts, axis=0).tolist() == [1] * 40
