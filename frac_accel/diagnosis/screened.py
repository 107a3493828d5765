"""What each cause would be on its own, to first order: estimates that many records can pool.

A diagnosis names what one record shows beyond doubt. An effect that is too weak for that still
moves the residual a little along what the cause would add to the output. That projection, with its
standard uncertainty, has no threshold and no sign that is forbidden, so its mean over many records
is right where no single one says anything.
"""

import dataclasses

import numpy as np

from ..errors import FracAccelError
from ..identification.fit.uncertainty import by_blocks, sandwich
from ..model.core.static_force import StaticForce
from ..model.effects import known_effects
from ..model.effects.base import CORE
from ..model.parameters import is_varied, parameter_fields
from .first_order import static_force
from .problem import acts_on_spring

# Share of a column's power that must be left beside what every fit takes.
_OWN = 1e-6
# Of the data with which starts are asked for again.
_SEED = 0


@dataclasses.dataclass(frozen=True, eq=False)
class Screen:
    """Directions in which causes would change a record's output, clear of what fits leave free.

    Attributes
    ----------
    names : list of (str, str)
        Cause and parameter; an empty parameter stands for the share of a fixed small effect.
    units : list of str
    columns : ndarray, shape (m, p)
        Change of the output by one unit of each parameter, where samples count [output units].
    used : ndarray of bool, shape (n,)
        Where the m rows stand in the record.
    """

    names: list
    units: list
    columns: np.ndarray
    used: np.ndarray

    def estimates(self, residual):
        """Each cause's own least-squares estimate.

        Parameters
        ----------
        residual : ndarray, shape (m,)
            Measured less simulated [output units].

        Returns
        -------
        list of dict
            ``cause``, ``parameter``, ``unit``, ``value``, ``std`` (for any spectrum of the residual
            and however it goes with the motion: the larger of `sandwich` and `by_blocks`) and
            ``size``, the RMS of one unit's effect [output units].
        """
        entries = []
        for (cause, parameter), unit, column in zip(self.names, self.units, self.columns.T):
            power = float(column @ column)
            value = float(column @ residual) / power
            left, own = residual - value * column, column[:, None]
            std = np.sqrt(max(sandwich(own, left, self.used)[0, 0], by_blocks(own, left)[0, 0]))
            entries.append({"cause": cause, "parameter": parameter, "unit": unit, "value": value,
                            "std": float(std), "size": float(np.sqrt(power / len(column)))})
        return entries

    def correlations(self):
        """Cosines between the columns: the upper triangle without the diagonal, row by row."""
        scaled = self.columns / np.linalg.norm(self.columns, axis=0)
        return (scaled.T @ scaled)[np.triu_indices(len(self.names), 1)].tolist()


def screened(engine):
    """Estimates of all causes in whose parameter the output is linear for small effects.

    Parameters
    ----------
    engine : Engine

    Returns
    -------
    dict
        ``estimates`` as of `Screen.estimates` and ``correlations``.
    """
    screen = screen_of(engine)
    residual = engine.search.baseline.residual[engine.problem.used]
    return {"estimates": screen.estimates(residual), "correlations": screen.correlations()}


def screen_of(engine):
    """`Screen` of the model in use on an engine's record."""
    search, used = engine.search, engine.problem.used
    fitted = search.baseline
    taken = _orthonormal(np.hstack([fitted.free.whole()[used], fitted.jacobian[used]]))
    view = search.view(fitted)
    found = {}
    for cause in search.candidates:
        if cause in fitted.effects:
            continue
        for effect in _independent_of_data(known_effects()[cause], view):
            name, unit, step = _moved(engine.problem, effect)
            try:
                change = engine.problem.change(fitted.effects, cause, effect)[used]
                if acts_on_spring(effect):
                    change = change + _level_before(engine.problem, fitted.effects, effect)
            except FracAccelError:
                continue
            own = change - taken @ (taken.T @ change)
            power = own @ own
            # of several sizes the smallest is the nearest to first order
            if power > _OWN * (change @ change) and power < found.get((cause, name), (np.inf,))[0]:
                found[cause, name] = power, unit, own / step
    columns = np.array([column for _, _, column in found.values()])
    return Screen(list(found), [unit for _, unit, _ in found.values()],
                  columns.reshape(len(found), int(used.sum())).T, used)


def _independent_of_data(effect_class, view):
    """Small effects with which fits begin, of those that do not depend on what was measured.

    Where a frequency or an instant was sought in the data, the estimate is biased away from zero.
    """
    noise = np.random.default_rng(_SEED).standard_normal(len(view.residual)) * view.used
    noise *= np.std(view.residual[view.used])
    other = dataclasses.replace(view, residual=noise, measured=view.simulated + noise)
    for one, two in zip(effect_class.starts(view), effect_class.starts(other)):
        if one.kind in ("free", "positive", "weak") and one.columns == two.columns:
            yield from one.columns


def _level_before(problem, effects, effect):
    """What the force with which a record begins has always added: its first order begins there."""
    model = problem.axis_model({name: other for name, other in effects.items()
                                if not acts_on_spring(other)})
    core = model.effective_core
    force = static_force(effect.add_force(StaticForce(core=core)), problem.motion(effects),
                         problem.rate)
    at_rest = np.array([1e-9 + 0j])
    passed = np.prod([link.transfer_function(at_rest)[0].real for link in model.dynamics[1:]
                      if link.stage > CORE])
    return -float(force[0]) * passed


def _moved(problem, effect):
    """Name and unit of the one parameter that an effect moves, and by how much.

    Where several are moved, or none has a value that says nothing, the effect counts as a whole.
    """
    axis = problem.baseline.axis(problem.axis)
    present = next((own for own in axis.effects if own.cause == effect.cause), None)
    moved = []
    for field in parameter_fields(type(effect)):
        if field.metadata.get("list"):
            if getattr(effect, field.name):
                return "", "1", 1.0
        if not is_varied(field):
            continue
        null = getattr(axis.core, field.name, None) if field.metadata["null"] == "core" \
            else field.metadata["null"]
        null = getattr(present, field.name) if present is not None else null
        value = getattr(effect, field.name)
        if null is None or not np.isfinite(null):
            return "", "1", 1.0
        if value != null:
            moved.append((field.name, field.metadata["unit"], value - null))
    return moved[0] if len(moved) == 1 else ("", "1", 1.0)


def _orthonormal(columns):
    if not columns.shape[1]:
        return columns
    vectors, sizes, _ = np.linalg.svd(
        columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300), full_matrices=False)
    return vectors[:, sizes > 1e-6]
