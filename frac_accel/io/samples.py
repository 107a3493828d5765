"""A run of acceleration samples as plain arrays: what bags and topics turn into."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Samples(NamedTuple):
    """Samples of one topic.

    Attributes
    ----------
    stamps_ns : int64 (n,)
        Header stamps in nanoseconds (not log times), in the order of the log.
    values : float64 (n, 3)
        Acceleration along x, y, z, in the unit in which it was published.
    variance : float64 (n, 3)
        Diagonal of ``linear_acceleration_covariance``; NaN where it is unknown (all zeros,
        or element 0 is -1) and for message types without a covariance.
    frame_id : str
        Frame of the first sample.

    Examples
    --------
    >>> import numpy as np, frac_accel
    >>> frac_accel.Samples.of(np.arange(1000) * 1_000_000, np.zeros((1000, 3)))
    <Samples: 1000 in accel_link, 0.999 s>
    """

    stamps_ns: np.ndarray
    values: np.ndarray
    variance: np.ndarray
    frame_id: str

    def __repr__(self) -> str:
        span = f", {(self.stamps_ns[-1] - self.stamps_ns[0]) * 1e-9:.4g} s" \
            if len(self.stamps_ns) else ""
        return f"<Samples: {len(self.stamps_ns)} in {self.frame_id}{span}>"

    @classmethod
    def of(cls, stamps_ns, values, variance=None, frame_id: str = "accel_link") -> Samples:
        """Samples from anything array-like; raises ValueError on shapes that do not fit."""
        stamps_ns = np.asarray(stamps_ns, dtype=np.int64)
        values = np.asarray(values, dtype=np.float64)
        if variance is None:
            variance = np.full(values.shape, np.nan)
        variance = np.asarray(variance, dtype=np.float64)
        expected = (stamps_ns.size, 3)
        if stamps_ns.ndim != 1 or values.shape != expected or variance.shape != expected:
            raise ValueError(
                f"stamps of shape {stamps_ns.shape} need values and variance of shape (n, 3), "
                f"got {values.shape} and {variance.shape}"
            )
        return cls(stamps_ns, values, variance, frame_id)

    @classmethod
    def concatenate(cls, blocks: list[Samples]) -> Samples:
        """One run from consecutive blocks (at least one); the first block's frame is kept."""
        if len(blocks) == 1:
            return blocks[0]
        stamps = np.concatenate([block.stamps_ns for block in blocks])
        # column by column: what is worked on later is one axis of a long record
        values = np.concatenate([block.values for block in blocks],
                                out=np.empty((len(stamps), 3), order="F"))
        if all(np.isnan(block.variance).all() for block in blocks):
            # one number that looks like as many as there are samples
            variance = np.broadcast_to(np.nan, values.shape)
        else:
            variance = np.concatenate([block.variance for block in blocks])
        return cls(stamps, values, variance, blocks[0].frame_id)


class Correlated(Samples):
    """Samples of an Imu whose covariance is more than its diagonal.

    Attributes
    ----------
    covariance : float64 (n, 9)
        ``linear_acceleration_covariance`` row by row.
    """

    covariance: np.ndarray

    @classmethod
    def from_samples(cls, samples: Samples, covariance: np.ndarray) -> Samples:
        """`samples` themselves where there is nothing beside the diagonal."""
        if not np.delete(covariance, [0, 4, 8], axis=1).any():
            return samples
        result = cls(*samples)
        result.covariance = covariance
        return result
