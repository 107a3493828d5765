"""A soft mount, and no model: the sensor's own resonance would need a lead, which none has."""

from types import SimpleNamespace

import numpy as np
import pytest
from sampled_pair import sampled_pair
from scipy.signal import bilinear, butter, lfilter, sosfiltfilt

from frac_accel import Samples, diagnose
from frac_accel.diagnosis.finding import Finding
from frac_accel.diagnosis.flat import Rival, with_rival
from frac_accel.diagnosis.naming import open_by_one_suspect, open_by_suspects
from frac_accel.model.effects import known_effects

RATE, COUNT, FINER = 400.0, 12_000, 32


def on_a_mount(rng):
    """Reference and sensor on a spring and damper, and the mount's frequency and damping ratio."""
    frequency_hz, damping_ratio = rng.uniform(90, 150), rng.uniform(0.08, 0.2)
    fine, omega = FINER * RATE, 2 * np.pi * frequency_hz
    motion = sosfiltfilt(butter(2, [2, 60], "band", fs=fine, output="sos"),
                         rng.normal(size=FINER * COUNT))
    motion *= 2.0 / motion.std()
    damper = 2 * damping_ratio * omega
    felt = lfilter(*bilinear([damper, omega**2], [1, damper, omega**2], fine), motion)
    pair = sampled_pair(rng, (motion, felt), FINER, RATE, 0.002)
    return pair, frequency_hz, damping_ratio


@pytest.mark.parametrize("seed", range(3))
def test_a_soft_mount_is_no_oscillator_with_a_lead(seed):
    pair, frequency_hz, damping_ratio = on_a_mount(np.random.default_rng(seed))
    found, = diagnose(pair, time_limit_s=60).findings
    assert found.cause == "mounting_resonance"
    assert found.effect.frequency_hz == pytest.approx(frequency_hz, rel=1e-3)
    assert found.effect.damping_ratio == pytest.approx(damping_ratio, rel=0.01)


@pytest.mark.parametrize("seed", range(3))
def test_a_delay_beside_a_soft_mount_is_whole(seed):
    """An oscillator in place of the mount would take twice the damping ratio over the angular
    frequency of it, which is 0.3 to 0.5 ms here."""
    rng = np.random.default_rng(seed)
    (reference, sensor), frequency_hz, _ = on_a_mount(rng)
    delay_s = rng.uniform(0.5e-3, 3e-3)
    late = Samples.of(sensor.stamps_ns + round(delay_s * 1e9), sensor.values)
    found = {finding.cause: finding for finding in diagnose((reference, late),
                                                            time_limit_s=60).findings}
    assert set(found) == {"time_delay", "mounting_resonance"}
    assert found["time_delay"].effect.delay_s == pytest.approx(delay_s, abs=2e-6)
    assert found["mounting_resonance"].effect.frequency_hz == pytest.approx(frequency_hz, rel=1e-3)


def test_a_delay_is_as_uncertain_as_what_describes_the_record_as_well_makes_it():
    """Where a mount and the sensor's own resonance cannot be told apart, each has its delay."""
    rng = np.random.default_rng(3)
    found = diagnose(delayed_pair(rng, 2e-3), time_limit_s=60)
    named, = found.findings
    assert named.cause == "time_delay"
    causes = known_effects()
    mount = causes["mounting_resonance"](197.0, 0.2)
    left = found.extended["rmse"]
    rival = Rival({"time_delay": causes["time_delay"](2.3e-3), "mounting_resonance": mount}, left)
    open_one, = with_rival(found, rival).findings
    away = 2.3e-3 - named.effect.delay_s
    assert open_one.std["delay_s"] == pytest.approx(away / np.sqrt(3), rel=1e-3)
    assert "mounting_resonance" in open_one.evidence[-1]
    same, = with_rival(found, Rival({"time_delay": named.effect, "mounting_resonance": mount},
                                    left)).findings
    assert same.std == named.std and same.evidence == named.evidence
    # what leaves more than the diagnosis in the end does not describe the record as well
    assert with_rival(found, rival._replace(rms=1.5 * left)) is found


def test_a_filter_is_as_uncertain_as_one_that_is_only_suspected_makes_it():
    """An average took the lag of a sensor's own with it, as the delay beside it had no name."""
    causes = known_effects()

    def fit(cost, *effects):
        return SimpleNamespace(cost=cost, effects={e.cause: e for e in effects},
                               causes={e.cause for e in effects})
    average, turn = causes["linear_phase_filter"](16.2e-3, 1), causes["misalignment"](0.0, 1.0, 0.0)
    findings = [Finding(average, {"length_s": 2e-6}, 1.0, [], [], None),
                Finding(turn, {"pitch_deg": 0.01}, 1.0, [], [], None)]
    fitted = fit(1.0, average, turn)
    wider = fit(0.9, causes["linear_phase_filter"](15.9e-3, 1), causes["time_delay"](1e-4),
                causes["misalignment"](0.0, 1.1, 0.0))
    one, other = open_by_suspects(findings, fitted, [wider])
    assert one.std["length_s"] == pytest.approx(0.3e-3 / np.sqrt(3), rel=1e-2)
    assert one.evidence == ["length_s is 0.0159 s with time_delay, which may be there as well"]
    assert other.std == {"pitch_deg": 0.01}
    # what describes the record worse, or has another filter altogether, says nothing
    assert open_by_suspects(findings, fitted, [fit(1.1, *wider.effects.values())]) == findings
    assert open_by_suspects(findings, fitted, [fit(
        0.9, causes["linear_phase_filter"](8e-3, 1), causes["time_delay"](4e-3))]) == findings


def test_a_law_is_as_uncertain_as_a_delay_without_a_name_makes_it():
    """A second resonance was 28 standard uncertainties off beside a lag that the reference's noise
    drowned: with that, the record is described clearly better."""
    causes, problem = known_effects(), object()

    def fit(cost, *effects, rough=False):
        return SimpleNamespace(cost=cost, effects={e.cause: e for e in effects}, rough=rough,
                               causes=frozenset(e.cause for e in effects), problem=problem)
    loop, delay = causes["hysteresis"](0.078, 1.2, 2.0), causes["time_delay"](1e-4)
    findings = [Finding(loop, {"strength": 1e-3, "beta": 0.03, "gamma": 0.08}, 1.0, [], [], None)]
    fitted = fit(1.0, loop)
    better = fit(0.9, causes["hysteresis"](0.0775, 1.0, 2.4), delay)
    suspects = [{"causes": ["time_delay"]}]

    def told(*fits, suspects=suspects):
        engine = SimpleNamespace(
            search=SimpleNamespace(fits={fit.causes: fit for fit in (fitted, *fits)}),
            threshold=lambda fit: 0.05)
        return open_by_one_suspect(engine, findings, fitted, suspects)
    one, = told(better)
    assert one.std["beta"] == pytest.approx(np.hypot(0.03, 0.2 / np.sqrt(3)))
    assert one.std["gamma"] == pytest.approx(np.hypot(0.08, 0.4 / np.sqrt(3)))
    assert one.std["strength"] == 1e-3
    assert len(one.evidence) == 2 and "time_delay, which may be there as well" in one.evidence[0]
    # what is hardly better, not carried to its end, or has more than one suspect, says nothing
    assert told(fit(0.96, *better.effects.values())) == findings
    assert told(fit(0.9, *better.effects.values(), rough=True)) == findings
    assert told(fit(0.9, *better.effects.values(), causes["offset"](0.1))) == findings
    assert told(better, suspects=[]) == findings


def delayed_pair(rng, delay_s):
    """Reference, and a flat sensor that is late."""
    motion = sosfiltfilt(butter(2, [2, 60], "band", fs=FINER * RATE, output="sos"),
                         rng.normal(size=FINER * 4000))
    reference, sensor = sampled_pair(rng, (motion, motion), FINER, RATE, 0.002 * motion.std())
    return reference, Samples.of(sensor.stamps_ns + round(delay_s * 1e9), sensor.values)
