"""Short and strong interference."""

import dataclasses

import numpy as np

from ..parameters import parameter
from .base import INTERFERENCE, Effect, Reading
from .residual_power import law_likelihood, likelihood

# Largest share of the time that counts as bursts, and how much louder than the noise they are.
_MOST = 0.3
_LOUDER = 3.0
# Logarithm of the likelihood by which two noises must describe the residual better than one.
_BETTER = 50.0
# How many bursts there must be at least, how many where they make less than this share of what is
# left (of few nobody can tell that the motion has not made them), and the chance that a sample
# after one that sticks out does so too: spikes and heavy tails come alone.
_FEWEST, _SEVERAL, _MOSTLY = 5, 12, 0.5
_GOES_ON = 0.2
# Correlation of the bursts, and of the error in them, with the motion, above which they are its: so
# much more than chance gives, and at most so much.
_UNRELATED = 0.15
_AT_MOST = 0.5
# Standard deviations by which the motion's rank in bursts may exceed that at any time.
_DEVIATIONS = 4.0
# Share of the bursts over a half that begin on one way, with the chance below which so many do not;
# and range of the motion's ranks (half of them, a half by chance) in which they begin at one place.
_ONE_WAY, _NO_CHANCE = 0.35, 1e-5
_NARROW = 0.2
# Times the motion's mean power that bursts may meet, and the share of other times in the record at
# which they would have met as much, below which it has made them.
_MEETS, _HARDLY = 4.0, 0.02
# Mean of the error in bursts, over its RMS there, up to which noise has it, too, with the chance
# that so many bursts have one sign; and up to which it has it where all have.
_ONE_SIDED, _ONE_SIGN = 0.3, 1e-3
_ALL_ONE_SIDED = 0.6
# Correlation of one sample with the next in bursts, from which they are smooth: no noise, but how
# something settles, such as a filter that began anew.
_SETTLES = 0.9
# The same below which they ring from sample to sample: what the motion does within one, such as a
# shock of a moment, is not what a shift by a part of a sample makes of it.
_RINGS = -0.5
# Share of the error budget that bursts must have, and where one topic was put on the other's
# instants: there it lacks what is fast of the motion.
_SHOWN, _SHOWN_RESAMPLED = 0.01, 0.5
# Share of the bursts' power in samples that repeat the one before: a sensor that is stuck.
_REPEATED = 0.5
# Share of the bursts' power below which the noisy reference itself leaves of it: what guesses the
# motion from that reference does so for the mean motion, and too small where there is more of it.
_GUESSED = 0.5
# Share of what two noises gain that a noise which grows with the motion may gain.
_AS_GOOD = 0.5
# Samples around a missing one in which a filter still answers to what was put in its place.
_AROUND_MISSING = 10
# Uncertain share of what the filter to a band has taken of their RMS.
_OF_FILTER = 0.25
_PASSES = 60
_WINDOW = 5


@dataclasses.dataclass(frozen=True)
class InterferenceBursts(Effect):
    """Noise from elsewhere, in bursts for a share of the time, with this RMS within them."""

    cause = "interference_bursts"
    read_off = True
    stage = INTERFERENCE
    explanation = "Bursts of strong noise from elsewhere are added to the output."
    experiment = ("Record at rest: the bursts are still there; switch off motors, radios and "
                  "supplies nearby one at a time.")

    share: float = parameter("1", minimum=0, below=1, null=0.0)
    rms: float = parameter("output units", minimum=0, null=0.0)

    def invert(self, values, variance, circumstances):
        """The values as they are, with the variance that a burst adds on average."""
        return values, variance + self.share * self.rms**2

    @classmethod
    def recognised(cls, seen, shown):
        """A mixture of two noises, the louder one in stretches that the motion does not explain."""
        # a burst of a few strong samples looks like spikes
        used = (seen.used | seen.spikes) & ~_near(~seen.record.valid)
        error, output = (seen.measured - seen.output)[used], seen.output[used]
        if len(error) < 10 * _WINDOW or seen.is_uneven:
            return None
        least = _SHOWN_RESAMPLED if seen.record.resampled else _SHOWN
        noise, loud, share, better = _two_noises(error)
        if seen.parts().get("bursts", 0.0) < least or not 0 < share < _MOST \
                or loud < _LOUDER**2 * noise or better < _BETTER:
            return None
        inside = _in_bursts(error, noise, loud, share)
        starts = np.flatnonzero(np.diff(np.r_[0, inside.astype(int)]) == 1)
        mostly = share * (loud - noise) > _MOSTLY * np.mean(error**2)
        if len(starts) < (_FEWEST if mostly else _SEVERAL) or _going_on(error, noise) < _GOES_ON \
                or _follows(inside, error, output, starts) \
                or _one_sided(error, inside) \
                or not _RINGS < _smooth(error, inside) < _SETTLES \
                or _grows(error, output) > _AS_GOOD * better:
            return None
        values, simulated, _ = seen.as_recorded()
        recorded = values - simulated
        if _repeated(values, recorded) > _REPEATED:
            return None
        plain = seen.unguessed()
        if plain is not None and np.mean((seen.measured - plain)[used][inside]**2) \
                < _GUESSED * np.mean(error[inside]**2):
            return None
        length = inside.sum() / len(starts)
        after = np.where(inside, error * np.sqrt(noise / loud), error)
        drowned = np.zeros(len(used), bool)
        # its ends are too short for the power of neighbours
        drowned[used] = np.convolve(inside, np.ones(_WINDOW), "same") > 0.5
        words = (f"{len(starts)} bursts of {length:.3g} samples on average, "
                 f"{np.sqrt(loud / noise):.3g} times as loud as the rest, whatever the motion does")
        count, within = len(error), np.sqrt(loud - noise)
        if seen.record.band_hz is not None:
            # a filter takes of their power, and makes them longer
            found = _two_noises(recorded)
            if 0 < found[2] <= share and found[1] > loud:
                (noise, loud, share, _), count = found, len(recorded)
        rms = float(np.sqrt(loud - noise))
        std = rms / np.sqrt(2 * share * count) * loud / (loud - noise)
        stds = {"share": float(np.sqrt(share * (1 - share) * max(2 * length, 1) / count)),
                "rms": float(np.hypot(std, _OF_FILTER * (rms - within)))}
        alone = seen.parts().keys() == {"bursts"}
        return cls(float(share), rms), Reading(
            stds, error, after, words, drowned,
            evident=alone and _apart_from_motion(inside, output, length))


def _near(missing):
    """Samples around missing ones."""
    return np.convolve(missing, np.ones(2 * _AROUND_MISSING + 1), "same") > 0.5


def _two_noises(error):
    """Variances and the louder one's share of a normal mixture, and how much better it fits.

    A. P. Dempster, N. M. Laird, D. B. Rubin, *J. R. Stat. Soc. B* 39 (1977) 1-38.
    """
    squares = error**2
    quiet = _quiet(error)
    loud, share = max(10 * quiet, np.quantile(squares, 0.99)), 0.05
    for _ in range(_PASSES):
        if not 0 < quiet < loud:  # most of it is nothing, or all of it the same
            return quiet, loud, 0.0, 0.0
        weight = _weight(squares, quiet, loud, share)
        share = weight.mean()
        if share < 1e-6 or share > 0.999:
            return quiet, loud, 0.0, 0.0
        quiet = np.sum((1 - weight) * squares) / np.sum(1 - weight)
        loud = np.sum(weight * squares) / np.sum(weight)
    one = -0.5 * len(error) * (1 + np.log(squares.mean()))
    two = np.sum(np.logaddexp(np.log1p(-share) - 0.5 * (np.log(quiet) + squares / quiet),
                              np.log(share) - 0.5 * (np.log(loud) + squares / loud)))
    return quiet, loud, share, float(two - one)


def _quiet(error):
    """Variance by the median, which is 0.4549 of that of a squared normal variable."""
    return np.median(error**2) / 0.4549


def _weight(squares, quiet, loud, share):
    """Chance that each sample belongs to the louder noise."""
    odds = (np.log(share / (1 - share)) + 0.5 * np.log(quiet / loud)
            + 0.5 * squares * (1 / quiet - 1 / loud))
    return 1 / (1 + np.exp(-np.clip(odds, -500, 500)))


def _in_bursts(error, quiet, loud, share):
    """Which samples lie in a burst, by the power of a few neighbours."""
    mean = np.convolve(error**2, np.full(_WINDOW, 1 / _WINDOW), "same")
    odds = (np.log(share / (1 - share)) + 0.5 * _WINDOW * (
        np.log(quiet / loud) + mean * (1 / quiet - 1 / loud)))
    # of the neighbours, one loud one alone is none
    near = error**2 > 9 * quiet
    several = np.convolve(near, np.ones(_WINDOW), "same") >= 2
    return (odds > 0) & several


def _going_on(error, quiet):
    """Chance that a sample sticks out where the one before it does."""
    out = error**2 > 9 * quiet
    return out[1:][out[:-1]].mean() if out[:-1].any() else 0.0


def _follows(inside, error, output, starts):
    """Whether the bursts or the error in them have to do with the motion."""
    from scipy.stats import rankdata
    slope = np.gradient(output)
    bend = np.gradient(slope)
    if _struck(starts, output, slope):
        return True
    count = len(starts)
    # as many stretches as long as a burst could be one, and as many in them are independent
    stretches, samples = count / inside.mean(), max(inside.sum() / _WINDOW, count)
    moving = output - output.mean()
    for values in (moving, slope, bend):
        # bursts at any time meet any size of the motion: turns and stops are no time of their own
        size = rankdata(np.abs(values)) / len(values)
        if abs(size[inside].mean() - 0.5) > _DEVIATIONS / np.sqrt(12 * count):
            return True
        if abs(np.corrcoef(values**2, inside)[0, 1]) > _allowed(stretches) \
                or _meets_the_motion(inside, values**2):
            return True
        if abs(np.corrcoef(values[inside], error[inside])[0, 1]) > _allowed(samples):
            return True
    return False


def _struck(starts, output, slope):
    """Whether bursts begin where the motion comes to a certain place or size, or nearly all of them
    on the way out or back, as where a loose part strikes. Of such as only begin there more often,
    an error that grows with the motion may be behind it."""
    from scipy.stats import binomtest, iqr, rankdata
    moving = output - np.median(output)
    outward = int(np.sum(moving[starts] * slope[starts] > 0))
    if abs(outward / len(starts) - 0.5) > _ONE_WAY and binomtest(
            outward, len(starts)).pvalue < _NO_CHANCE:
        return True
    return len(starts) >= _SEVERAL and any(
        iqr(rankdata(values)[starts] / len(values)) < _NARROW
        for values in (moving, np.abs(moving)))


def _meets_the_motion(inside, power):
    """Whether bursts meet the motion as they hardly would if the record had begun at another time:
    a motion that is there for a short time only, such as a jump's, decides that by few of them."""
    met = np.fft.irfft(np.conj(np.fft.rfft(inside.astype(float))) * np.fft.rfft(power), len(inside))
    return met[0] > _MEETS * met.mean() and np.mean(met >= met[0]) < _HARDLY


def _apart_from_motion(inside, output, length):
    """Whether bursts, and as long before and after them, hold less of the motion than any time."""
    near = np.convolve(inside, np.ones(2 * int(length) + 1), "same") > 0.5
    power = (output - output.mean())**2
    return power[near].mean() < power.mean()


def _one_sided(error, inside):
    """Whether the error in bursts has one sign: no noise, but what something else adds, such as a
    turn about a point beside the sensor, or a zero that follows the vibration."""
    from scipy.ndimage import label
    from scipy.stats import binomtest
    mean = abs(np.mean(error[inside])) / np.sqrt(np.mean(error[inside]**2))
    numbers, count = label(inside)
    positive = int(np.sum(np.bincount(numbers[inside], error[inside])[1:] > 0))
    if positive in (0, count) and mean > _ALL_ONE_SIDED:
        return True
    return mean > _ONE_SIDED and binomtest(positive, count).pvalue < _ONE_SIGN


def _smooth(error, inside):
    """Correlation of one sample with the next within bursts."""
    one, other = (part[inside[1:] & inside[:-1]] for part in (error[1:], error[:-1]))
    return one @ other / max(np.linalg.norm(one) * np.linalg.norm(other), 1e-300)


def _grows(error, output):
    """How much better an error that grows with the motion, its slope or its bend is described."""
    slope = np.gradient(output)
    # outliers count little in either law: the rest may say the constant as well as the mean
    constant = max(likelihood(error, np.full(len(error), power)) for power in
                   (np.mean(error**2), _quiet(error)))
    return max(law_likelihood(error, values**2) - constant
               for values in (output - output.mean(), slope, np.gradient(slope)))


def _allowed(count):
    """Largest correlation of what is unrelated, by as many independent values."""
    return min(_UNRELATED + 3 / np.sqrt(count), _AT_MOST)


def _repeated(values, error):
    """Share of the power of what is far out of the noise in samples that repeat the one before."""
    power = np.where(np.abs(error) > _LOUDER * np.sqrt(_quiet(error)), error**2, 0.0)
    return power @ (np.diff(values, prepend=np.nan) == 0) / max(power.sum(), 1e-300)
