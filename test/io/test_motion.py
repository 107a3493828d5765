"""Orientation and angular velocity of a corrected message are those of its new instant."""

import numpy as np
import pytest
from imu_motion import RATE_HZ, START_NS, angular_velocity, fields, messages, orientation, stamps

from frac_accel.io import cdr
from frac_accel.io.motion import MovedMotion


@pytest.mark.parametrize("flipped", [False, True])
@pytest.mark.parametrize("delay_s", [0.0004, 0.01, 0.0537])
def test_they_are_those_of_the_instant_before(delay_s, flipped):
    at = stamps()
    moved = MovedMotion(cdr.IMU).moved(messages(at, flipped=flipped), int(1e9 * delay_s))
    q, rate = fields(moved)
    t = np.maximum(1e-9 * (at - START_NS) - delay_s, 0.0)
    # of a chord over a sampling interval h: an eighth of h² times the second derivative
    most = (1 / RATE_HZ)**2 / 8
    assert np.abs(rate - angular_velocity(t)).max() < 9.1 * most
    turned = np.abs((q * orientation(t)).sum(axis=1))
    assert 2 * np.arccos(np.minimum(turned, 1.0)).max() < 1.1 * most + 1e-7
    np.testing.assert_allclose(np.linalg.norm(q, axis=1), 1.0, rtol=1e-12)
    # and nothing else is touched
    for before, after in zip(messages(at, flipped=flipped), moved):
        body = cdr.read_header(before).body_offset
        assert after[:body] == before[:body] and after[body + 32:body + 104] == \
            before[body + 32:body + 104] and after[body + 128:] == before[body + 128:]


def test_blocks_of_any_length_give_the_same_bytes():
    data, random = messages(stamps()), np.random.default_rng(1)
    whole = MovedMotion(cdr.IMU).moved(data, 23_400_000)
    edges = [0, *np.sort(random.choice(np.arange(1, 400), 150, replace=False)).tolist(), 400]
    in_parts = MovedMotion(cdr.IMU)
    assert whole == [each for start, stop in zip(edges[:-1], edges[1:])
                     for each in in_parts.moved(data[start:stop], 23_400_000)]


def test_what_is_not_measured_and_what_has_no_delay_stays():
    data = messages(stamps(50), known=(False, False))
    assert MovedMotion(cdr.IMU).moved(data, 5_000_000) == data
    data = messages(stamps(50), known=(False, True))
    q, rate = fields(MovedMotion(cdr.IMU).moved(data, 5_000_000))
    before = fields(data)
    np.testing.assert_array_equal(q, before[0])
    assert (rate[1:] != before[1][1:]).any(axis=1).all()
    assert MovedMotion(cdr.IMU).moved(data, 0) is data
    assert MovedMotion(cdr.ACCEL_STAMPED).moved(data, 5_000_000) is data


def test_a_clock_that_is_set_back_begins_anew():
    data = messages(stamps(20))
    moving = MovedMotion(cdr.IMU)
    once = moving.moved(data, 4_000_000)
    assert moving.moved(data, 4_000_000) == once
    assert MovedMotion(cdr.IMU).moved(data + data, 4_000_000) == once + once
