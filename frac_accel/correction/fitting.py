"""Least-squares fit of a stable filter to a wanted frequency response."""

import dataclasses

import numpy as np

from ..errors import DesignError
from ..signals.parallel_filter import ParallelFilter

# Lowest frequency [of the sampling rate] that is told from zero: at 2 kHz a period of six days.
LOWEST_SHARE = 1e-9
# Below the band of a sensor with a high-pass: gain, as a multiple of that at the band's edge, at
# which the rise weighs as much as the permitted error does in the band.
MOST_RISE = 30
# Taps after the delay, in periods of the highest frequency: with them a filter of short delay is as
# accurate as one of long delay, and far less noisy than with as many taps after as before.
TAIL = 4
# Delay, in periods of the highest frequency or of its distance from the Nyquist frequency, beyond
# which a filter gains nothing.
_LONGEST = 8
# Relative change of a response from that at zero that is none.
STATIC = 5e-4
_MOST_TAPS = 4096
# Sampling rate over the band's upper end; eight times as many taps are needed at least.
MOST_OVERSAMPLED = 50_000


@dataclasses.dataclass(frozen=True, eq=False)
class DesignedFilter:
    """A filter for one axis with what it is worth.

    Attributes
    ----------
    filter : ParallelFilter
    sampling_rate_hz : float
    band_hz : tuple of float
        Lowest and highest frequency [Hz] for which the errors hold.
    delay_s : float
        Delay of the filter alone [s].
    amplitude_error : float
        Worst relative amplitude error in the band.
    phase_error_deg : float
        Worst phase error in the band [degree], its delay taken out.
    noise_gain : float
        Standard deviation of the output per standard deviation of white input noise.
    rms_error : float
        Relative error in the band (complex, RMS over frequency).
    """

    filter: ParallelFilter
    sampling_rate_hz: float
    band_hz: tuple
    delay_s: float
    amplitude_error: float
    phase_error_deg: float
    noise_gain: float
    rms_error: float


class FilterProblem:
    """Least-squares fit of a filter with given poles to a target response.

    Parameters
    ----------
    target : callable
        Wanted response at complex s, without delay.
    poles_s : ndarray
        Poles [rad/s] of the target, which the filter takes over where they are stable.
    rate, band : float, tuple
    extra_delay : float
        Delay [samples] that this axis's target has beyond the common one.
    floor : float
        Size of the target below which errors are relative to it.
    """

    def __init__(self, target, poles_s, rate, band, extra_delay, floor=0.0):
        self.rate, self.band = rate, band
        self.lead = int(extra_delay)
        self.extra_delay = extra_delay - self.lead
        low, high = band
        if rate > MOST_OVERSAMPLED * high:
            raise DesignError(f"a filter that ends at {high:.4g} Hz has no end in sight at "
                              f"{rate:.6g} Hz; expected a band up to {rate / MOST_OVERSAMPLED:.4g} "
                              "Hz at least, or fewer samples per second")
        self.poles_s = poles_s
        self.response, self.floor = target, floor
        self.longest = min(_MOST_TAPS // 2,
                           int(np.ceil(_LONGEST * rate / min(high, rate / 2 - high))))
        self.grid = _band_grid(band, rate, poles_s, self.longest)
        self.check = _refined(self.grid)
        self.target = evaluate(target, self.grid, rate)
        self.check_target = evaluate(target, self.check, rate)
        edge = min(6 * high, rate / 2)
        above = np.unique(np.r_[np.linspace(high, edge, 200), np.linspace(edge, rate / 2, 150)])
        below = np.linspace(0, low, 60) if low else np.empty(0)
        self.outside = np.r_[below, above]
        spacing = np.r_[np.gradient(below) if low else below, np.gradient(above)]
        # root mean square over all frequencies: with it the noise gain is a fraction of this
        self.scale = np.sqrt(np.mean(np.abs(self.target)**2))
        self.outside_weight = np.sqrt(spacing / (rate / 2)) / self.scale
        linear = np.linspace(low, high, 2000)
        gain = np.abs(evaluate(target, linear, rate))
        self.ideal_noise_gain = np.sqrt(np.mean(gain**2) * (high - low) / (rate / 2))
        self._solved = {}

    def solve(self, delay, tolerance):
        """Least noisy DesignedFilter within `tolerance`; with the smallest error if none is."""
        # another axis may need more delay than this one can use
        wait = max(0, delay - self.longest)
        case = delay - wait, tolerance
        if case not in self._solved:
            self._solved[case] = self._solve(*case)
        design = self._solved[case]
        if not wait:
            return design
        return dataclasses.replace(
            design, delay_s=design.delay_s + wait / self.rate,
            filter=dataclasses.replace(design.filter, lead=design.filter.lead + wait))

    def _solve(self, delay, tolerance):
        taps, poles = self.structure(delay)
        low = self.band[0]
        shift = delay + self.extra_delay
        inside = self.columns(self.grid, taps, poles)
        inside *= (np.exp(2j * np.pi * self.grid * shift / self.rate)
                   / self._unit(self.target))[:, None]
        # the fit is worst where a high-pass's band begins: there an error weighs more
        weight = np.sqrt((1 + 4 * (low / np.maximum(self.grid, 1e-300))**2) / len(self.grid))
        inside *= weight[:, None]
        outside = self.columns(self.outside, taps, poles) * self.outside_weight[:, None]
        wanted = weight * np.abs(self.target / self._unit(self.target))
        if low:
            # below a high-pass's band the inverse may rise, but not without end
            below = np.linspace(0, low, 20)
            rise = MOST_RISE * np.abs(self.target[0]) / tolerance
            inside = np.r_[inside, self.columns(below, taps, poles) / (rise * np.sqrt(len(below)))]
            wanted = np.r_[wanted, np.zeros(len(below))]
        # orthogonal reduction once; each noise weight then solves a small system
        basis, triangle = np.linalg.qr(_real(inside))
        right = basis.T @ np.r_[wanted, np.zeros(len(wanted))]
        noise = np.linalg.qr(_real(outside), mode="r")
        check = self.columns(self.check, taps, poles)
        check *= (np.exp(2j * np.pi * self.check * shift / self.rate)
                  / self._unit(self.check_target))[:, None]
        right_size = np.abs(self.check_target / self._unit(self.check_target))

        def fit(noise_weight):
            matrix = np.r_[triangle, noise_weight * noise]
            scale = np.linalg.norm(matrix, axis=0)
            unknowns = np.linalg.lstsq(matrix / scale, np.r_[right, np.zeros(len(noise))],
                                       rcond=1e-13)[0] / scale
            return unknowns, check @ unknowns

        quiet, loud = -6.0, 2.0
        best, response = fit(10.0**quiet)
        if np.max(np.abs(response - right_size)) <= tolerance:
            while loud - quiet > 0.1:
                middle = (quiet + loud) / 2
                unknowns, trial = fit(10.0**middle)
                if np.max(np.abs(trial - right_size)) <= tolerance:
                    quiet, best, response = middle, unknowns, trial
                else:
                    loud = middle
        result = self.filter_of(best, taps, poles)
        phase = np.angle(response)
        return DesignedFilter(
            filter=result, sampling_rate_hz=self.rate, band_hz=self.band,
            delay_s=(shift + self.lead) / self.rate,
            amplitude_error=float(np.max(np.abs(np.abs(response) - right_size))),
            phase_error_deg=float(np.degrees(np.max(np.abs(phase[right_size > 0.999])))),
            noise_gain=result.noise_gain,
            rms_error=float(np.sqrt(np.average(np.abs(response - right_size)**2,
                                               weights=np.gradient(self.check)))))

    def _unit(self, target):
        """What errors are relative to: the target, made no smaller than the floor."""
        return target * np.maximum(1.0, self.floor / np.abs(target))

    def structure(self, delay, tail=TAIL):
        """Basis of the taps for a delay [samples] up to `longest`, and the poles in z.

        The taps after the delay are at least as many as those before, or `tail` periods of the
        highest frequency.
        """
        low, high = self.band
        before = np.ceil(delay + self.extra_delay)
        count = int(before + max(before, np.ceil(tail * self.rate / high))) + 2
        step = max(1, int(self.rate / (8 * high)))
        taps = _SmoothTaps.of_length(max(count, 4), step)
        # decays that the taps alone would cut off too early
        memory = min(5 * self.rate / (np.pi * taps.length), 0.15 * self.rate)
        poles_s = [p for p in self.poles_s if p.real < 0 and abs(p) < np.pi * self.rate]
        lowest = low / 20 if low else self._slowest() / 10
        real = [p.real for p in poles_s if not p.imag]
        slow = []
        if self._has_memory() and lowest < memory:
            # evenly in log frequency around the slowest real pole: the memory's density has a
            # pole there, too, and is summed rightly only if the two sides are alike
            centre = -max(real, default=-2 * np.pi * memory) / (2 * np.pi)
            steps = np.arange(np.floor(2.5 * np.log10(lowest / centre)),
                              np.ceil(2.5 * np.log10(memory / centre)) + 1)
            slow = -2 * np.pi * centre * 10**(steps[(steps != 0) | (not real)] / 2.5)
        pairs = [q for p in poles_s if p.imag > 0 for q in (p, np.conj(p))]
        # A section takes two poles: the conjugate pairs, then the slowest with the fastest (of two
        # slow ones, rounding would spoil the product of 1 - p), an odd one at the end.
        real = np.sort(np.r_[real, slow])
        order = np.stack([np.arange(len(real)), np.arange(len(real))[::-1]], axis=1).ravel()
        return taps, np.exp(np.r_[pairs, real[order[:len(real)]]].astype(complex) / self.rate)

    def _slowest(self):
        """Frequency [Hz] below which the target is as at zero."""
        frequency = np.geomspace(LOWEST_SHARE * self.rate, self.band[1], 500)
        target = evaluate(self.response, np.r_[0, frequency], self.rate)
        change = np.abs(target[1:] - target[0]) / max(np.abs(target[0]), self.floor)
        return frequency[np.argmax(change > STATIC)]

    def _has_memory(self):
        """Whether the target still varies at frequencies that the taps cannot resolve."""
        if self.band[0]:
            return True
        slow = self.grid < 0.02 * self.band[1]
        target = self.target[slow]
        # what a smooth response (a polynomial in s) would do down there is taken out
        s = 1j * self.grid[slow] / self.band[1]
        smooth = np.stack([s**0, s, s**2], axis=1)
        fit = np.linalg.lstsq(_real(smooth), np.r_[target.real, target.imag], rcond=None)[0]
        return bool(np.max(np.abs(target - smooth @ fit)) > 1e-5 * np.max(np.abs(target)))

    def columns(self, frequency, taps, poles):
        """Response of each unknown at frequencies [Hz]: taps, then the poles' sections."""
        z = np.exp(-2j * np.pi * frequency / self.rate)
        columns = [taps.columns(z)]
        for pole in poles:
            if not pole.imag:
                columns.append(((1 - pole) / (1 - pole * z))[:, None])
            elif pole.imag > 0:
                section = abs(1 - pole)**2 / ((1 - pole * z) * (1 - np.conj(pole) * z))
                columns.append(np.stack([section, section * z], axis=1))
        return np.concatenate(columns, axis=1)

    def filter_of(self, unknowns, taps, poles):
        """ParallelFilter of the unknowns that belong to `columns`."""
        rest = iter(unknowns[taps.unknowns:])
        residues = []
        for pole in poles:
            if not pole.imag:
                residues.append((1 - pole) * next(rest))
            elif pole.imag > 0:
                scale = abs(1 - pole)**2
                numerator = scale * (next(rest) + next(rest) / pole)
                residue = numerator * pole / (pole - np.conj(pole))
                residues += [residue, np.conj(residue)]
        return ParallelFilter(taps.taps(unknowns[:taps.unknowns]), poles,
                              np.array(residues, complex), self.lead)


@dataclasses.dataclass(frozen=True)
class _SmoothTaps:
    """Few unknowns for about `count` taps that vary slowly: cubic B-splines `step` taps apart.

    A response that ends far below the sampling rate needs no more; with step 1 these are the taps.
    """

    unknowns: int
    step: int

    @classmethod
    def of_length(cls, count, step):
        return cls(max(4, int(np.ceil((count - 4 * step + 3) / step)) + 1), step)

    @property
    def length(self):
        return (self.unknowns + 3) * self.step - 3

    def kernel(self):
        kernel = np.ones(1)
        for _ in range(4):
            kernel = np.convolve(kernel, np.ones(self.step) / self.step)
        return kernel

    def columns(self, z):
        """Response of each unknown at z**-1 = `z`, shape (len(z), unknowns)."""
        # four sums over `step` taps each, which is what the kernel is
        half = np.angle(z) / 2
        with np.errstate(invalid="ignore"):
            single = np.where(half == 0, 1.0, np.sin(self.step * half) / (
                self.step * np.sin(half)))
        shape = single**4 * np.exp(4j * (self.step - 1) * half)
        return shape[:, None] * np.vander(z**self.step, self.unknowns, increasing=True)

    def taps(self, unknowns):
        # each unknown's kernel, `step` taps after the one before: four pieces that overlap
        pieces = np.pad(self.kernel(), (0, 3)).reshape(4, self.step)
        rows = np.zeros((self.unknowns + 3, self.step))
        for number, piece in enumerate(pieces):
            rows[number:number + self.unknowns] += np.outer(unknowns, piece)
        return rows.ravel()[:self.length]


def _band_grid(band, rate, poles_s, delay):
    low, high = band
    # four points for each ripple that the taps can make
    grid = [np.linspace(low, high, max(300, int(8 * delay * high / rate))),
            np.geomspace(max(low, LOWEST_SHARE * rate), high, 200)]
    for pole in poles_s:
        centre, width = abs(pole.imag) / (2 * np.pi), abs(pole.real) / (2 * np.pi)
        if width < 0.1 * centre:
            grid.append(centre + width * np.linspace(-6, 6, 25))
    grid = np.unique(np.concatenate(grid))
    return grid[(grid >= low) & (grid <= high)]


def _refined(grid):
    """The grid with three points more in each of its gaps, except beside zero."""
    gaps = grid[np.flatnonzero(grid)[0]:]
    between = [gaps[:-1] + share * np.diff(gaps) for share in (0.25, 0.5, 0.75)]
    return np.unique(np.concatenate([grid, *between]))


def evaluate(target, frequency, rate):
    """Target on a grid of frequencies [Hz]; at zero, its limit."""
    return target(2j * np.pi * np.maximum(frequency, 1e-6 * LOWEST_SHARE * rate))


def _real(matrix):
    return np.concatenate([matrix.real, matrix.imag])
