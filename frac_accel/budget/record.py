"""From two topics and a model to what is left: the pair of any record that can be read."""

import dataclasses

import numpy as np

from ..errors import FracAccelError
from ..identification.checks.record_checks import require_magnitude
from ..model import AXES
from ..model.effects.fit_starts import bulk_shift
from ..record import Record
from ..record.clock import usable
from ..simulation import simulate
from .blocks import Blocks
from .division import Division
from .noise import established_noise, unaccounted

_FEWEST = 32
# Share of the power that a delay of whole samples may leave of what none does, to be worth it; and
# so little that chance, which finds some lag in any record, does not do it.
_WORTH, _FAR_LESS = 0.99, 0.5
# Share of what is left that is most of it.
_MOST = 0.5


@dataclasses.dataclass(frozen=True)
class Left:
    """What a model leaves of a record.

    Attributes
    ----------
    model : str
        Which model it is, in words.
    budget : Budget
    noise : EstablishedNoise
    unaccounted : dict
    words : list of str
        What had to be done to the record.
    """

    model: str
    budget: object
    noise: object
    unaccounted: dict
    words: list

    def as_dict(self):
        """Plain numbers for a result file."""
        return {"model": self.model, "rms": self.budget.rms, "output_rms": self.budget.output_rms,
                "budget": self.budget.as_list(), "established_noise": self.noise.as_dict(),
                "unaccounted": self.unaccounted, "words": [*self.words, *self.noise.words],
                **self.budget.picture()}


def left_by(reference, sensor, model=None, axis="x", noise_std=None, second_sensor=None,
            temperature_at=None):
    """Error budget of a record.

    Parameters
    ----------
    reference, sensor : Samples
    model : SensorModel, optional
        Without it, the best static gain and offset with a delay of whole samples.
    axis : {"x", "y", "z"}
    noise_std : float, optional
        What the user states [output units].
    second_sensor : Samples, optional
        Of another sensor on the same body.
    temperature_at : callable, optional
        Temperature [°C] at an array of stamps [ns]; needed by a model that depends on it.

    Returns
    -------
    Left

    Raises
    ------
    FracAccelError
        If there are too few samples, none in common, or the sensor's axis never changes.
    """
    column, words = AXES.index(axis), []
    pair = _record(reference, sensor, axis)
    require_magnitude(pair, axis)
    words += pair.words
    other_values = None
    if second_sensor is not None:
        other_values = _second(pair, second_sensor, column)
    measured, used = pair.sensor[:, column], pair.valid
    simulated, what = _simulated(pair, measured, model, axis, column, temperature_at)
    residual = np.where(used, measured - simulated, 0.0)
    other = None if other_values is None else _shared_residual(
        pair, other_values, measured, column, words)
    division = Division(pair.reference, used, pair.sampling_rate_hz, column, quick=True)
    budget = division.of(residual, measured, simulated, other)
    noise = established_noise(residual, measured, pair.reference, used, pair.sampling_rate_hz,
                              pair.sensor_std, noise_std, other, division.period)
    words += division.words + _ringing(residual, budget, division)
    return Left(what, budget, noise, unaccounted(budget.rms, budget.output_rms, noise), words)


def _record(reference, sensor, axis):
    """Both on the same instants; a reference that does not move along the axis is no hindrance."""
    refusal = None
    for name in (axis, *(other for other in AXES if other != axis)):
        try:
            record = Record.of(reference, sensor, name)
        except FracAccelError as error:
            refusal = refusal or error
            continue
        if np.ptp(record.sensor[record.valid, AXES.index(axis)]):
            return record
    raise refusal


def _simulated(pair, measured, model, axis, column, temperature_at):
    """Output that the model in use gives, and what model it is."""
    if model is not None:
        instants = pair.start_ns + np.arange(len(pair)) * 1e9 / pair.sampling_rate_hz
        celsius = None if temperature_at is None else temperature_at(instants)
        values = simulate(model, pair.reference, pair.sampling_rate_hz, initial="steady",
                          temperature_c=celsius,
                          start_time_s=pair.start_time_s)[:, column]
        if pair.lag_s:
            place = np.arange(len(pair)) + pair.lag_s * pair.sampling_rate_hz
            values = _between(values, place)
        return values, "the given model"
    simulated, gain, shift = _static(pair.reference[:, column], measured, pair.valid)
    late = f", {abs(shift)} sample(s) {'later' if shift > 0 else 'earlier'}" if shift else ""
    return simulated, f"the best static gain, {gain:.5g}, and offset{late} (no --model was given)"


def _between(values, place):
    """Values at fractional places, by a spline."""
    from scipy.interpolate import CubicSpline
    return CubicSpline(np.arange(len(values)), values)(np.clip(place, 0, len(values) - 1))


def _static(reference, measured, used):
    """Reference times the gain that fits best, with an offset, maybe whole samples of delay."""
    shift = bulk_shift(reference, measured, used) if np.ptp(reference[used]) else 0
    fits = [_moved(reference, measured, used, samples)
            for samples in dict.fromkeys((0, int(shift)))]
    at_once, late = (np.where(used, (measured - fit[0])**2, 0.0) for fit in (fits[0], fits[-1]))
    worth_it = late.sum() < _FAR_LESS * at_once.sum() or (
        late.sum() < _WORTH * at_once.sum() and _surely_less(reference, at_once, late))
    return fits[-1] if worth_it else fits[0]


def _moved(reference, measured, used, samples):
    """Reference, whole samples later, times the gain that fits best, with an offset; the gain, and
    the samples."""
    moved = np.roll(reference, samples)
    if samples > 0:
        moved[:samples] = reference[0]
    elif samples < 0:
        moved[samples:] = reference[-1]
    x, y = moved - moved[used].mean(), measured - measured[used].mean()
    power = float(x[used] @ x[used])
    gain = float(x[used] @ y[used]) / power if power else 0.0
    return gain * moved + (measured - gain * moved)[used].mean(), gain, samples


def _surely_less(reference, at_once, late):
    """Whether a delay leaves less power all along the record, beyond what the best of so many lags
    does by chance: a narrow band agrees a period away as well, and what is unrelated somewhere."""
    less = Blocks.of(reference - reference.mean()).sums(at_once - late)
    by_chance = np.sqrt(2 * np.log(len(reference)))
    return less.sum() > by_chance * np.sqrt(len(less)) * np.std(less)


def _ringing(residual, budget, division):
    """Words where most of what is left counts as noise, and lies in a band that is narrower than
    the filters which were tried resolve."""
    power = np.abs(np.fft.rfft((residual - residual[division.used].mean()) * division.used))**2
    lines = len(residual) / (2 * division.usual_lags)
    peak = int(np.argmax(power))
    near = power[max(int(peak - lines), 0):int(peak + lines) + 1].sum() / max(power.sum(), 1e-300)
    if budget.share("noise") < _MOST or near < _MOST or peak < lines:
        return []
    hz = division.rate / len(residual)
    return [f"{near:.0%} of what is left lies within {lines * hz:.2g} Hz of {peak * hz:.4g} Hz: "
            f"an answer that rings there for longer than {division.usual_lags / division.rate:.2g} "
            "s, the filters that were tried, counts as noise"]


def _second(pair, samples, column):
    """The second sensor at the pair's instants."""
    good = usable(samples)
    stamps, values = samples.stamps_ns[good], samples.values[good]
    if len(stamps) < _FEWEST:
        raise FracAccelError(f"second sensor: {len(stamps)} usable sample(s), expected at least "
                             f"{_FEWEST}")
    grid = np.arange(len(pair)) * 1e9 / pair.sampling_rate_hz
    return np.interp(grid, (stamps - pair.start_ns).astype(float), values[:, column])


def _shared_residual(pair, values, measured, column, words):
    """Residual of the second sensor in the first one's units."""
    reference = pair.reference[:, column]
    simulated, gain, _ = _static(reference, values, pair.valid)
    _, own, _ = _static(reference, measured, pair.valid)
    if not gain:
        words.append("the second sensor does not follow the reference: not used")
        return None
    left = values - simulated
    return (left - left[pair.valid].mean()) * own / gain
