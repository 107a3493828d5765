"""A diagnosis from its result file."""

import math

from ..errors import FracAccelError, ModelError
from ..model import SensorModel
from ..model.effects import effect_of
from ..model.parameters import build, parameter_fields
from ..record.topic import Integrity
from .evidence import Evidence
from .finding import Diagnosis, Finding
from .gain import Gain

_MOST_WORDS = 200


def diagnosis_from(data):
    """`Diagnosis` of what `Diagnosis.as_dict` gave; null stands for numbers that are none.

    Raises
    ------
    FracAccelError
        If it is no result of a diagnosis, or names a cause that is not installed.
    """
    if not isinstance(data, dict) or not {"verdict", "evidence", "data"} <= data.keys():
        raise FracAccelError("no result of a diagnosis that holds its evidence, expected what "
                             "frac_accel diagnose --json writes")
    try:
        return _diagnosis(data)
    except ModelError:
        raise
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise FracAccelError("no complete result of a diagnosis: "
                             f"{type(error).__name__}: {str(error)[:_MOST_WORDS]}") from None


def _diagnosis(data):
    evidence = data["evidence"] and Evidence.from_dict(data["evidence"])
    model = data["sensor_model"] and SensorModel.from_dict(data["sensor_model"])
    known = {effect.cause: effect for effect in
             (*model.axis(evidence.axis).effects, *model.reference_faults)} if evidence else {}
    return Diagnosis(
        data["verdict"], data["reason"], _numbers(data["baseline"]),
        [_finding(entry, known) for entry in data["findings"]], data["suspects"],
        _numbers({key: data["extended"][key] for key in ("rmse", "nrmse")}),
        _number(data["unexplained_fraction"]), model,
        Integrity(**data["data"], words=data["integrity"]), evidence,
        data["established_noise"], data["cut_off"], data["budget"],
        data.get("screened"))


def _finding(entry, known):
    """A finding; its effect is that of the extended model."""
    cause, given = entry["cause"], entry["parameters"]
    effect = known.get(cause) or build(
        _class_of(cause), {name: part["value"] for name, part in given.items()}, cause)
    g = entry["gain"]
    # in the order of the class, as it was judged
    std = {field.name: _number(given[field.name]["std"], math.inf)
           for field in parameter_fields(type(effect)) if field.name in given}
    return Finding(effect, std, entry["confidence"], entry["confusable_with"], entry["evidence"],
                   Gain(g["held_out_rmse_before"], g["held_out_rmse_after"], g["reduction"],
                        tuple(g["ci95"])))


def _class_of(cause):
    try:
        return effect_of(cause)
    except KeyError:
        raise FracAccelError(f"findings: the cause {cause!r} is not known here") from None


def _numbers(mapping):
    return {name: _number(value) for name, value in mapping.items()}


def _number(value, otherwise=math.nan):
    return otherwise if value is None else float(value)
