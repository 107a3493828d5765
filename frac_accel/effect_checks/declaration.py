"""What a cause declares: parameters, sentences, documentation, starts; and its way through YAML."""

import dataclasses
import math
import re
from pathlib import Path

import numpy as np
import yaml

from ..errors import FracAccelError
from ..model import AXES, SensorModel
from ..model.effects import effect_names, effect_of
from ..model.effects.base import REFERENCE, STAMPS, Effect
from ..model.effects.fit_starts import Start
from ..model.parameters import (
    Scales,
    as_mapping,
    build,
    is_needed_list,
    is_varied,
    parameter_fields,
    plain,
)
from .draws import CORE, RATE, Broken, core_for, sensor_with, span, words

_TABLE = Path(__file__).parents[2] / "docs" / "effects.md"
_KINDS = ("free", "positive", "finite", "weak", "whole")
_DRAWS = 5


def declares(cls, draws):
    """A frozen dataclass of `Effect` with a name, a place, sentences, and complete parameters."""
    if not (isinstance(cls, type) and issubclass(cls, Effect)):
        raise Broken("no subclass of frac_accel.Effect")
    if not dataclasses.is_dataclass(cls) or not cls.__dataclass_params__.frozen:
        raise Broken("no frozen dataclass: put @dataclasses.dataclass(frozen=True) before it")
    if not re.fullmatch(r"[a-z][a-z0-9_]*", str(getattr(cls, "cause", ""))):
        raise Broken("`cause` is no name in small letters and underscores")
    if getattr(cls, "stage", None) not in range(REFERENCE, STAMPS + 1):
        raise Broken("`stage` is none of the places in the signal's way (frac_accel.effects.base)")
    for name in ("explanation", "experiment"):
        if not str(getattr(cls, name, "")).endswith("."):
            raise Broken(f"`{name}` is no sentence that ends with a full stop")
    for field in dataclasses.fields(cls):
        if not field.metadata:
            raise Broken(f"`{field.name}` is not declared with `parameter`")
        if is_varied(field):
            _complete(field)
    varied = [field for field in parameter_fields(cls) if is_varied(field)]
    if not cls.read_off and varied and all(f.metadata["null"] is None for f in varied):
        raise Broken("no parameter declares `null`, the value with which it changes nothing")
    names = {field.name for field in parameter_fields(cls)}
    for axis in AXES:
        for excited in (True, False):
            fitted = cls.fitted_parameters(axis, dict.fromkeys(AXES, excited))
            if not set(fitted) <= names:
                raise Broken(f"`fitted_parameters` names {sorted(set(fitted) - names)}, which it "
                             "does not have")


def _complete(field):
    """Check what one parameter declares of itself."""
    limits, name = field.metadata, field.name
    if not limits["unit"] or not isinstance(limits["unit"], str):
        raise Broken(f"{name}: no `unit` (\"1\" for a pure number)")
    scale = limits["scale"]
    factor, of = scale if isinstance(scale, tuple) else (1.0, scale)
    if isinstance(of, str) and not hasattr(Scales(1.0, 1.0, 1.0), of):
        raise Broken(f"{name}: `scale` {of!r} is no name of frac_accel.model.parameters.Scales")
    if not factor > 0 or (isinstance(of, (int, float)) and not of > 0):
        raise Broken(f"{name}: `scale` {scale!r}, expected above 0")
    if limits["step"] is not None and not limits["step"] > 0:
        raise Broken(f"{name}: `step` {limits['step']!r}, expected above 0")
    low, high = span(field)
    if not low < high:
        raise Broken(f"{name}: no value lies within its bounds and its `reach`")
    null, default = limits["null"], field.default
    if null == "core":
        if not hasattr(CORE, name):
            raise Broken(f"{name}: `null` is \"core\", but an oscillator has no {name}")
    elif null is not None:
        ends = [limits[key] for key in ("above", "minimum", "below", "maximum")]
        below = [end for end in ends[:2] if end is not None]
        above = [end for end in ends[2:] if end is not None]
        # the end itself may be an open one: no effect is then what the parameter tends to
        if any(null < end for end in below) or any(null > end for end in above) \
                or math.isnan(null):
            raise Broken(f"{name}: `null` {null!r} lies beyond its bounds")
    if default is not dataclasses.MISSING and not (math.isfinite(default)):
        raise Broken(f"{name}: default {default!r}, expected a finite number")


def row(cls):
    """The cause's row in the table of docs/effects.md."""
    parameters = ", ".join(f"`{field.name}`{_kind(field)}" for field in parameter_fields(cls))
    return f"| `{cls.cause}` | {parameters} | {cls.explanation} |"


def _kind(field):
    """Unit or choice of a parameter, in brackets."""
    limits = field.metadata
    if limits.get("choices"):
        return f" ({', '.join(limits['choices'])})"
    if limits.get("whole"):
        return f" ({limits['minimum']} to {limits['maximum']})"
    return "" if limits.get("unit", "1") == "1" else f" [{limits['unit']}]"


def documents(cls, draws):
    """A docstring of its own; a built-in cause also has its row in docs/effects.md."""
    written = cls.__dict__.get("__doc__") or ""
    # what a dataclass writes where there is none
    if not written or written.startswith(f"{cls.__name__}("):
        raise Broken("the class has no docstring")
    # what is no cause by itself is described below the table
    if cls.__module__.startswith("frac_accel.model.effects.") and _TABLE.exists() \
            and not any(map(is_needed_list, parameter_fields(cls))) \
            and row(cls) not in _TABLE.read_text(encoding="utf-8").splitlines():
        raise Broken(f"docs/effects.md lacks its row: {row(cls)}")


def survives_yaml(cls, draws):
    """Parameters are the same after they were written to a model file and read."""
    if any(map(is_needed_list, parameter_fields(cls))):
        return  # nobody can draw its coefficients
    registered = cls.cause in effect_names()
    if registered and effect_of(cls.cause) is not cls:
        raise Broken(f"another class, {effect_of(cls.cause).__qualname__}, has this cause's name")
    for _ in range(_DRAWS):
        effect = draws.any(cls)
        if registered:
            place = "reference_faults" if cls.of_reference else "effects"
            text = yaml.safe_dump(SensorModel(core_for(effect), **{place: [effect]}).to_dict())
            again = getattr(SensorModel.from_dict(yaml.safe_load(text)), place)[0]
        else:
            again = build(cls, yaml.safe_load(yaml.safe_dump(plain(as_mapping(effect)))), cls.cause)
        if again != effect:
            raise Broken(f"read back from YAML as {words(again)}, written as {words(effect)}")


def starts_within_bounds(cls, draws):
    """A fit begins, whatever the record holds, with effects of this class that are allowed."""
    if cls.read_off and cls.starts.__func__ is Effect.starts.__func__:
        return
    from ..diagnosis.search import View
    from ..simulation import simulate
    n = 1024
    reference = draws.motion(n)
    temperature = draws.circumstances(n).temperature_c
    simulated = simulate(sensor_with(), reference, RATE)[:, 0]
    for effect in (None, draws.usual(cls), draws.usual(cls)):
        measured = simulated
        if effect is not None and not cls.of_reference:
            try:
                measured = simulate(sensor_with(effect), reference, RATE,
                                    temperature_c=temperature)[:, 0]
            except FracAccelError:
                continue
        measured = measured + 1e-3 * draws.rng.normal(size=n)
        view = View(rate=RATE, time=np.arange(n) / RATE, measured=measured, simulated=simulated,
                    residual=measured - simulated, used=np.ones(n, bool), core=CORE,
                    since_start_s=0.0, delay_s=0.0, level=float(np.std(measured)), warms=True,
                    excited=dict.fromkeys(AXES, True), axis="x")
        starts = cls.starts(view)
        if cls.read_off and starts:
            raise Broken("it is read off a record, but has start points, too")
        for start in starts:
            _require_start(cls, start)


def _require_start(cls, start):
    if not isinstance(start, Start) or start.kind not in _KINDS:
        raise Broken(f"`starts` gives {start!r:.80}, expected those of "
                     "frac_accel.model.effects.fit_starts")
    if start.parameter is not None and not hasattr(start.effect, start.parameter):
        raise Broken(f"a start scales {start.parameter!r}, which the effect does not have")
    if not start.columns:
        raise Broken("a start has no columns")
    for effect in (start.effect, *start.columns):
        if type(effect) is not cls:
            raise Broken(f"a start is a {type(effect).__name__}, expected {cls.__name__}")
        try:
            build(cls, as_mapping(effect), "a start: ")
        except FracAccelError as error:
            raise Broken(str(error)) from None
