"""Declaring and checking the parameters of cores and effects, as they stand in a model file."""

import dataclasses
import difflib
import math

from .errors import ModelError


def parameter(unit, *, above=None, minimum=None, below=None, maximum=None, default=None):
    """Declare a number of a core or an effect.

    Parameters
    ----------
    unit : str
        Unit as a user reads it; ``"1"`` for a pure number.
    above, minimum, below, maximum : float, optional
        Range that the value must lie in (exclusive, inclusive, exclusive, inclusive).
    default : float, optional
        Value where the file gives none; without it the parameter is required.
    """
    metadata = {"unit": unit, "above": above, "minimum": minimum, "below": below,
                "maximum": maximum}
    if default is None:
        return dataclasses.field(metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


def coefficients():
    """Declare a list of numbers of a core."""
    return dataclasses.field(metadata={"list": True})


def parameter_fields(cls):
    """Fields of `cls` that stand in a model file."""
    return [field for field in dataclasses.fields(cls) if field.metadata]


def unit_of(cls, name):
    """Unit of one parameter of `cls`."""
    return next(f.metadata["unit"] for f in parameter_fields(cls) if f.name == name)


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
        else:
            values[name] = _in_range(number(mapping[name], path, expectation(field)), field, path)
    return cls(**values)


def as_mapping(instance):
    """Inverse of `build`: plain numbers and lists."""
    return {field.name: list(value) if isinstance(value, tuple) else value
            for field in parameter_fields(type(instance))
            for value in [getattr(instance, field.name)]}


def expectation(field):
    """What a parameter may be, in words."""
    if field.metadata.get("list"):
        return "a list of numbers"
    limits = [f"{word} {field.metadata[key]:g}" for key, word in
              (("above", "above"), ("minimum", "at least"), ("below", "below"),
               ("maximum", "at most"))
              if field.metadata[key] is not None]
    unit = field.metadata["unit"]
    words = "a number" if unit == "1" else f"a number in {unit}"
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
    raise ModelError(f"{where}: {value!r} given, expected {expected}")


def _in_range(value, field, where):
    limits = field.metadata
    if ((limits["above"] is not None and value <= limits["above"])
            or (limits["minimum"] is not None and value < limits["minimum"])
            or (limits["below"] is not None and value >= limits["below"])
            or (limits["maximum"] is not None and value > limits["maximum"])):
        raise ModelError(f"{where}: {value:g} given, expected {expectation(field)}")
    return value


def _numbers(value, where):
    if not isinstance(value, (list, tuple)) or not value:
        raise ModelError(f"{where}: {value!r} given, expected a list of numbers")
    return tuple(number(item, f"{where}[{i}]") for i, item in enumerate(value))


def plain(value):
    """A copy of nested dicts and lists with Python's own numbers, as YAML and JSON need them."""
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    return value.tolist() if hasattr(value, "tolist") else value
