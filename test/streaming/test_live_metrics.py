"""Live figures: errors against a reference with its own stamps, clipping, bounded windows."""

import numpy as np
import pytest

from frac_accel.io.samples import Samples
from frac_accel.streaming.live_metrics import (
    MOST_SAMPLES,
    LiveMetrics,
    Snapshot,
    Window,
    clipped_share,
    evaluate,
)

RATE_HZ = 1000.0
START_NS = 1_700_000_000 * 10**9


def stamps(count, offset_s=0.0):
    return START_NS + np.round((np.arange(count) / RATE_HZ + offset_s) * 1e9).astype(np.int64)


def motion(stamps_ns):
    """Three sines between 20 and 110 Hz at any instants."""
    t = (stamps_ns - START_NS) * 1e-9
    return np.stack([np.sin(2 * np.pi * f * t) for f in (20.0, 50.0, 110.0)], axis=1)


def snapshot(raw, corrected, reference, edges=(10.0, 200.0)):
    return Snapshot(raw, corrected, reference, RATE_HZ, (tuple(zip(edges[:-1], edges[1:])),) * 3)


def test_errors_hold_between_the_stamps_of_the_reference():
    at = stamps(2000)
    between = stamps(2000, 0.3 / RATE_HZ)
    figures, findings = evaluate(snapshot((at, 1.2 * motion(at - 400_000)),
                                          (between, motion(between)), (at, motion(at))))
    for axis, frequency in zip("xyz", (20.0, 50.0, 110.0)):
        assert figures[f"{axis}/raw/amplitude_error"] == pytest.approx(0.2, abs=1e-3)
        assert figures[f"{axis}/raw/phase_error_deg"] == pytest.approx(
            -360 * frequency * 400e-6, abs=0.05)
        assert figures[f"{axis}/corrected/nrmse"] < 1e-3
        assert figures[f"{axis}/corrected/median_relative_error_percent"] < 0.1
    assert findings.reference_overlaps
    assert figures["stamp_rate_hz"] == pytest.approx(RATE_HZ)


def test_bands_have_topics_of_their_own():
    at = stamps(2000)
    figures, _ = evaluate(snapshot((at, motion(at)), (at, motion(at)), (at, motion(at)),
                                   (10.0, 37.5, 200.0)))
    assert figures["x/corrected/from_10_to_37_5_hz/nrmse"] < 1e-9
    assert "y/raw/from_37_5_to_200_hz/peak_error" in figures


def test_a_gap_or_a_missing_piece_of_reference_is_left_out():
    at = stamps(3000)
    kept = np.r_[0:1000, 1300:3000]
    figures, _ = evaluate(snapshot((at[kept], motion(at[kept])), (at[kept], motion(at[kept])),
                                   (at[:2500], motion(at[:2500]))))
    assert figures["x/raw/nrmse"] < 1e-9


def test_stamps_without_common_time_are_noticed():
    at = stamps(2000)
    figures, findings = evaluate(snapshot((at, motion(at)), (at, motion(at)),
                                          (at + 10**10, motion(at))))
    assert findings.reference_overlaps is False
    assert not [name for name in figures if "nrmse" in name]


def test_without_reference_or_samples_there_is_nothing_to_judge():
    nothing = (np.empty(0, np.int64), np.empty((0, 3)))
    figures, findings = evaluate(Snapshot(nothing, nothing, nothing, None, ()))
    assert figures == {} and findings.reference_overlaps is None
    at = stamps(200)
    _, findings = evaluate(snapshot((at, np.ones((200, 3))), nothing, nothing))
    assert findings.constant


def test_clipping_is_told_from_quantisation_and_noise():
    rng = np.random.default_rng(1)
    t = np.arange(4000) / RATE_HZ
    sine = 5 * np.sin(2 * np.pi * 13 * t)
    noisy = sine + 0.01 * rng.standard_normal(t.size)
    assert clipped_share(np.clip(noisy, -4, 4)) > 0.3
    assert clipped_share(np.clip(noisy, -9, 4.8)) > 0.05
    assert clipped_share(noisy) == 0
    assert clipped_share(np.round(sine / 0.1) * 0.1) == 0
    assert clipped_share(np.round(5 * np.sin(2 * np.pi * 0.5 * t), 1)) == 0
    assert clipped_share(np.round(rng.standard_normal(4000))) == 0
    assert clipped_share(np.zeros(4000)) == 0


def test_a_window_is_bounded_in_time_and_number():
    window = Window(1.0)
    for start in range(0, 5000, 100):
        at = stamps(5000)[start:start + 100]
        window.add(at, motion(at))
    assert 1000 <= len(window.samples()[0]) <= 1200
    window = Window(60.0)
    for start in range(0, 3 * MOST_SAMPLES, 1000):
        at = stamps(3 * MOST_SAMPLES)[start:start + 1000]
        window.add(at, motion(at))
    assert len(window.samples()[0]) == MOST_SAMPLES
    assert window.samples()[0][-1] == stamps(3 * MOST_SAMPLES)[-1]


@pytest.mark.parametrize("size", [1, 7, 300])
def test_a_window_is_the_same_however_its_samples_come(size):
    metrics, window = LiveMetrics(1.0), Window(1.0)
    at = stamps(3000)
    for start in range(0, 3000, size):
        raw = Samples.of(at[start:start + size], motion(at[start:start + size]))
        metrics.add(raw, raw.stamps_ns, raw.values, raw.stamps_ns, 0)
        window.add(raw.stamps_ns, raw.values)
    found, _ = metrics.snapshot(None, None).raw
    np.testing.assert_array_equal(found, window.samples()[0])
    np.testing.assert_array_equal(found, at[at >= at[-1] - 10**9])


def test_a_window_drops_what_cannot_be_judged():
    window = Window(1.0)
    at = stamps(6)[[0, 1, 1, 3, 2, 5]]
    values = motion(at)
    values[3] = np.nan
    window.add(at, values)
    np.testing.assert_array_equal(window.samples()[0], stamps(6)[[0, 1, 2, 5]])
    window.add(stamps(3) - 10**10, motion(stamps(3)))
    assert len(window.samples()[0]) == 3


def test_latencies_are_those_since_the_last_call():
    metrics = LiveMetrics(1.0)
    none = Samples.of([], np.empty((0, 3)))
    metrics.add(none, none.stamps_ns, none.values, -(10**6) * np.arange(101), 0)
    figures = metrics.take_latencies()
    assert figures == pytest.approx({"latency_p50_s": 0.05, "latency_p99_s": 0.099,
                                     "latency_max_s": 0.1})
    assert metrics.take_latencies() == {}
