"""How a sensor lies against its reference: axes exchanged, reversed, or turned."""

import dataclasses

import numpy as np

from ..errors import FracAccelError
from ..io.samples import Samples
from ..model import AXES
from .relation import BLOCKS, products, refined

# Axes with less power than this, of the strongest one, do not move.
_RESTS = 1e-3
# Direction cosine from which on an axis follows one axis of the other, and share below which one
# of several is not worth telling.
_FOLLOWS = 0.85
_PART = 0.15
# Turn [degrees] that is worth telling, and standard uncertainties that it must be away from none.
_TURNED_DEG = 1.0
_SIGNIFICANT = 3.0
# Gain of an axis, over that of all, below which the sensor does not show it.
_SHOWN = 0.3
# Share of an axis' power that the others must explain for it to be said that it follows them.
_EXPLAINED = 0.2
# Standard uncertainties within which a turn is none but of axes that are exchanged or reversed, and
# how large [degrees] they may be.
_AS_STRAIGHT, _STRAIGHT_DEG = 2.0, 0.25
# Constants over the motion (RMS) from which they tell directions, and their direction cosines where
# they point the same way, and where they do not.
_LARGE, _ALONG, _ASTRAY = 2.0, 0.9, 0.5
# Gain in what a mirrored sensor leaves, over what a turned one leaves, by which it is mirrored.
_MIRRORED = 0.5


@dataclasses.dataclass(frozen=True, eq=False)
class Orientation:
    """Rotation from reference to sensor: sensor = gain · rotation · reference.

    Attributes
    ----------
    rotation : ndarray, shape (3, 3)
        Orthogonal; a column of an axis that does not move follows from the others by the
        right-hand rule where two move, and is NaN where one moves.
    angle_std_deg : float
        Standard uncertainty of its angles [degree], by a jackknife over sixteenths of the record.
    gain, gain_std : float
        Ratio of the sensor's motion to the reference's, all axes together.
    explained : ndarray, shape (3,)
        Share of each sensor axis' power that the turned reference explains; NaN without motion.
    moving : ndarray of bool, shape (3,)
        The reference's axes that move, as far as the sensor shows it.
    mirrored : bool
        Whether an odd number of axes is reversed, which no rotation does.
    offset_s : float
        Offset of the sensor's stamps at which this holds.
    """

    rotation: np.ndarray
    angle_std_deg: float
    gain: float
    gain_std: float
    explained: np.ndarray
    moving: np.ndarray
    mirrored: bool
    offset_s: float

    @classmethod
    def of(cls, record):
        """Orientation of a record, or None where reference and sensor have nothing in common.

        The orthogonal matrix that fits best in the sense of least squares (P. H. Schönemann,
        *Psychometrika* 31 (1966) 1-10; W. Kabsch, *Acta Cryst.* A32 (1976) 922-923), at the offset
        of the clocks that the correlation shows; constants (gravity) are taken off first.

        Parameters
        ----------
        record : Record

        Returns
        -------
        Orientation or None
        """
        found = _oriented(record)
        return found and found._straightened()

    def _straightened(self):
        """With axes that are just exchanged or reversed where no more is known: what such axes
        show, such as a lattice, is kept."""
        if not self.turned_deg < _AS_STRAIGHT * min(self.angle_std_deg, _STRAIGHT_DEG) \
                or not np.isfinite(self.rotation).all() \
                or abs(np.linalg.det(self.nearest)) < 0.5:
            return self
        return dataclasses.replace(self, rotation=self.nearest + 0.0)

    @property
    def nearest(self):
        """Signed permutation next to the rotation: entry (i, j) where sensor i follows ±axis j."""
        known = np.where(np.isfinite(self.rotation), self.rotation, 0.0)
        return np.sign(known) * (np.abs(known) > _FOLLOWS)

    @property
    def turned_deg(self):
        """Angle [degree] between the rotation and the signed permutation next to it, or NaN."""
        known = self.moving & np.isfinite(self.rotation).all(axis=0)
        cosines = np.sum(self.nearest * np.nan_to_num(self.rotation), axis=0)[known]
        if not len(cosines) or np.any(cosines <= _FOLLOWS):
            return float("nan")
        return float(np.degrees(np.arccos(np.clip(cosines.min(), -1, 1))))

    @property
    def aligned(self):
        """Whether each axis of the sensor follows the reference's axis of its own name."""
        nearest = self.nearest[:, self.moving]
        return bool(np.array_equal(nearest, np.eye(3)[:, self.moving]))

    def followed(self, axis):
        """What an axis of the sensor follows: "-y", "0.71 x + 0.70 z", or "" for nothing."""
        row = self.rotation[AXES.index(axis)]
        if not self.explained[AXES.index(axis)] > _EXPLAINED:
            return ""
        near = self.nearest[AXES.index(axis)]
        if near.any():
            place = int(np.flatnonzero(near)[0])
            return ("-" if near[place] < 0 else "") + AXES[place]
        parts = [f"{row[i]:.2f} {AXES[i]}" for i in range(3)
                 if self.moving[i] and abs(row[i]) > _PART]
        return " + ".join(parts).replace("+ -", "- ")

    def astray(self, axis):
        """Whether an axis of the sensor has nothing of the reference's axis of that name, but an
        axis of the sensor follows another one of the reference."""
        place = AXES.index(axis)
        elsewhere = [name for name in AXES if self.followed(name) not in ("", name, f"-{name}")]
        own = self.nearest[place, place] != 0 and self.explained[place] > _EXPLAINED
        return bool(elsewhere) and not own and not abs(self.rotation[place, place]) > 0.5

    def opposes(self, axis, sign):
        """Whether an axis of the sensor follows its own of the reference the other way round than
        with a `sign` of 1 or -1."""
        return self.followed(axis) == ("" if sign < 0 else "-") + axis

    @property
    def upside_down(self):
        """Whether two axes that move are reversed, as half a turn about the third reverses them."""
        return not self.mirrored and int(np.sum(np.diag(self.nearest)[self.moving] < 0)) == 2

    def is_against_constants(self, record):
        """Whether the constants of both, such as gravity, are far larger than the motion and point
        the same way without the rotation, but not with it: motion that a filter delays by half a
        period looks reversed, too."""
        one, two = (values[record.valid].mean(axis=0)
                    for values in (record.reference, record.sensor))
        moves = [np.linalg.norm(values[record.valid].std(axis=0))
                 for values in (record.reference, record.sensor)]
        sizes = [np.linalg.norm(constant) for constant in (one, two)]
        if min(size / max(move, 1e-300) for size, move in zip(sizes, moves)) < _LARGE:
            return False
        kept, turned = (float(constant @ two) / np.prod(sizes)
                        for constant in (one, np.nan_to_num(self.rotation) @ one))
        return kept > _ALONG and turned < _ASTRAY

    def turn(self, samples):
        """Samples of the sensor in the reference's axes.

        Raises
        ------
        FracAccelError
            If the sensor shows motion along one axis only, so that the rotation is not known.
        """
        if not np.isfinite(self.rotation).all():
            raise FracAccelError("the rotation is not known: the sensor shows motion along one "
                                 "axis of the reference only")
        return Samples.of(samples.stamps_ns, samples.values @ self.rotation,
                          samples.variance @ self.rotation**2, samples.frame_id)

    @property
    def words(self):
        """The same as a sentence; empty where the axes are the reference's and nothing is turned.
        """
        named = [(axis, self.followed(axis)) for axis in AXES]
        said = [f"sensor {axis} follows reference {what}" for axis, what in named if what]
        angle = self.turned_deg
        significant = angle > max(_TURNED_DEG, _SIGNIFICANT * self.angle_std_deg)
        if not said or (self.aligned and not significant):
            return ""
        text = ", ".join(said)
        if significant:
            text += f", turned by a further {angle:.2g} ± {max(self.angle_std_deg, 0.01):.1g} deg"
        text += f" (gain {self.gain:.3g} ± {self.gain_std:.1g}; " + ", ".join(
            f"{self.explained[i]:.0%} of {AXES[i]}" for i in range(3)
            if self.explained[i] > _EXPLAINED) + " explained)"
        return text + ("; an odd number of axes is reversed" if self.mirrored else "")


def turned_away(record, axis):
    """What to tell of a record whose sensor's axis follows another one of the reference, or "".

    Parameters
    ----------
    record : Record
    axis : {"x", "y", "z"}
    """
    found = Orientation.of(record)
    if found is None or not found.astray(axis):
        return ""
    return f"the axes are exchanged: {found.words}"


def _oriented(record):
    guess = 0.0 if record.offset_s is None else \
        record.offset_s - record.taken_out_s - record.lag_s
    rate = record.sampling_rate_hz
    best = refined(record.reference, record.sensor, record.valid, rate, guess, record.band_hz)
    lag = best.seconds * rate if best is not None else guess * rate
    whole = int(np.floor(lag))
    sums = products(record.reference, record.sensor, record.valid, np.arange(whole, whole + 2))
    if sums is None:
        return None
    # between two samples by a straight line: an error of a filter that is much the same for all
    shared = sums[1][:, 0] + (lag - whole) * (sums[1][:, 1] - sums[1][:, 0])
    own, other = sums[0][:, 0], sums[2][:, 0]
    power = np.diag(own.sum(axis=0))
    moving = power > _RESTS * power.max()
    if not power.max() > 0 or not np.trace(other.sum(axis=0)) > 0:
        return None
    rotation, gain, mirrored = _fit(own.sum(axis=0), shared.sum(axis=0), moving)
    # an axis of the sensor may be dead: where the motion along it points, nothing shows then
    gains = np.sum(rotation * shared.sum(axis=0).T, axis=0) / np.maximum(power, 1e-300)
    shown = moving & (gains > _SHOWN * gain)
    if shown.any() and not np.array_equal(shown, moving):
        moving = shown
        rotation, gain, mirrored = _fit(own.sum(axis=0), shared.sum(axis=0), moving)
    tries = [_fit(own.sum(axis=0) - own[i], shared.sum(axis=0) - shared[i], moving, mirrored)
             for i in range(BLOCKS)]
    spread = np.sqrt(BLOCKS - 1)
    angles = [np.degrees(np.arcsin(np.clip(np.nanmax(np.abs(turn - rotation)), 0, 1)))
              for turn, _, _ in tries]
    total, powers = shared.sum(axis=0), np.diag(other.sum(axis=0))
    known = np.nan_to_num(rotation)
    model = gain * known @ own.sum(axis=0) @ (gain * known).T
    left = powers - 2 * gain * np.diag(known @ total) + np.diag(model)
    with np.errstate(divide="ignore", invalid="ignore"):
        explained = np.where(powers > _RESTS**2 * powers.max(), 1 - left / powers, np.nan)
    offset = lag / rate + record.lag_s + record.taken_out_s
    return Orientation(rotation, float(spread * np.sqrt(np.mean(np.square(angles)))), float(gain),
                       float(spread * np.std([entry[1] for entry in tries])), explained, moving,
                       mirrored, float(offset))


def _fit(own, shared, moving, mirrored=None):
    """Rotation, gain, and whether the sensor is mirrored."""
    left, strength, right = np.linalg.svd(shared.T[:, moving], full_matrices=False)
    rotation = np.full((3, 3), np.nan)
    rotation[:, moving] = left @ right
    count = int(moving.sum())
    if count == 3:
        improper = np.linalg.det(rotation) < 0
        turned = strength * np.array([1, 1, -1 if improper else 1])
        if mirrored is None:
            # the trace is what either explains
            mirrored = bool(improper and turned.sum() < _MIRRORED * strength.sum())
        if improper and not mirrored:
            rotation = left @ np.diag([1.0, 1.0, -1.0]) @ right
    elif count == 2:
        first, second = np.flatnonzero(moving)
        third = 3 - first - second
        sign = 1.0 if (second - first) == 1 else -1.0
        rotation[:, third] = sign * np.cross(rotation[:, first], rotation[:, second])
    known = rotation[:, moving]
    gain = np.sum(known * shared.T[:, moving]) / np.trace(own[np.ix_(moving, moving)])
    return rotation, gain, bool(mirrored)
