"""A trial whose motion grows without bound is a trial that lost, and ends no diagnosis."""

import zlib

import numpy as np
import pytest
import rig

from frac_accel import SensorModel, diagnose
from frac_accel.diagnosis import problem
from frac_accel.diagnosis.search import acts_on_spring
from frac_accel.errors import FracAccelError
from frac_accel.io.bag import Samples

CORE = {"type": "oscillator", "natural_frequency_hz": 80.0, "damping_ratio": 0.12,
        "damping_order": 1.0, "sensitivity": 1.0}


def record_of(effects):
    rng = np.random.default_rng(950)
    excitation = rig.band_noise(rng, 1000.0, 5.0, (5.0, 120.0), lead_s=0.5, amplitude=3.0)
    record = rig.simulate_record(rig.Sensor(CORE, effects), excitation, rng, snr_db=35.0)
    return (Samples.of(record.stamps_ns, record.reference),
            Samples.of(record.sensor_stamps_ns, record.sensor))


def without_bound(monkeypatch, which):
    """Motions on a spring that is not linear are without bound: all, those in fine steps, or by
    chance some of these; returns a list that counts them."""
    usual, met = problem.Problem.simulate, []

    def simulate(self, effects, across=True, steps=problem._STEPS):
        chance = zlib.crc32(repr(sorted(effects.items())).encode()) % 100
        if any(map(acts_on_spring, effects.values())) and (
                which == "all" or steps == problem._STEPS and (which == "fine" or chance < 30)):
            met.append(effects)
            raise FracAccelError("the model's motion grows without bound")
        return usual(self, effects, across, steps)

    monkeypatch.setattr(problem.Problem, "simulate", simulate)
    return met


@pytest.mark.parametrize("effects", [
    {"cubic_stiffness": {"alpha3": 2e-3}},
    {"time_delay": {"delay_s": 7e-4}, "quadratic_stiffness": {"alpha2": 0.02}}],
    ids=["cubic", "quadratic and delay"])
@pytest.mark.parametrize("which", ["all", "fine", "some"])
def test_a_trial_without_bound_has_lost(which, effects, monkeypatch):
    met = without_bound(monkeypatch, which)
    found = diagnose(record_of(effects), SensorModel.from_dict(rig.Sensor(CORE).to_model()),
                     time_limit_s=20.0)
    assert met
    if which != "some":
        assert not {finding.cause for finding in found.findings} & {
            "cubic_stiffness", "quadratic_stiffness"}
        assert found.verdict in ("unexplained", "partly_explained", "undecided")
