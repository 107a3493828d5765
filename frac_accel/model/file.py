"""Sensor model: a core and its effects for each axis, read from and written to YAML."""

import dataclasses
import difflib
import functools
import hashlib
import math
import re

import numpy as np
import yaml

from ..errors import ModelError
from ..io import safe_yaml
from ..io.outputs import write_text
from ..io.regular_file import open_regular
from .core import CORES, Arx, Oscillator
from .core.static_force import StaticForce
from .effects import Circumstances, Effect, effect_names, effect_of
from .effects.axis_mixing import mix, mixed_by
from .effects.base import TURN
from .parameters import as_mapping, build, number, parameter_fields, plain

SCHEMA = "frac_accel/sensor_model/1"
_ANY_SCHEMA = r"frac_accel/sensor_model/\d{1,3}"
AXES = "xyz"
_OWN_KEYS = ("schema", "core", "effects", "axes", "reference_faults")
# A model is a few kilobytes; YAML takes seconds to read a megabyte.
_LARGEST_FILE = 64 * 1024


@dataclasses.dataclass(frozen=True)
class AxisModel:
    """Model of one axis.

    Attributes
    ----------
    core : Oscillator, Gain, Arx or FractionalTransferFunction
        Linear core as the file gives it.
    effects : tuple of Effect
        In signal order.
    """

    core: object
    effects: tuple = ()

    @property
    def effective_core(self):
        """Core after the effects that change its parameters."""
        core = self.core
        for effect in self.effects:
            core = effect.change_core(core)
        return core

    @property
    def static_force(self):
        """StaticForce of the core's spring beyond its linear part; false where there is none."""
        force = StaticForce(core=self.effective_core)
        for effect in self.effects:
            force = effect.add_force(force)
        return force

    def base_shares(self, axis):
        """Share of each of the reference's axes, shape (3,), in the acceleration along this one,
        `axis` (0, 1, 2)."""
        return mixed_by(effect for effect in self.effects if effect.stage == TURN)[axis]

    def base_gain(self, time_s):
        """Gain of the base's acceleration before the core at times since the record's start."""
        return math.prod(effect.base_gain(time_s) for effect in self.effects)

    @property
    def changes_base(self):
        """Whether `base_gain` can be other than 1."""
        return any(type(effect).base_gain is not Effect.base_gain for effect in self.effects)

    @property
    def behind_base(self):
        """The same without the effects on what is recorded of the base, and these."""
        on_base = tuple(effect for effect in self.effects if effect.changes_base())
        return AxisModel(self.core, tuple(effect for effect in self.effects
                                          if effect not in on_base)), on_base

    @property
    def path_dependent(self):
        """Effects that change the core's motion on its way to the links behind."""
        return tuple(effect for effect in self.effects
                     if type(effect).change_motion is not Effect.change_motion)

    @property
    def constant_gain(self):
        """Product of the effects that are a constant gain."""
        return float(np.prod([effect.transfer_function(np.zeros(1, complex))[0].real
                              for effect in self.effects if effect.is_constant]))

    @property
    def gain(self):
        """The same with that of the core; of one that states none, without."""
        return getattr(self.effective_core, "sensitivity", 1.0) * self.constant_gain

    @property
    def delay_s(self):
        """Sum of the pure delays [s]: the value stamped t belongs to t - delay_s."""
        return sum(effect.pure_delay_s() for effect in self.effects)

    @property
    def clock_ratio(self):
        """Time that passes while the stamps advance by one second."""
        return float(np.prod([effect.clock_ratio() for effect in self.effects]))

    @property
    def time_steps(self):
        """Pairs of instant and jump of the stamps [s], in the order of time."""
        return tuple(sorted(step for effect in self.effects for step in effect.time_steps()))

    @property
    def limits(self):
        """Lowest and highest value that can come out."""
        low, high = -np.inf, np.inf
        for effect in self.effects:
            if np.isfinite([low, high]).any():
                # what stands behind the limits, such as a rounding, moves them
                low, high = effect.simulate(np.array([low, high]), Circumstances.at_rest(2))
            lower, upper = effect.limits()
            low, high = max(low, lower), min(high, upper)
        return low, high

    @property
    def dynamics(self):
        """The core and the linear links around it, without pure delays."""
        return (self.effective_core, *(effect for effect in self.effects if is_link(effect)))

    def transfer_function(self, s):
        """Composite linear response without its pure delay, at complex `s` [rad/s]."""
        s = np.asarray(s, complex)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.prod([link.transfer_function(s) for link in self.dynamics], axis=0)

    def poles(self):
        """Poles of the composite response [rad/s]."""
        return np.concatenate([link.poles() for link in self.dynamics])

    def zeros(self):
        """Zeros of the composite response [rad/s]."""
        return np.concatenate([link.zeros() for link in self.dynamics])


class SensorModel:
    """How a three-axis accelerometer turns acceleration into its output.

    Parameters
    ----------
    core : Oscillator, Gain, Arx or FractionalTransferFunction
        Core of all three axes.
    effects : iterable of Effect
        Effects on all three axes.
    axes : dict of str to AxisModel, optional
        Models of the axes ``"x"``, ``"y"``, ``"z"`` that differ.
    metadata : dict, optional
        Further keys of the file, such as uncertainties and provenance.
    reference_faults : iterable of Effect
        What happened to the recorded reference alone: of the record, not of the sensor, so that
        neither simulation nor correction knows of it.

    Raises
    ------
    ModelError
        Naming the field, its value and what was expected.

    Examples
    --------
    >>> import frac_accel
    >>> model = frac_accel.SensorModel.load("bags/soft_mount.yaml")
    >>> model
    <SensorModel: Oscillator, no effects>
    >>> round(float(abs(model.frequency_response([10.0], "x"))[0]), 2)
    0.99
    """

    def __init__(self, core, effects=(), axes=None, metadata=None, reference_faults=()):
        self.metadata = dict(metadata or {})
        self.reference_faults = _in_signal_order(reference_faults)
        for fault in self.reference_faults:
            if not fault.of_reference:
                raise ModelError(f"reference_faults: {fault.cause} given, which is an effect of "
                                 "the sensor, expected under effects")
        self._common = AxisModel(core, _in_signal_order(effects))
        self._own = {name: AxisModel(axis.core, _in_signal_order(axis.effects))
                     for name, axis in (axes or {}).items()}
        self.axes = tuple(self._own.get(name, self._common) for name in AXES)
        self._stages = _sample_stages(self.axes)
        for name, axis in zip(AXES, self.axes):
            for effect in axis.effects:
                if effect.of_reference:
                    raise ModelError(f"effects: {effect.cause} given, which is a fault of the "
                                     "reference, expected under reference_faults")
                if not effect.acts_on(axis.core):
                    wanted = "a gain" if isinstance(axis.core, Oscillator) else "an oscillator"
                    raise ModelError(f"effects: {effect.cause} given with a core of type "
                                     f"{axis.core.type}, expected {wanted}")
            axis.effective_core.require_stable(f"axes.{name}.core" if name in self._own else "core")

    def __repr__(self):
        kinds = dict.fromkeys(
            f"{type(axis.core).__name__}, "
            + (", ".join(effect.cause for effect in axis.effects) or "no effects")
            for axis in self.axes)
        return f"<SensorModel: {'; '.join(kinds)}>"

    @property
    def core(self):
        """Core of the axes that have no model of their own."""
        return self._common.core

    @property
    def effects(self):
        """Effects on the axes that have no model of their own."""
        return self._common.effects

    def axis(self, axis):
        """AxisModel of ``"x"``, ``"y"``, ``"z"`` or 0, 1, 2."""
        return self.axes[AXES.index(axis) if isinstance(axis, str) else axis]

    @functools.cached_property
    def turns(self):
        """Whether the sensor's axes are not the reference's."""
        return not np.array_equal(self._turn, np.eye(3))

    @functools.cached_property
    def _turn(self):
        return np.stack([axis.base_shares(i) for i, axis in enumerate(self.axes)])

    @functools.cached_property
    def _turn_back(self):
        # where one axis was diagnosed alone, and is another one, that one is not known twice
        known = abs(np.linalg.det(self._turn)) > 1e-3
        return np.linalg.inv(self._turn) if known else np.eye(3)

    def along_sensor(self, values):
        """Acceleration along the sensor's axes from that along the reference's, shape (n, 3)."""
        return mix(values, self._turn) if self.turns else values

    def along_reference(self, values, variance):
        """Acceleration and its variance along the reference's axes from those along the sensor's,
        shape (n, 3)."""
        if not self.turns:
            return values, variance
        return mix(values, self._turn_back), mix(variance, self._turn_back**2)

    @functools.cached_property
    def needs_temperature(self):
        """Whether an effect of some axis depends on the temperature."""
        return any(effect.needs_temperature for axis in self.axes for effect in axis.effects)

    @functools.cached_property
    def of_one_record(self):
        """Sentence on the causes that are of one record alone; empty where there is none."""
        causes = sorted({effect.cause for axis in self.axes for effect in axis.effects
                         if effect.counts_from_start})
        it = "them" if len(causes) > 1 else "it"
        return (f"{', '.join(causes)}: the time counts from the first sample; for another record "
                f"than the one in which it was found, take {it} out of the model" if causes else "")

    @property
    def noise_std(self):
        """Standard deviation of the sensor's white noise [output units]; 0 where not known."""
        return float(self.metadata.get("noise_std", 0.0))

    @property
    def model_error(self):
        """RMS of what the model leaves beyond white noise, relative to the output's; 0 where not
        known."""
        return float(self.metadata.get("model_error", 0.0))

    @property
    def plausible_range(self):
        """Lowest and highest output that can be true, or None where the model does not say."""
        pair = self.metadata.get("plausible_range")
        return pair and tuple(float(edge) for edge in pair)

    @property
    def band_hz(self):
        """Lowest and highest frequency [Hz] for which the model was identified, or None."""
        return self.metadata.get("band_hz")

    def frequency_response(self, frequency_hz, axis="x"):
        """Exact complex frequency response, pure delay included.

        Parameters
        ----------
        frequency_hz : array_like
            Frequencies [Hz], any shape.
        axis : str or int

        Returns
        -------
        ndarray of complex
            Output units per m/s², same shape. Offset and cross-axis terms have no part in it.
        """
        s = 2j * np.pi * np.asarray(frequency_hz, float)
        model = self.axis(axis)
        return model.transfer_function(s) * np.exp(-s * model.delay_s)

    def live_simulation(self, sampling_rate_hz):
        """Effects that act on the samples after the core and its links, on one stream.

        Returns
        -------
        callable
            (values, circumstances) -> values, of shape (n, 3), for consecutive blocks.
        """
        return functools.partial(_applied, self._live_stages(sampling_rate_hz))

    def live_inverse(self, sampling_rate_hz):
        """Inverse of `live_simulation`.

        Returns
        -------
        callable
            (values, variance, circumstances) -> (values, variance), all (n, 3), with the variance
            of the samples' noise (0 where it is not known), for consecutive blocks.
        """
        return functools.partial(_removed, self._live_stages(sampling_rate_hz))

    def without_sample_effects(self, values, circumstances):
        """Samples (n, 3) before the effects on them, sample by sample: no stream is remembered."""
        return _removed(self._stages, values, np.zeros_like(values), circumstances)[0]

    def _live_stages(self, sampling_rate_hz):
        return [(cause, {axis: effect.live(sampling_rate_hz) for axis, effect in by_axis.items()})
                for cause, by_axis in self._stages]

    @functools.cached_property
    def limits(self):
        """Lowest and highest value that each axis can say, shape (3,) each."""
        return tuple(np.array([axis.limits for axis in self.axes]).T)

    @classmethod
    def from_dict(cls, data, where=""):
        """Model from the content of a model file.

        Parameters
        ----------
        data : dict
        where : str
            Name of the file, for messages.

        Raises
        ------
        ModelError
            Naming the field, its value and what was expected.
        """
        try:
            return cls._from_dict(data)
        except ModelError as error:
            raise ModelError(f"{where}: {error}" if where else str(error)) from None

    @classmethod
    def _from_dict(cls, data):
        _require_schema(data)
        _require_known_keys(data)
        core = _core(data["core"], "core") if "core" in data else None
        effects = _effects(data.get("effects"), "effects")
        axes = {}
        for name, entry in _require_mapping(data.get("axes") or {}, "axes").items():
            where = f"axes.{name}"
            if name not in tuple(AXES):
                raise ModelError(f"{where}: no such axis, expected x, y or z")
            _require_mapping(entry, where)
            for key in entry:
                if key not in ("core", "effects"):
                    raise ModelError(f"{where}.{key}: no such key, expected core or effects")
            axis_core = _core(entry["core"], f"{where}.core") if "core" in entry else core
            axis_effects = (_effects(entry["effects"], f"{where}.effects")
                            if "effects" in entry else effects)
            if axis_core is None:
                raise ModelError(f"{where}.core: missing, and there is no core for all axes")
            axes[name] = AxisModel(axis_core, axis_effects)
        if core is None:
            if set(axes) != set(AXES):
                raise ModelError("core: missing, expected a mapping such as {natural_frequency_hz: "
                                 "180.0, damping_ratio: 0.15}")
            core = axes["x"].core
        for name in ("noise_std", "model_error"):
            if name in data and number(data[name], name) < 0:
                raise ModelError(f"{name}: {data[name]!s:.60} given, expected at least 0")
        if "band_hz" in data:
            _require_band(data["band_hz"])
        if "plausible_range" in data:
            _require_pair(data["plausible_range"], "plausible_range",
                          "two numbers in output units, ascending", -np.inf)
        metadata = {key: plain(data[key]) for key in data if key not in _OWN_KEYS}
        faults = _effects(data.get("reference_faults"), "reference_faults")
        return cls(core, effects, axes, metadata, faults)

    def to_dict(self):
        """Content of the model file; inverse of `from_dict`."""
        data = {"schema": SCHEMA, **_axis_to_dict(self._common)}
        if self._own:
            data["axes"] = {name: _axis_to_dict(axis) for name, axis in self._own.items()}
        if self.reference_faults:
            data["reference_faults"] = _as_list(self.reference_faults)
        return plain({**data, **self.metadata})

    @classmethod
    def load(cls, path):
        """Model from a YAML file.

        Raises
        ------
        ModelError
            Naming the file, the field, its value and what was expected.
        """
        return cls.load_with_hash(path)[0]

    @classmethod
    def load_with_hash(cls, path):
        """Model from a YAML file, and the SHA-256 of what was read; raises as `load`."""
        data = _read(path)
        try:
            text = data.decode()
        except UnicodeDecodeError:
            raise ModelError(f"{path}: cannot read the model: not a text file") from None
        try:
            content = safe_yaml.load(text)
        except safe_yaml.YamlError as error:
            is_quoted = not error.quotes or _says_it_is_a_model(text)
            problem = f": {error.problem}" if is_quoted else ""
            raise ModelError(f"{path}{error.where}: not valid YAML{problem}") from None
        try:
            return cls.from_dict(content, where=str(path)), hashlib.sha256(data).hexdigest()
        except ModelError:
            raise
        except Exception as error:  # whatever stands in a file, it is a refusal
            raise ModelError(f"{path}: cannot be understood as a sensor model: "
                             f"{type(error).__name__}") from error

    def save(self, path):
        """Write the model as YAML; the file is complete or not there."""
        text = yaml.safe_dump(self.to_dict(), sort_keys=False, allow_unicode=True)
        try:
            write_text(path, text)
        except OSError as error:
            raise ModelError(f"{path}: cannot write the model: {error.strerror}") from None


def _applied(stages, values, circumstances):
    for cause, by_axis in stages:
        values = cause.simulate_axes(values, by_axis, circumstances)
    return values


def _require_schema(data):
    """Nothing of other files is quoted: they may be secret, and who asks may be far away."""
    if not isinstance(data, dict):
        kind = "nothing" if data is None else f"a {type(data).__name__}"
        raise ModelError(f"model: {kind} given, expected a mapping")
    schema = data.get("schema")
    if schema != SCHEMA:
        given = (repr(schema) if re.fullmatch(_ANY_SCHEMA, str(schema)) else
                 "something else" if "schema" in data else "nothing")
        raise ModelError(f"schema: {given} given, expected {SCHEMA!r}")


def _says_it_is_a_model(text):
    """Whether a line of the text says so, as far as can be said where YAML is not read."""
    return re.search(rf"""^schema:\s*['"]?{_ANY_SCHEMA}\b""", text, re.M) is not None


def _read(path):
    """Bytes of a model file."""
    try:
        with open_regular(path) as file:
            data = file.read(_LARGEST_FILE + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise ModelError(f"{path}: cannot read the model: {reason}") from None
    if len(data) > _LARGEST_FILE:
        raise ModelError(f"{path}: larger than {_LARGEST_FILE // 1024} KB, expected a sensor model")
    return data


def _removed(stages, values, variance, circumstances):
    for cause, by_axis in reversed(stages):
        values, variance = cause.invert_axes(values, variance, by_axis, circumstances)
    return values, variance


def _sample_stages(axes):
    """Pairs of effect class and its instances by axis index, in signal order."""
    stages = {}
    for index, axis in enumerate(axes):
        for effect in axis.effects:
            stages.setdefault((effect.stage, effect.cause), {})[index] = effect
    return [(type(next(iter(by_axis.values()))), by_axis)
            for _, by_axis in sorted(stages.items(), key=lambda item: item[0])]


def is_link(effect):
    """Whether an effect is a linear link (the base class's response is one throughout)."""
    return type(effect).transfer_function is not Effect.transfer_function


def _in_signal_order(effects):
    effects = tuple(sorted(effects, key=lambda effect: (effect.stage, effect.cause)))
    causes = [effect.cause for effect in effects]
    for cause in causes:
        if causes.count(cause) > 1:
            raise ModelError(f"effects: {cause} given {causes.count(cause)} times, expected once")
    return effects


def _require_mapping(value, where):
    if not isinstance(value, dict):
        kind = "nothing" if value is None else f"{value!r:.60}"
        raise ModelError(f"{where}: {kind} given, expected a mapping")
    return value


def _require_known_keys(data):
    """A further key is kept; one that looks like a misspelt key of ours is refused."""
    for key in data:
        if not isinstance(key, str):
            raise ModelError(f"model: the key {key!r} given, expected text")
        close = difflib.get_close_matches(key, _OWN_KEYS, n=1, cutoff=0.75)
        if close and key not in _OWN_KEYS:
            raise ModelError(f"{key}: no such key; did you mean {close[0]!r}?")


def _require_band(band):
    _require_pair(band, "band_hz", "two numbers in Hz, at least 0 and ascending", 0.0)


def _require_pair(pair, where, expected, least):
    if not isinstance(pair, list) or len(pair) != 2:
        raise ModelError(f"{where}: {pair!r:.60} given, expected {expected}")
    low, high = (number(edge, f"{where}[{i}]", expected) for i, edge in enumerate(pair))
    if not least <= low < high:
        raise ModelError(f"{where}: {pair!r:.60} given, expected {expected}")


def _core(entry, where):
    entry = dict(_require_mapping(entry, where))
    kind = entry.pop("type", "oscillator")
    if not isinstance(kind, str) or kind not in CORES:
        raise ModelError(f"{where}.type: {kind!r:.60} given, expected one of {', '.join(CORES)}")
    if CORES[kind] is not Arx:
        for field in parameter_fields(Arx):
            if field.name in entry:
                raise ModelError(f"{where}.{field.name}: given for a core of type {kind}, but it "
                                 "belongs to a transfer function in z: expected type: arx; "
                                 "coefficients in z have no place in an equation in s")
    try:
        return build(CORES[kind], entry, where)
    except ModelError as error:
        # a core's own check knows its fields, not where in the file it stands
        text = str(error)
        raise ModelError(text if text.startswith(where) else
                         where + text.removeprefix("core")) from None


def _effects(entries, where):
    if entries is None:
        return ()
    if not isinstance(entries, list):
        raise ModelError(f"{where}: {entries!r:.60} given, expected a list of effects")
    effects = []
    for i, entry in enumerate(entries):
        place = f"{where}[{i}]"
        entry = dict(_require_mapping(entry, place))
        cause = entry.pop("cause", None)
        known = effect_names()
        if not isinstance(cause, str) or cause not in known:
            close = difflib.get_close_matches(str(cause), known, n=1)
            expected = f"did you mean {close[0]!r}?" if close else \
                f"expected one of the {len(known)} of docs/effects.md, such as {known[0]}"
            raise ModelError(f"{place}.cause: unknown cause {cause!r:.60}; {expected}")
        try:
            effect = effect_of(cause)
        except ModelError as error:
            raise ModelError(f"{place}.cause: {error}") from None
        effects.append(build(effect, entry, place))
    return tuple(effects)


def _axis_to_dict(axis):
    core = {"type": axis.core.type, **as_mapping(axis.core)}
    return {"core": core, "effects": _as_list(axis.effects)}


def _as_list(effects):
    return [{"cause": effect.cause, **as_mapping(effect)} for effect in effects]
