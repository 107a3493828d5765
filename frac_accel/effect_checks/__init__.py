"""Whether a cause keeps the contract of `Effect`: one check for each promise.

Also as a command: ``python -m frac_accel.effect_checks CAUSE``.
"""

import dataclasses

import numpy as np

from ..errors import ModelError
from ..model.parameters import is_needed_list, parameter_fields
from . import behaviour, declaration
from .draws import Broken, Draws

__all__ = ["CHECKS", "check_effect"]

# By name, in the order in which a new cause is best mended.
CHECKS = {
    "declaration": declaration.declares,
    "documentation": declaration.documents,
    "YAML": declaration.survives_yaml,
    "finite output": behaviour.stays_finite,
    "null value": behaviour.vanishes_at_null,
    "blocks": behaviour.ignores_blocks,
    "inversion of samples": behaviour.inverts_samples,
    "inversion of motion": behaviour.inverts_motion,
    "starts": declaration.starts_within_bounds,
}
# Those of a cause whose coefficients cannot be drawn, or that is none of the sensor's, which then
# neither simulates nor corrects it.
DECLARED = ("declaration", "documentation", "YAML", "starts")


def check_effect(cls, seed=0):
    """Check that a cause keeps what `Effect` promises, with parameters drawn from their ranges.

    Declarations are complete; a model file gives the effect back; a fit starts within the bounds;
    outputs are finite over all that the parameters may be; the cause vanishes where it says so;
    simulation and inversion do not depend on how a stream is cut into blocks; inversion undoes
    simulation, as far as the variance that it states.

    Parameters
    ----------
    cls : type
        Subclass of `Effect`.
    seed : int
        Of the random draws.

    Raises
    ------
    ModelError
        One line: the cause, what it does not keep, and with which parameters.

    Examples
    --------
    >>> import frac_accel
    >>> from frac_accel.effects import effect_of
    >>> frac_accel.check_effect(effect_of("offset"))
    """
    for number, (name, check) in enumerate(CHECKS.items()):
        if name not in DECLARED and (_needs_lists(cls) or getattr(cls, "of_reference", False)):
            continue
        try:
            with np.errstate(all="ignore"):
                check(cls, Draws([seed, number]))
        except Broken as error:
            raise ModelError(f"{_who(cls)}: {name}: {error}") from None
        except Exception as error:
            line = " ".join(str(error).split())
            raise ModelError(f"{_who(cls)}: {name}: {type(error).__name__}: {line}") from error


def _needs_lists(cls):
    return dataclasses.is_dataclass(cls) and any(map(is_needed_list, parameter_fields(cls)))


def _who(cls):
    return getattr(cls, "cause", None) or getattr(cls, "__name__", repr(cls))

