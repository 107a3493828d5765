"""A free mass with friction: against an independent walk, undone, found again, never invented."""

import numpy as np
import pytest
from second_set_bench import Multisine, samples

from frac_accel import Corrector, simulate
from frac_accel.diagnosis import diagnose
from frac_accel.errors import ModelError
from frac_accel.model import SensorModel

RATE = 100.0
FINE = 64


def carriage(corner_hz, level, asymmetry=0.0, sensitivity=2.0):
    return SensorModel.from_dict({
        "schema": "frac_accel/sensor_model/1", "core": {"type": "gain", "sensitivity": sensitivity},
        "effects": [{"cause": "free_mass_friction", "corner_hz": corner_hz, "level": level,
                     "asymmetry": asymmetry}]})


def walk(force, corner_hz, forward, backward):
    """Velocity on the fine grid by implicit steps with a projection.

    J. J. Moreau, *Unilateral contact and dry friction in finite freedom dynamics* (1988).
    """
    w, v, moved = 2 * np.pi * corner_hz / (RATE * FINE), 0.0, np.empty(len(force))
    for i, f in enumerate(force.tolist()):
        free = v + w * f
        v = max(free - w * forward, 0.0) + min(free + w * backward, 0.0)
        v /= 1 + w
        moved[i] = v
    return moved


def record(seed, duration_s=60.0, noise=0.005, corner_hz=(0.2, 2.0)):
    """Force and velocity of a random carriage, and its parameters."""
    rng = np.random.default_rng(seed)
    corner = float(np.exp(rng.uniform(*np.log(corner_hz))))
    level, asymmetry = float(rng.uniform(0.3, 1.2)), float(rng.uniform(-0.3, 0.3))
    sine = Multisine(rng, lines=30, band_hz=(0.1, 5.0))
    # from rest, so that the motion from before the record is known
    fine = np.arange(round(duration_s * RATE) * FINE) / (RATE * FINE)
    force = sine.acceleration(fine) * np.minimum(fine, 1.0)**2
    moved = walk(2.0 * force, corner, level * (1 + asymmetry), level * (1 - asymmetry))[::FINE]
    values = moved + noise * np.std(moved) * rng.normal(size=len(moved))
    return fine[::FINE], force[::FINE], moved, values, (corner, level, asymmetry)


@pytest.mark.parametrize("seed", range(4))
def test_simulated_as_by_the_independent_walk(seed):
    _, force, moved, _, parameters = record(seed, 20.0)
    simulated = simulate(carriage(*parameters), force, RATE, axis="x")
    # the walk's own error is of the first order in its step
    assert np.std(simulated - moved) < 2e-3 * np.std(moved)
    assert np.mean(moved == 0) > 0.01, "it never stands still"


@pytest.mark.parametrize("seed", range(3))
def test_corrector_gives_the_force_back_where_it_moves(seed):
    t, force, moved, _, parameters = record(seed + 10, 30.0)
    made, results = samples(t, moved), []
    for cuts in ([0, len(t)], [0, 1, 2, 700, 701, 1500, len(t)]):
        corrector = Corrector(carriage(*parameters), RATE, noise_std=1e-4, bandwidth_hz=15.0)
        parts = [corrector.process(made.stamps_ns[a:b], made.values[a:b])
                 for a, b in zip(cuts, cuts[1:])]
        results.append(tuple(np.concatenate([getattr(part, name) for part in parts])
                             for name in ("index", "values", "variance")))
    assert all(np.array_equal(one, other) for one, other in zip(*results))
    index, values, variance = results[0]
    inside = slice(200, -200)
    error = (values[:, 0] - force[index])[inside]
    # a tenth of a second away from where it turns or stands still
    still = np.abs(moved[index]) < 0.02 * np.std(moved)
    near = np.convolve(still, np.ones(21), "same")[inside] > 0
    assert np.std(error[~near]) < 0.04 * np.std(force)
    assert 0.6 < np.sqrt(variance[inside, 0].mean()) / np.std(error) < 1.7


@pytest.mark.parametrize("with_model", [True, False])
def test_found_again_and_nothing_else(with_model):
    t, force, _, values, (corner, level, asymmetry) = record(20 + with_model, 40.0)
    used = SensorModel.from_dict({"schema": "frac_accel/sensor_model/1",
                                  "core": {"type": "gain", "sensitivity": 2.0}})
    found = diagnose((samples(t, force), samples(t, values)), used if with_model else None, "x")
    assert [finding.cause for finding in found.findings] == ["free_mass_friction"]
    effect = found.findings[0].effect
    own = found.model.axis("x")
    gain = np.prod([e.gain for e in own.effects if e.cause == "sensitivity_error"])
    assert abs(own.core.sensitivity * gain / 2.0 - 1) < 0.03
    assert abs(effect.corner_hz / corner - 1) < 0.03
    # the level counts before what the sensitivity is wrong by
    assert abs(effect.level * gain / level - 1) < 0.03
    assert abs(effect.asymmetry - asymmetry) < 0.03
    assert found.verdict == "explained"


@pytest.mark.parametrize("seed", range(2))
def test_found_where_viscous_friction_hardly_lags(seed):
    """It was taken for a dead zone, which it is but for its lag, beside filters."""
    t, force, _, values, (corner, level, asymmetry) = record(50 + seed, 40.0, 0.001, (50.0, 150.0))
    found = diagnose((samples(t, force), samples(t, values)), axis="x")
    assert [finding.cause for finding in found.findings] == ["free_mass_friction"]
    friction, std = found.findings[0].effect, found.findings[0].std
    assert abs(friction.corner_hz - corner) < 4 * std["corner_hz"] < 0.3 * corner
    assert abs(friction.level / level - 1) < 0.02
    assert abs(friction.asymmetry - asymmetry) < 0.02


@pytest.mark.parametrize("seed", range(1))
def test_without_dry_friction_it_is_a_low_pass(seed):
    t, force, _, _, (corner, _, _) = record(seed + 30)
    lagged = simulate(carriage(corner, 0.0), force, RATE, axis="x")
    values = lagged + 0.01 * np.std(lagged) * np.random.default_rng(seed).normal(size=len(t))
    used = SensorModel.from_dict({"schema": "frac_accel/sensor_model/1",
                                  "core": {"type": "gain", "sensitivity": 2.0}})
    found = diagnose((samples(t, force), samples(t, values)), used, "x")
    assert [finding.cause for finding in found.findings] == ["low_pass_lag"]


def test_only_a_flat_core_can_drive_it():
    with pytest.raises(ModelError, match="expected a gain"):
        SensorModel.from_dict({
            "schema": "frac_accel/sensor_model/1",
            "core": {"natural_frequency_hz": 20.0, "damping_ratio": 0.5},
            "effects": [{"cause": "free_mass_friction", "corner_hz": 1.0, "level": 0.1}]})
