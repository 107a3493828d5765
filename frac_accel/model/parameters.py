"""Declaring and checking the parameters of cores and effects, as they stand in a model file."""

import dataclasses
import difflib
import math

import numpy as np

from ..errors import ModelError

_OUTPUT = "output units"


def parameter(unit, *, above=None, minimum=None, below=None, maximum=None, default=None,
              null=None, scale=None, reach=None, step=None, whole=False, fixed=False, jumps=False):
    """Declare a number of a core or an effect.

    Parameters
    ----------
    unit : str
        Unit as a user reads it; ``"1"`` for a pure number.
    above, minimum, below, maximum : float, optional
        Range that the value must lie in (exclusive, inclusive, exclusive, inclusive).
    default : float, optional
        Value where the file gives none; without it the parameter is required.
    null : float or "core", optional
        Value with which the cause changes nothing, or that of the same parameter of the core.
    scale : float, str or tuple, optional
        What a fit takes for a change of one: a number, the name of one of `Scales`, or a factor and
        that name. Default: the value that the fit begins with.
    reach : tuple, optional
        Smallest and largest value that a diagnosis looks for, times `scale` where that is a name.
        Default: 1e-9 to 1e9 times the scale for a parameter above 0, otherwise the range.
    step : float, optional
        Change for a numerical derivative, relative for a parameter above 0, otherwise in scales.
        Default 1e-3.
    whole : bool
        Whether it counts something; no fit varies it (`Effect.alternatives` offers others).
    fixed : bool
        Whether no fit varies it although it counts nothing.
    jumps : bool
        True where the output does not change smoothly, such as for the instant of a step: its
        derivative is then the mean slope from `step` below to `step` above.
    """
    metadata = {"unit": unit, "above": above, "minimum": minimum, "below": below,
                "maximum": maximum, "null": null, "scale": scale, "reach": reach, "step": step,
                "whole": whole, "fixed": fixed, "jumps": jumps}
    if default is None:
        return dataclasses.field(metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


@dataclasses.dataclass(frozen=True)
class Scales:
    """What is small or large in a record.

    Attributes
    ----------
    level : float
        Standard deviation of the sensor's output [output units].
    rate : float
        Sampling rate [Hz].
    duration : float
        Of the record [s].
    """

    level: float
    rate: float
    duration: float

    per_level = property(lambda self: 1 / self.level)
    per_level_squared = property(lambda self: 1 / self.level**2)
    interval = property(lambda self: 1 / self.rate)
    per_duration = property(lambda self: 1 / self.duration)
    level_per_duration = property(lambda self: self.level / self.duration)

    def of(self, field, value):
        """Change of the parameter of a dataclass field that counts as one, near a value."""
        scale = field.metadata["scale"]
        factor, name = scale if isinstance(scale, tuple) else (1.0, scale)
        if isinstance(name, str):
            return factor * getattr(self, name)
        return name if name is not None else abs(value) or 1.0

    def reach(self, field, scale):
        """Smallest and largest value of a parameter that a diagnosis looks for."""
        low, high = field.metadata["reach"] or (1e-9, 1e9)
        unit = scale if field.metadata["reach"] is None \
            or isinstance(field.metadata["scale"], str) else 1.0
        return low * unit, high * unit


def coefficients(unit="", default=None):
    """Declare a list of numbers of a core or an effect, all of one unit."""
    metadata = {"list": True, "unit": unit}
    if default is None:
        return dataclasses.field(metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


def choice(*words, default=dataclasses.MISSING):
    """Declare a word of an effect, one of those given; no fit varies it."""
    return dataclasses.field(default=default, metadata={"choices": words, "unit": "1"})


def is_varied(field):
    """Whether a fit can vary a parameter: a number that counts nothing and is not fixed."""
    return not any(field.metadata.get(key) for key in ("list", "choices", "whole", "fixed"))


def is_needed_list(field):
    """Whether a parameter is a list that must be given, which nobody can draw."""
    return bool(field.metadata.get("list")) and field.default is dataclasses.MISSING


def fixed_values(instance):
    """Values by name of what no fit varies: counts and words."""
    return {field.name: getattr(instance, field.name) for field in parameter_fields(type(instance))
            if not is_varied(field) and not field.metadata.get("list")}


def parameter_fields(cls):
    """Fields of `cls` that stand in a model file."""
    return [field for field in dataclasses.fields(cls) if field.metadata]


def unit_of(cls, name):
    """Unit of one parameter of `cls`."""
    return next(f.metadata["unit"] for f in parameter_fields(cls) if f.name == name)


def unit_power(field):
    """Power with which a parameter grows with the output, by its unit: 1 for "output units/s"."""
    unit = field.metadata.get("unit", "")
    below, above = unit.rpartition("/")[2], unit.partition("/")[0]
    if _OUTPUT in below and above != unit:
        return -2 if below.endswith("^2") else -1
    return 1 if _OUTPUT in above else 0


def rescaled(instance, factor):
    """The same where the output that it acts on is so many times as large."""
    changed = {}
    for field in parameter_fields(type(instance)):
        if unit_power(field):
            value, scale = getattr(instance, field.name), factor**unit_power(field)
            changed[field.name] = tuple(scale * each for each in value) \
                if isinstance(value, tuple) else scale * value
    return dataclasses.replace(instance, **changed)


def build(cls, mapping, where):
    """Make `cls` from the mapping of a model file.

    Raises
    ------
    ModelError
        Naming the field, its value and what was expected.
    """
    fields = {field.name: field for field in parameter_fields(cls)}
    for key in mapping:
        if key not in fields:
            close = difflib.get_close_matches(str(key), fields, n=1)
            hint = f"; did you mean {close[0]!r}?" if close else ""
            raise ModelError(
                f"{where}.{key}: no such parameter, expected {', '.join(fields) or 'none'}{hint}")
    values = {}
    for name, field in fields.items():
        path = f"{where}.{name}"
        if name not in mapping:
            if field.default is dataclasses.MISSING:
                raise ModelError(f"{path}: missing, expected {expectation(field)}")
        elif field.metadata.get("list"):
            values[name] = _numbers(mapping[name], path)
        elif field.metadata.get("choices"):
            values[name] = _word(mapping[name], field, path)
        else:
            value = _in_range(number(mapping[name], path, expectation(field)), field, path)
            values[name] = int(value) if field.metadata["whole"] else value
    return cls(**values)


def as_mapping(instance):
    """Inverse of `build`: plain numbers and lists, without such as are not needed and empty."""
    return {field.name: list(value) if isinstance(value, tuple) else value
            for field in parameter_fields(type(instance))
            for value in [getattr(instance, field.name)]
            if not (isinstance(value, tuple) and not value) or is_needed_list(field)}


def expectation(field):
    """What a parameter may be, in words."""
    if field.metadata.get("list"):
        return "a list of numbers"
    if field.metadata.get("choices"):
        return " or ".join(field.metadata["choices"])
    limits = [f"{word} {field.metadata[key]:g}" for key, word in
              (("above", "above"), ("minimum", "at least"), ("below", "below"),
               ("maximum", "at most"))
              if field.metadata[key] is not None]
    unit = field.metadata["unit"]
    kind = "a whole number" if field.metadata["whole"] else "a number"
    words = kind if unit == "1" else f"{kind} in {unit}"
    return " ".join([words, " and ".join(limits)]).strip()


def number(value, where, expected="a number"):
    """Return `value` as a finite float.

    YAML 1.1 reads ``1e-3`` as text, so text that is a number is accepted.
    """
    if isinstance(value, (int, float, str)) and not isinstance(value, bool):
        try:
            result = float(value)
        except (ValueError, OverflowError):
            result = math.nan
        if math.isfinite(result):
            return result
    raise ModelError(f"{where}: {value!r:.60} given, expected {expected}")


def _in_range(value, field, where):
    limits = field.metadata
    if ((limits["above"] is not None and value <= limits["above"])
            or (limits["minimum"] is not None and value < limits["minimum"])
            or (limits["below"] is not None and value >= limits["below"])
            or (limits["maximum"] is not None and value > limits["maximum"])
            or (limits["whole"] and value != int(value))):
        raise ModelError(f"{where}: {value:g} given, expected {expectation(field)}")
    return value


def _word(value, field, where):
    words = field.metadata["choices"]
    if value in words:
        return value
    close = difflib.get_close_matches(str(value), words, n=1)
    hint = f"; did you mean {close[0]!r}?" if close else ""
    raise ModelError(f"{where}: {value!r:.60} given, expected {expectation(field)}{hint}")


def _numbers(value, where):
    if not isinstance(value, (list, tuple)) or not value:
        raise ModelError(f"{where}: {value!r:.60} given, expected a list of numbers")
    return tuple(number(item, f"{where}[{i}]") for i, item in enumerate(value))


def plain(value):
    """A copy of nested dicts and lists with Python's own numbers, as YAML and JSON need them."""
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    return value.tolist() if hasattr(value, "tolist") else value


def rebuilt(cls, data):
    """Object of a flat dataclass from what `plain` made of its fields; other keys do not count.

    Null stands for numbers that are none.

    Raises
    ------
    KeyError, TypeError, ValueError
        Where a field is missing or of another form.
    """
    return cls(**{field.name: _as_declared(field.type, data[field.name])
                  for field in dataclasses.fields(cls)})


def _as_declared(kind, value):
    if kind is float:
        return math.nan if value is None else float(value)
    if kind is np.ndarray:
        array = np.array(value)
        return array if array.dtype != object else np.array(value, float)
    return tuple(value) if kind is tuple else value
