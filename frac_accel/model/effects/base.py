"""What every effect can do: be simulated and be inverted.

An effect acts in one of these ways, and overrides what it needs:

* on the core's parameters (`change_core`), e.g. fractional damping;
* on the core's spring (`add_force`), e.g. cubic stiffness;
* as a linear time-invariant link (`transfer_function`, `pure_delay_s`), e.g. a low-pass: all
  links of an axis and its core form one composite response, simulated and inverted as one filter;
* on the sensor's clock (`clock_ratio`);
* on the samples after all that (`simulate`, `invert`), e.g. an offset; where either depends on the
  samples before, `live` gives an object that remembers them.

Nothing outside the file of a cause names it: what is particular to it, it declares itself.
"""

import dataclasses
from typing import ClassVar, NamedTuple

import numpy as np

from ...errors import ModelError
from ..core import Gain, Oscillator
from ..parameters import is_varied, parameter_fields

# Place in the signal's way through the sensor, from base to record. What happened to the reference
# on its way to the record is undone before.
(REFERENCE, TURN, MOUNTING, CORE, CONDITIONER, DELAY, GAIN, CROSS_AXIS, OFFSET, DEAD_ZONE,
 INTERFERENCE, CLIPPING, QUANTIZATION, STAMPS) = range(-2, 12)


class Circumstances(NamedTuple):
    """When and how warm the samples were.

    Attributes
    ----------
    time_s : ndarray, shape (n,)
        Time [s] since the record's start.
    temperature_c : ndarray, shape (n,), or None
        Temperature [°C]; None or NaN where it is not known.
    """

    time_s: np.ndarray
    temperature_c: np.ndarray


    @classmethod
    def at_rest(cls, n):
        """`n` samples at the record's start and at 25 °C."""
        return cls(np.zeros(n), np.full(n, 25.0))


class Reading(NamedTuple):
    """A cause that a record shows by itself, beside what a simulation explains of it.

    Attributes
    ----------
    std : dict of str to float
        Standard uncertainties of the parameters.
    before, after : ndarray, shape (m,)
        Errors of the simulation without and with the cause, in the samples' order.
    evidence : str
    drowned : ndarray of bool, shape (n,), optional
        Samples of the record in which it drowns whatever else may be wrong.
    evident : bool
        Whether it is certain, be it seen in one stretch of the record only.
    added : ndarray, shape (n,), optional
        What it adds to the output, where that is known sample by sample.
    """

    std: dict
    before: np.ndarray
    after: np.ndarray
    evidence: str
    drowned: np.ndarray | None = None
    evident: bool = False
    added: np.ndarray | None = None


class Open(NamedTuple):
    """A cause that the model in use leaves open, since it knows a parameter only so well.

    Attributes
    ----------
    effect : Effect
        What the model in use says.
    std : dict of str to float
        Standard uncertainty by parameter; infinite where nothing is known.
    """

    effect: object
    std: dict

    @property
    def is_known(self):
        """Whether each parameter's uncertainty is stated."""
        return bool(np.isfinite([*self.std.values()]).all())


class Effect:
    """Base of all effects; a subclass is a frozen dataclass of its parameters.

    All that anything else needs of a cause is declared here, in its own file: `check_effect` tells
    whether it holds together.
    """

    cause: ClassVar[str]
    stage: ClassVar[int]
    explanation: ClassVar[str]
    # what separates this cause from its rivals where a record cannot
    experiment: ClassVar[str] = "Repeat with a wider band, and at half and at twice the level."
    needs_temperature: ClassVar[bool] = False

    # True for what happened to the recorded reference alone: its link turns that back into the
    # motion, no correction knows of it, and a model file has it among the `reference_faults`
    of_reference: ClassVar[bool] = False
    # True for such a fault that says what one axis of the reference has, and nothing of the others
    of_own_axis: ClassVar[bool] = False
    # another cause that says the same with the other sign; where both do, this one is named
    mirrors: ClassVar[str | None] = None
    # True for what a record shows by itself (`of_record`, `reading`), and no fit looks for
    read_off: ClassVar[bool] = False
    # True where a record that shows it tells what it adds to each sample (`Reading.added`)
    known_by_sample: ClassVar[bool] = False
    # True for what leaves noise whose size follows the motion's
    goes_with_size: ClassVar[bool] = False
    # True where one clock or one way to the stamps makes it the same for all axes
    common_to_axes: ClassVar[bool] = False
    # True for a link that is one number at all frequencies
    is_constant: ClassVar[bool] = False
    # True for what says anew what the core already says
    restates_core: ClassVar[bool] = False
    # parameters whose null value makes this cause a special case of a simpler one
    nested: ClassVar[tuple[str, ...]] = ()
    # True for a force that hangs on nothing but where the mass is, so that a gain has it, too
    bends_at_once: ClassVar[bool] = False
    # True for what grows along a record, so that a part of it may not show it
    shows_with_time: ClassVar[bool] = False
    # True for what counts its time from a record's first sample, so that it is of that record alone
    counts_from_start: ClassVar[bool] = False
    # numbers of half waves over a record that its course in time may have (`in_course`)
    half_waves: ClassVar[tuple[int, ...]] = ()
    # True for what acts on slow motion, which the strongest part of a record may lack
    acts_on_slow_motion: ClassVar[bool] = False
    # True for what is so common and so cheap to fit that every search begins with it, too
    everyday: ClassVar[bool] = False
    # part of what a model leaves that it describes where no cause explains it
    describes: ClassVar[str | None] = None
    # parameters to which what it adds to the output is in proportion, where it only adds
    adds: ClassVar[tuple[str, ...]] = ()
    # name among the parameters that `identify` finds beside a core
    identified_as: ClassVar[str | None] = None

    @classmethod
    def starts(cls, view):
        """Where a fit of this cause to a record may begin.

        Parameters
        ----------
        view : diagnosis.search.View
            What the search knows so far.

        Returns
        -------
        list of Start
            Of `fit_starts`; none where the record cannot show this cause.
        """
        return []

    @classmethod
    def fitted_parameters(cls, axis, excited):
        """Names of the parameters that a record of this axis can determine.

        Parameters
        ----------
        axis : {"x", "y", "z"}
        excited : dict of str to bool
            By axis, whether the reference moves along it.
        """
        return [field.name for field in parameter_fields(cls) if is_varied(field)]

    @classmethod
    def mirrored(cls, effect):
        """What says the same as an effect of the cause that this one `mirrors`, or None."""
        return None

    def restated(self, core):
        """The core that says what this says beside another one; where `restates_core`."""
        return self.change_core(core)

    def restating(self, core, own):
        """This effect where beside a model's `own` core it says what another one is; where
        `restates_core`."""
        return self

    @classmethod
    def of_turn(cls, rotation, beside=None):
        """The effect that says that the sensor lies turned, or None.

        Parameters
        ----------
        rotation : ndarray, shape (3, 3)
            From the reference's axes to the sensor's.
        beside : Effect, optional
            One of this cause that acts before.
        """
        return None

    def with_other_axes(self, axis, shares):
        """This effect with what it says of the other axes as these show it, the same for the axis
        by which it was found.

        Parameters
        ----------
        axis : int
            By which it was found.
        shares : ndarray, shape (3, 3)
            Row i: shares of the axes' simulated outputs in the measured axis i, NaN where either
            does not move.
        """
        return self

    @classmethod
    def of_slips(cls, at_s, counts, interval_s, samples):
        """The effect that says that samples are lost though the stamps count on, or None.

        Parameters
        ----------
        at_s : ndarray, shape (m,)
            Stamps after the record's start that the first samples after a loss carry [s].
        counts : ndarray, shape (m,)
            Samples that each has lost.
        interval_s : float
            Sampling interval [s].
        samples : int
            That are there.
        """
        return None

    def in_share(self, share):
        """This effect with a share of what it adds (`adds`), as another axis has it."""
        return dataclasses.replace(self, **{
            name: tuple(share * each for each in value) if isinstance(value, tuple)
            else share * value
            for name in self.adds for value in [getattr(self, name)]})

    def std_of_turn(self, angle_std_deg):
        """Standard uncertainties by parameter of an effect of `of_turn`.

        Parameters
        ----------
        angle_std_deg : float
            Of the rotation, about any axis [degree].
        """
        return {}

    def words_of_turn(self, angle_std_deg):
        """What the uncertainties of `std_of_turn` do not say, as sentences without a full stop."""
        return []

    @classmethod
    def column(cls, values):
        """What is added to samples, shape (n,), where its course in time is 1."""
        raise NotImplementedError(cls.cause)

    @classmethod
    def in_course(cls, time_s, values):
        """Effect that has these values at these instants [s]; of one with `half_waves`."""
        raise NotImplementedError(cls.cause)

    def alternatives(self):
        """Effects of this cause to go on from that differ in what no fit varies, such as an order.

        Nearest ones are enough: each that fits better is asked for its own.
        """
        return []

    def exchanged(self, other):
        """This effect and another one that restates the core, with each other's resonance; or None.

        Which of two peaks is whose, a fit does not find out by small steps.
        """
        return None

    @classmethod
    def left_open(cls, axis_model, stds, stamps_std_s):
        """`Open` where the model in use knows this cause only so well, otherwise None.

        Parameters
        ----------
        axis_model : AxisModel
        stds : dict of str to float
            Standard uncertainties of the model's own parameters, as ``identify`` names them.
        stamps_std_s : float
            Uncertainty [s] of the record's common instants, by stamps that scatter.
        """
        return None

    @classmethod
    def of_record(cls, found, measured):
        """Effect of this cause as a record shows it by itself, or None.

        Parameters
        ----------
        found : Integrity
        measured : ndarray, shape (n,)
        """
        return None

    def beside_jump(self, jump):
        """This effect on samples that were laid out evenly though their stamps jump
        (`record.clock.Jump`)."""
        return self

    def on_stamps(self):
        """The same on samples that have their stamps."""
        return self

    def spoiled(self, measured):
        """Mask, shape (n,): samples that because of this effect say nothing of any other."""
        return np.zeros(len(measured), bool)

    def reading(self, seen):
        """What this effect of `of_record` explains beside a simulation: `Reading`, or None.

        Parameters
        ----------
        seen : diagnosis.seen.Seen
        """
        return None

    @classmethod
    def recognised(cls, seen, shown):
        """This cause as what is left of a record shows it.

        Parameters
        ----------
        seen : diagnosis.seen.Seen
        shown : Effect or None
            What `of_record` found.

        Returns
        -------
        tuple of Effect and Reading, or None
        """
        reading = shown.reading(seen) if shown is not None else None
        return (shown, reading) if reading is not None else None

    @classmethod
    def acts_on(cls, core):
        """Whether a sensor with this core can have this cause: motion and spring need a mass, but
        for a spring that is bent also far below the resonance."""
        return isinstance(core, Oscillator) or cls.change_core is Effect.change_core and (
            cls.add_force is Effect.add_force or cls.bends_at_once and isinstance(core, Gain))

    def degenerate(self, scales):
        """Why, with these parameters, it is not what its name says, in words; or None.

        Parameters
        ----------
        scales : dict of str to float
            What counts as a change of one of each fitted parameter, in this record.
        """
        return None

    def beside(self, residual, time_s):
        """RMS of a residual in the place where this cause acts alone, or None where it acts at all
        frequencies: whatever is left elsewhere, it may stand out there.

        Parameters
        ----------
        residual : ndarray, shape (n,)
            0 where a sample does not count.
        time_s : ndarray, shape (n,)
        """
        return None

    def kindred(self, residual, time_s):
        """RMS [output units] of what is of its own kind in a residual, shape (n,), beside it: that
        says nothing against it."""
        return 0.0

    def may_be_of(self, motion, time_s):
        """Whether what this effect adds may be of a motion, shape (n,), with which it should have
        nothing to do: of another axis, that crosses over, or of its own behind a filter."""
        return False

    def std_by_stamps(self, record):
        """Standard uncertainties by parameter that a record's stamps leave, whatever is fitted."""
        return {}

    def mean_delay_s(self):
        """Mean delay [s] that belongs to what this is, so that a cause which says just that has no
        name beside it."""
        return 0.0

    def pure_delay_s(self):
        """Time [s] by which this effect moves the signal as it is."""
        return 0.0

    def slow_delay_s(self):
        """Time [s] by which motion far slower than the effect is late."""
        return self.pure_delay_s()

    def clock_ratio(self):
        """Time that passes while the stamps advance by one second."""
        return 1.0

    def time_steps(self):
        """Instants [s] of the sensor's clock at which its stamps jump, and by how much [s] each.

        From there on, the value stamped t belongs to t less that.
        """
        return ()

    def change_core(self, core):
        """Core as this effect leaves it."""
        return core

    def add_force(self, force):
        """`StaticForce` of the core's spring as this effect leaves it."""
        return force

    def change_base(self, values, sampling_rate_hz):
        """The base's acceleration, shape (n,), from what is recorded of it."""
        return values

    def changes_base(self):
        """Whether `change_base` does all that this effect does, so that it is no link."""
        return type(self).change_base is not Effect.change_base

    def base_gain(self, time_s):
        """Gain of the base's acceleration before the core, at times [s] since the record's start.

        A number or an array of the times' shape.
        """
        return 1.0

    def change_motion(self, motion, step_s):
        """What this effect passes on of the core's motion, both shape (n,), finely sampled.

        It begins at rest. Of effects at the stage `CORE` that depend on the path; a link of their
        own comes after it.
        """
        return motion

    def transfer_function(self, s):
        """Linear link's transfer function at complex `s` [rad/s], without its pure delay."""
        return np.ones_like(s, dtype=complex)

    def limits(self):
        """Lowest and highest value that can come out."""
        return -np.inf, np.inf

    def reference_gain(self):
        """Gain of the link on its plateau."""
        return 1.0

    def unknown_density(self, frequency_hz):
        """Density [(m/s²)²/Hz] of what a reference's fault leaves unknown of the motion."""
        return np.zeros_like(frequency_hz)

    def shows(self, frequency_hz):
        """Share of a motion's size that the reference has recorded, where that is not all of it."""
        return np.ones_like(frequency_hz)

    def poles(self):
        """Poles of the link [rad/s]."""
        return np.array([])

    def zeros(self):
        """Zeros of the link [rad/s]."""
        return np.array([])

    def simulate(self, values, circumstances):
        """Samples of one axis after this effect.

        Parameters
        ----------
        values : ndarray, shape (n,)
            Samples before it.
        circumstances : Circumstances

        Returns
        -------
        ndarray, shape (n,)
        """
        return values

    def invert(self, values, variance, circumstances):
        """Samples before this effect and their variance; the inverse of `simulate`.

        Parameters
        ----------
        values, variance : ndarray, shape (n,)
            Samples after it, and the variance of their noise (0 where it is not known).
        circumstances : Circumstances

        Returns
        -------
        values, variance : ndarray, shape (n,)
        """
        return values, variance

    def live(self, sampling_rate_hz):
        """This effect on one stream of samples, for simulation and for inversion.

        An effect with memory returns a new object whose `simulate` and `invert` take consecutive
        blocks and remember; results must not depend on where the blocks are cut. Everything runs
        through it, a whole record as one block.

        Parameters
        ----------
        sampling_rate_hz : float
        """
        return self

    @property
    def mixes_axes(self):
        """Whether it brings something across from other axes."""
        return self.stage in (TURN, CROSS_AXIS)

    @property
    def mixes_outputs(self):
        """Whether it brings something across from other axes' outputs."""
        return self.stage == CROSS_AXIS

    def share_of_axes(self, axis):
        """Share of each axis, shape (3,), in an axis (0, 1, 2), itself included.

        Of effects that mix the axes: at the stage of a turn the acceleration of the base, at that
        of a cross-axis sensitivity the axes' outputs.
        """
        return np.eye(3)[axis]

    @classmethod
    def simulate_axes(cls, values, by_axis, circumstances):
        """Samples of all axes after this cause.

        Parameters
        ----------
        values : ndarray, shape (n, 3)
            Samples before it.
        by_axis : dict of int to Effect
            The effect of this cause on each axis that has it.
        circumstances : Circumstances

        Returns
        -------
        ndarray, shape (n, 3)
        """
        result = values.copy()
        for axis, effect in by_axis.items():
            result[:, axis] = effect.simulate(values[:, axis], circumstances)
        return result

    @classmethod
    def invert_axes(cls, values, variance, by_axis, circumstances):
        """Samples of all axes before this cause and their variance, both (n, 3)."""
        values, variance = values.copy(), variance.copy()
        for axis, effect in by_axis.items():
            values[:, axis], variance[:, axis] = effect.invert(
                values[:, axis], variance[:, axis], circumstances)
        return values, variance


def require_oscillator(core, cause):
    """The core; raise ModelError where it is not an oscillator."""
    if not isinstance(core, Oscillator):
        raise ModelError(f"effects: {cause} given with a core of type {core.type}, expected an "
                         "oscillator")
    return core
