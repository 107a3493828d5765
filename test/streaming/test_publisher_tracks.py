"""Two publishers on one topic are told apart by their own counts and frames."""

import numpy as np
import pytest

from frac_accel.streaming.publisher_tracks import SILENT_S, PublisherTracks


def sent(rng, count, start, frame, phase, loss=0.0):
    """Messages (time, frame, sequence, whose) of one publisher at 1 kHz."""
    return [(1e-3 * (i + phase), frame, start + i, frame + str(start)) for i in range(count)
            if rng.random() >= loss]


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("frames", [("imu", "imu"), ("imu", "other")])
def test_the_first_is_followed_and_the_second_is_not(seed, frames):
    rng = np.random.default_rng(seed)
    first = sent(rng, 2000, 500, frames[0], 0.0, 0.05)
    second = [(t + 0.5, *rest) for t, *rest in sent(rng, 1500, 1 if seed % 2 else 90_000, frames[1],
                                                    0.3, 0.05)]
    tracks = PublisherTracks()
    for now, frame, sequence, whose in sorted(first + second):
        if now < 0.5:
            tracks.alone(frame, sequence, now)
        else:
            assert tracks.is_first(frame, sequence, now) == (whose == first[0][3])
    assert (tracks.first_frame, tracks.other_frame) == frames


def test_two_that_cannot_be_told_apart_are_nobodys():
    tracks = PublisherTracks()
    tracks.alone("imu", 4, 0.0)
    assert tracks.is_first("imu", 5, 0.001)
    assert not tracks.is_first("imu", 5, 0.0011)  # a second one with the same count
    assert not tracks.is_first("imu", 6, 0.002) and tracks.ambiguous


def test_without_counts_only_frames_tell():
    tracks = PublisherTracks()
    tracks.alone("imu", None, 0.0)
    assert not tracks.is_first("imu", None, 0.001) and tracks.ambiguous
    assert not tracks.is_first("other", None, 0.002) and not tracks.ambiguous


def test_the_second_takes_over_when_the_first_is_silent():
    tracks = PublisherTracks()
    tracks.alone("imu", 100, 0.0)
    taken = [tracks.is_first("imu", i, 1e-3 * i) for i in range(1, 1000)]
    # where the second's count passes the first's last one, they cannot be told apart for a while
    assert taken.index(True) == pytest.approx(1000 * SILENT_S, abs=110) and all(taken[700:])
