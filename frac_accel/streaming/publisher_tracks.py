"""Telling the publishers on one topic apart by what each message carries.

rclpy does not hand on a publisher's identity, but every publisher counts its own messages, and
drivers name their frame: a message continues the track whose frame it has and whose number it
follows.
"""

import dataclasses

# A publisher's count goes on by so many at most; more is another publisher.
_LONGEST_STEP = 1000
# A publisher that has been silent for so long [s] no longer has the topic for itself.
SILENT_S = 0.5


@dataclasses.dataclass
class _Track:
    frame_id: str
    sequence: int
    seen_s: float


class PublisherTracks:
    """The first of several publishers, and which messages are its own.

    Attributes
    ----------
    ambiguous : bool
        Whether the last message could be anybody's.
    first_frame, other_frame : str
        Frames of the publisher that is followed and of the last other one.
    """

    def __init__(self):
        self.ambiguous = False
        self.first_frame = self.other_frame = ""
        self._tracks = []
        self._first = None

    def alone(self, frame_id, sequence, now_s):
        """Note a message of a topic that has one publisher."""
        self._tracks = [_Track(frame_id, sequence, now_s)]
        self._first = self._tracks[0]
        self.first_frame, self.ambiguous = frame_id, False

    def is_first(self, frame_id, sequence, now_s):
        """Whether a message is of the publisher that came first, as far as that can be told."""
        track = self._track_of(frame_id, sequence, now_s)
        if track is None:
            return False
        track.sequence, track.seen_s = sequence, now_s
        if self._first is None or now_s - self._first.seen_s > SILENT_S:
            self._first = track
        self.first_frame = self._first.frame_id
        if track is not self._first:
            self.other_frame = track.frame_id
        return track is self._first

    def _track_of(self, frame_id, sequence, now_s):
        """Track that a message continues, or a new one; None where two are equally likely."""
        self.ambiguous = False
        own = [track for track in self._tracks
               if track.frame_id == frame_id and now_s - track.seen_s <= SILENT_S]
        if sequence is None:
            # the middleware does not count: the frame is all there is
            close = own[:1]
            self.ambiguous = len(self._tracks) == 1 and bool(own)
        else:
            steps = [(sequence - track.sequence, track) for track in own]
            near = sorted((step for step in steps if 0 < step[0] <= _LONGEST_STEP),
                          key=lambda step: step[0])
            self.ambiguous = len(near) > 1 and near[0][0] == near[1][0]
            close = [near[0][1]] if near else []
        if self.ambiguous:
            return None
        if not close:
            self._tracks = [track for track in self._tracks if now_s - track.seen_s <= SILENT_S]
            close = [_Track(frame_id, sequence, now_s)]
            self._tracks += close
        return close[0]
