"""Sensor that is turned against the reference."""

import dataclasses

import numpy as np

from ..parameters import parameter
from .axis_turn import small_turn_of, turn_of
from .base import TURN, Effect
from .fit_starts import Start, finite

_AXES = "xyz"
# Share of an axis that counts as the whole, for words.
_WHOLE = 0.97
# Cosine of the pitch below which roll and yaw turn about the same axis.
_SAME_AXIS = 1e-6
# Turn [degree] by which a small one is told, and up to which one is small.
_SMALL_DEG, _LARGE_DEG = 0.1, 20.0
# Least turn [degree] about an axis that the others show.
_SEEN_DEG = 0.05
# Standard uncertainty [degree] of an angle of which nothing is known.
_ANY_ANGLE_DEG = 360 / np.sqrt(12)
# Standard uncertainty from which an angle is said to be known with another one only.
_OPEN_DEG = 10.0


@dataclasses.dataclass(frozen=True)
class Misalignment(Effect):
    r"""Orientation of the sensor in the reference's frame (REP 103: fixed axes, right-handed).

    :math:`R = R_z(\text{yaw}) R_y(\text{pitch}) R_x(\text{roll})` turns a vector's components in
    the sensor's axes into those in the reference's; the sensor feels
    :math:`R^T a_\text{reference}`, before anything else.
    """

    cause = "misalignment"
    stage = TURN
    explanation = ("The sensor is turned against the reference; by quarter turns, axes are "
                   "exchanged or have the opposite sign.")
    experiment = ("Record at rest in several positions: gravity shows the axes of both. A turn "
                  "keeps the sum of the squares of all axes, a cross-axis sensitivity does not.")

    common_to_axes = True

    roll_deg: float = parameter("deg", minimum=-360, maximum=360, default=0.0, scale=57.3, null=0.0)
    pitch_deg: float = parameter("deg", minimum=-360, maximum=360, default=0.0, scale=57.3,
                                 null=0.0)
    yaw_deg: float = parameter("deg", minimum=-360, maximum=360, default=0.0, scale=57.3, null=0.0)

    def __post_init__(self):
        words = [words for words in map(self.in_words, range(3)) if words]
        if words:
            # frozen: said once, of this turn
            object.__setattr__(self, "explanation",
                               f"{type(self).explanation[:-1]}: {', '.join(words)}.")

    @classmethod
    def of_turn(cls, rotation, beside=None):
        """Angles of a rotation; None of a mirrored sensor. Where x and z turn about the same axis
        (a pitch of exactly a quarter turn), the roll is 0."""
        if np.linalg.det(rotation) < 0:
            return None
        turn = (beside or cls()).rotation @ rotation.T
        upright = np.hypot(turn[0, 0], turn[1, 0])
        pitch = np.arctan2(-turn[2, 0], upright)
        if upright < _SAME_AXIS:
            roll, yaw = 0.0, np.arctan2(-turn[0, 1], turn[1, 1])
        else:
            roll, yaw = np.arctan2(turn[2, 1], turn[2, 2]), np.arctan2(turn[1, 0], turn[0, 0])
        return cls(*(float(angle) + 0.0 for angle in np.degrees([roll, pitch, yaw])))  # no -0

    def std_of_turn(self, angle_std_deg):
        upright = max(abs(np.cos(np.radians(self.pitch_deg))), _SAME_AXIS)
        about_x_and_z = min(angle_std_deg / upright, _ANY_ANGLE_DEG)
        return {"roll_deg": about_x_and_z, "pitch_deg": angle_std_deg, "yaw_deg": about_x_and_z}

    def words_of_turn(self, angle_std_deg):
        if self.std_of_turn(angle_std_deg)["roll_deg"] < _OPEN_DEG:
            return []
        # at a pitch of 90 degrees both turn about one axis: upwards one way, downwards the other
        up = self.pitch_deg > 0
        known = self.roll_deg + (-self.yaw_deg if up else self.yaw_deg)
        known -= 360 * np.round(known / 360)
        return [f"at a pitch of {self.pitch_deg:.3g} degrees roll and yaw turn about one axis: "
                f"only their {'difference' if up else 'sum'}, {known:.3g} ± {angle_std_deg:.2g} "
                "degrees, is known"]

    @property
    def rotation(self):
        """R, shape (3, 3): from the sensor's axes to the reference's."""
        (sx, cx), (sy, cy), (sz, cz) = ((np.sin(a), np.cos(a)) for a in np.radians(
            [self.roll_deg, self.pitch_deg, self.yaw_deg]))
        about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
        about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
        about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
        return about_z @ about_y @ about_x

    def share_of_axes(self, axis):
        return self.rotation[:, axis]

    def with_other_axes(self, axis, shares):
        """The same turn but for one about the axis itself, which only the others see."""
        others = [(axis + 1) % 3, (axis + 2) % 3]
        if not np.isfinite(shares[others]).all():
            return self
        rotation = self.rotation
        first, second = rotation[:, others].T
        about = np.arctan2(shares[others[0]] @ second - shares[others[1]] @ first,
                           shares[others[0]] @ first + shares[others[1]] @ second)
        if abs(about) < np.radians(_SEEN_DEG):
            return self
        rotation[:, others] = np.stack([np.cos(about) * first + np.sin(about) * second,
                                        np.cos(about) * second - np.sin(about) * first], axis=1)
        return Misalignment.of_turn(rotation.T)

    def in_words(self, axis):
        """What has become of an axis (0, 1, 2) where it is another one, or turned over; or None."""
        shares = self.share_of_axes(axis)
        most = int(np.argmax(np.abs(shares)))
        if abs(shares[most]) < _WHOLE or (most == axis and shares[most] > 0):
            return None
        sign = "" if shares[most] > 0 else "minus "
        return f"the sensor's {_AXES[axis]} is the reference's {sign}{_AXES[most]}"

    @classmethod
    def fitted_parameters(cls, axis, excited):
        """The angles that turn other excited axes into this one; x does not see a roll."""
        others = [other for other in _AXES if other != axis and excited[other]]
        return sorted({_ABOUT[frozenset(axis + other)] for other in others})

    @classmethod
    def starts(cls, view):
        turn = turn_of(view)
        starts = [] if turn is None else [finite(cls(*turn))]
        if turn is None and view.is_bent:
            # what a bent axis makes of the others' motion tells a turn from what comes across
            turn = small_turn_of(view)
        if turn is None:
            return []
        if max(map(abs, turn)) < _LARGE_DEG:
            # as the axis itself shows it: by the others it is bent by what only they have
            angles = cls.fitted_parameters(view.axis, view.excited)
            starts.append(Start(
                cls(*turn), tuple(cls(**{angle: _SMALL_DEG}) for angle in angles), "free"))
        return starts


# The angle that mixes two axes where it is small.
_ABOUT = {frozenset("yz"): "roll_deg", frozenset("xz"): "pitch_deg", frozenset("xy"): "yaw_deg"}
