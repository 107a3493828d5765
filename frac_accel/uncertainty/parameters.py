"""The uncertain parameters of a model: their covariance as the file gives it, and draws from it."""

import dataclasses

import numpy as np

from ..errors import ModelError
from ..model import AXES, AxisModel
from ..model.core import Arx, FractionalTransferFunction
from ..model.core.sensor_form import from_sensor_parameters, sensor_parameters
from ..model.effects import IDENTIFIED, effect_of
from ..model.effects.base import GAIN
from ..model.parameters import is_varied, number, parameter_fields

# Rounding that a covariance may have suffered, of its correlations.
_ROUNDING = 1e-6
# Step of a central difference, of the parameter: far narrower than any resonance that a file can
# mean, far above rounding.
_STEP = 1e-5
# Steps of the linearity check [standard uncertainties]: where the line begins and where it is
# judged; and the relative distance from it that counts as none.
_NEAR, _REACH = 0.02, 2.0
LINEAR = 0.1
# Of the general equation's parameters, those that are positive.
_POSITIVE = ("natural_frequency_hz", "damping_ratio", "damping_order", "inertia_order",
             "slope_order")


@dataclasses.dataclass(frozen=True, eq=False)
class UncertainAxis:
    r"""One axis of a sensor model whose parameters are known with a covariance.

    The covariance is that of the model file: ``covariance: {parameters: [...], matrix: [[...]]}``.
    Parameters are named as `identify` names them (those of the core, ``a1`` ... and ``b0`` ... of
    a transfer function in z, those of `from_sensor_parameters` of a general equation, ``delay_s``,
    ``offset``); those of other effects as ``low_pass_lag.corner_hz``. These hold for each axis that
    has no model of its own. Parameters of one axis alone begin with ``axes.z.``, as in
    ``axes.z.damping_ratio``; an axis that has any is described by these alone.

    Attributes
    ----------
    axis : AxisModel
    names : tuple of str
    values : ndarray, shape (p,)
    covariance : ndarray, shape (p, p)
    lowest, highest : ndarray, shape (p,)
        Physical bounds: a natural frequency, a damping ratio and a corner are positive.
    """

    axis: AxisModel
    names: tuple
    values: np.ndarray
    covariance: np.ndarray
    lowest: np.ndarray
    highest: np.ndarray

    @classmethod
    def of(cls, model, axis="x"):
        """Of one axis of a SensorModel.

        Raises
        ------
        ModelError
            If the model has no covariance, or one that names no parameter of the axis twice, is
            not square, symmetric and positive semidefinite, or belongs to another axis.
        """
        own, name = model.axis(axis), axis if isinstance(axis, str) else AXES[axis]
        names, matrix, are_own = for_axis(name, *read_covariance(model.metadata.get("covariance")))
        if own != AxisModel(model.core, model.effects) and not are_own:
            raise ModelError(f"axes.{name}: has a model of its own, of which the covariance says "
                             "nothing")
        return cls.given(own, names, matrix)

    @classmethod
    def given(cls, axis, names, covariance):
        """Of an AxisModel, with the covariance of named parameters; errors as in `of`."""
        fields = [_find(axis, name, f"covariance.parameters[{i}]") for i, name in enumerate(names)]
        values, lowest, highest = (np.array(part, float) for part in zip(*fields))
        return cls(axis, tuple(names), values, np.asarray(covariance, float), lowest, highest)

    @property
    def std(self):
        """Standard uncertainties, shape (p,)."""
        return np.sqrt(np.diag(self.covariance))

    def at(self, values):
        """AxisModel with other values of the parameters; None where it cannot be one."""
        if np.any(values <= self.lowest) or np.any(values >= self.highest):
            return None
        core, effects = self.axis.core, {effect.cause: effect for effect in self.axis.effects}
        changes = {}
        for name, value in zip(self.names, map(float, values)):
            owner, key = _owner(name)
            changes.setdefault(owner, {})[key] = value
        for cause, change in changes.items():
            if cause == "core":
                core = _changed_core(core, change)
            elif cause in effects:
                effects[cause] = dataclasses.replace(effects[cause], **change)
            else:
                effects[cause] = effect_of(cause)(**change)
        axis = AxisModel(core, tuple(sorted(effects.values(), key=lambda effect: effect.stage)))
        try:
            axis.effective_core.require_stable("core")
        except ModelError:
            return None
        return axis

    def directions(self):
        """Roots of the covariance, shape (p, p): its eigenvectors, one standard deviation long."""
        scale = np.where(self.std > 0, self.std, 1.0)
        size, vectors = np.linalg.eigh(self.covariance / np.outer(scale, scale))
        return scale[:, None] * vectors * np.sqrt(np.maximum(size, 0))

    def draws(self, count):
        """AxisModels with `count` draws of the parameters.

        From a multivariate Gaussian (JCGM 101:2008, 6.4.8), of which draws outside the physical
        bounds, or of an unstable model, are drawn anew. Always the same draws.

        Raises
        ------
        ModelError
            If nearly all draws are outside: such an uncertainty says nothing.
        """
        rng = np.random.default_rng(0)
        root, models, tried = self.directions(), [], 0
        while len(models) < count:
            if tried > 20 * count:
                raise ModelError("covariance: fewer than one in twenty draws of the parameters is "
                                 "a sensor, the data have not determined them")
            batch = self.values + rng.standard_normal((count, len(self.values))) @ root.T
            models += [model for model in map(self.at, batch) if model is not None]
            tried += count
        return models[:count]

    def slopes(self, s):
        r"""Relative derivatives :math:`\partial \ln H / \partial \theta_i`, delay included.

        Parameters
        ----------
        s : ndarray of complex, shape (m,)
            [rad/s].

        Returns
        -------
        ndarray of complex, shape (p, m)
        """
        result = np.zeros((len(self.names), len(s)), complex)
        for i, name in enumerate(self.names):
            if name == "delay_s":
                result[i] = -s
            elif name != "offset":
                above, below, apart = self.beside(i)
                if not apart:
                    raise ModelError(f"{name}: {self.values[i]:g} is outside its range")
                result[i] = np.log(above.transfer_function(s) / below.transfer_function(s)) / apart
        return result

    def beside(self, i):
        """AxisModels with parameter i a little above and below, and how far apart they are.

        At the edge of stability only one side can be had, and the axis itself stands for the other.
        """
        step = np.zeros(len(self.values))
        step[i] = _STEP * (abs(self.values[i]) or 1.0)
        above, below = self.at(self.values + step), self.at(self.values - step)
        return (above or self.axis, below or self.axis,
                step[i] * ((above is not None) + (below is not None)))

    def ratio(self, model, s):
        """Response of a drawn AxisModel over that of the axis at `s`, delay included."""
        return model.transfer_function(s) / self.axis.transfer_function(s) \
            * np.exp(-s * (model.delay_s - self.axis.delay_s))

    def nonlinearity(self, change, whole=False):
        """How far a quantity is from depending linearly on the parameters.

        At two standard uncertainties to both sides along each eigenvector of the covariance, the
        quantity is compared with the straight line that it starts on.

        Parameters
        ----------
        change : callable
            Change of the quantity, any shape, from the nominal model to an AxisModel.
        whole : bool
            Judge the root mean square over the quantity instead of each of its values.

        Returns
        -------
        float
            Largest distance from the line over the change along it, both summed over the
            directions in squares; values that change by less than a thousandth of the most are
            measured by that. Infinite where there is no such model. To be compared with `LINEAR`.
        """
        distance = along = 0.0
        for direction in self.directions().T:
            if not direction.any():
                continue
            near, far = (
                [self.at(self.values + size * direction) for size in (-reach, reach)]
                for reach in (_NEAR, _REACH))
            if any(model is None for model in (*near, *far)):
                return np.inf
            line = (change(near[1]) - change(near[0])) * _REACH / (2 * _NEAR)
            away = np.maximum(np.square(change(far[1]) - line), np.square(change(far[0]) + line))
            distance, along = distance + away, along + np.square(line)
        if whole:
            distance, along = np.sum(distance), np.sum(along)
        floor = max(1e-6 * np.max(along), np.finfo(float).tiny)
        return float(np.sqrt(np.max(distance / np.maximum(along, floor))))


def read_covariance(entry):
    """Names and matrix of a model file's ``covariance``; ModelError where they are not valid."""
    if entry is None:
        raise ModelError("covariance: missing, expected parameters and matrix as identify "
                         "writes them")
    if not isinstance(entry, dict) or set(entry) != {"parameters", "matrix"}:
        raise ModelError(f"covariance: {entry!r:.60} given, expected the keys parameters and "
                         "matrix")
    names, rows = entry["parameters"], entry["matrix"]
    if not isinstance(names, list) or not names \
            or not all(isinstance(name, str) for name in names):
        raise ModelError(f"covariance.parameters: {names!r:.60} given, expected a list of names")
    for i, name in enumerate(names):
        if name in names[:i]:
            raise ModelError(f"covariance.parameters[{i}]: {name} stands twice")
    count = len(names)
    if not isinstance(rows, list) or len(rows) != count \
            or not all(isinstance(row, list) and len(row) == count for row in rows):
        raise ModelError(f"covariance.matrix: expected {count} rows of {count} numbers, one for "
                         "each parameter")
    matrix = np.array([[number(value, f"covariance.matrix[{i}][{j}]")
                        for j, value in enumerate(row)] for i, row in enumerate(rows)])
    for i, variance in enumerate(np.diag(matrix)):
        if variance < 0:
            raise ModelError(f"covariance.matrix[{i}][{i}]: {variance:g} given, expected a "
                             "variance, at least 0")
    scale = np.sqrt(np.diag(matrix))
    scale = np.where(scale > 0, scale, 1.0)
    correlation = matrix / np.outer(scale, scale)
    uneven = np.abs(correlation - correlation.T)
    if uneven.max() > _ROUNDING:
        i, j = np.unravel_index(np.argmax(uneven), uneven.shape)
        raise ModelError(f"covariance.matrix: not symmetric, [{i}][{j}] is {matrix[i, j]:g} and "
                         f"[{j}][{i}] is {matrix[j, i]:g}")
    smallest = np.linalg.eigvalsh((correlation + correlation.T) / 2)[0]
    if smallest < -_ROUNDING:
        raise ModelError("covariance.matrix: not positive semidefinite, the smallest eigenvalue "
                         f"of its correlation matrix is {smallest:.3g}")
    return names, (matrix + matrix.T) / 2


def for_axis(axis, names, matrix):
    """What a covariance says of one axis, ``"x"``, ``"y"`` or ``"z"``.

    Returns
    -------
    names : list of str
        Without the ``axes.z.`` of parameters of one axis alone.
    matrix : ndarray
    are_own : bool
        Whether they are of that axis alone.

    Raises
    ------
    ModelError
        If a name is of no axis, or all are of other axes.
    """
    whose = [name.split(".", 2)[1] if name.startswith("axes.") else "" for name in names]
    for i, owner in enumerate(whose):
        if owner not in ("", *AXES) or owner and names[i].count(".") < 2:
            raise ModelError(f"covariance.parameters[{i}]: {names[i]}: no such axis, expected "
                             "axes.x, axes.y or axes.z and a parameter")
    wanted = axis if axis in whose else ""
    places = [i for i, owner in enumerate(whose) if owner == wanted]
    if not places:
        raise ModelError(f"axes.{axis}: the covariance says nothing of this axis")
    names = [names[i].removeprefix(f"axes.{axis}.") for i in places]
    return names, matrix[np.ix_(places, places)], bool(wanted)


def offset_of(axis):
    """Offset of an AxisModel [output units]."""
    return sum(effect.offset for effect in axis.effects
               if isinstance(effect, IDENTIFIED["offset"]))


def _owner(name):
    """Core or cause that a parameter's name belongs to, and its name there."""
    if name in IDENTIFIED:
        return IDENTIFIED[name].cause, name
    cause, dot, key = name.partition(".")
    return (cause, key) if dot else ("core", name)


def _find(axis, name, where):
    """Value of a parameter and its bounds."""
    owner, key = _owner(name)
    if owner == "core" and isinstance(axis.core, Arx):
        side, place = _coefficient(axis.core, key, where)
        return getattr(axis.core, side)[place], -np.inf, np.inf
    if owner == "core" and isinstance(axis.core, FractionalTransferFunction):
        known = sensor_parameters(axis.core)
        if key in known:
            # the bound itself is allowed
            highest = np.nextafter(2.0, 3.0) if key == "inertia_order" else np.inf
            return known[key], 0.0 if key in _POSITIVE else -np.inf, highest
        raise ModelError(f"{where}: {name}: no such parameter, expected one of "
                         f"{', '.join([*known, 'delay_s', 'offset'])}")
    if owner == "core":
        part = axis.core
    else:
        part = next((effect for effect in axis.effects if effect.cause == owner), None)
        if part is None and name in IDENTIFIED:
            return 0.0, -np.inf, np.inf
        if part is None:
            raise ModelError(f"{where}: {name}: the model has no effect {owner}")
        if (part.stage > GAIN or part.mixes_axes) and name != "offset":
            raise ModelError(f"{where}: {name}: the uncertainty of {owner} cannot be propagated, "
                             "only that of linear links and of the offset")
    for field in parameter_fields(type(part)):
        if field.name == key and is_varied(field):
            limits = field.metadata
            low = limits["above"] if limits["above"] is not None else limits["minimum"]
            high = limits["below"] if limits["below"] is not None else limits["maximum"]
            return (getattr(part, key), -np.inf if low is None else low,
                    np.inf if high is None else high)
    known = [field.name for field in parameter_fields(type(part)) if is_varied(field)]
    raise ModelError(f"{where}: {name}: no such parameter, expected one of "
                     f"{', '.join([*known, 'delay_s', 'offset'])}")


def _coefficient(core, name, where):
    """Side and place of a coefficient a1 ..., b0 ... of a transfer function in z."""
    degree = len(core.denominator) - 1
    if name[:1] in ("a", "b") and name[1:].isdigit():
        power = int(name[1:])
        if name[0] == "a" and 1 <= power <= degree and core.denominator[0] == 1:
            return "denominator", power
        place = power - (degree + 1 - len(core.numerator))
        if name[0] == "b" and 0 <= place < len(core.numerator):
            return "numerator", place
    raise ModelError(f"{where}: {name}: no such parameter, expected a1 to a{degree} of a "
                     f"denominator that begins with 1, b0 to b{degree}, delay_s or offset")


def _changed_core(core, change):
    if isinstance(core, FractionalTransferFunction):
        return from_sensor_parameters({**sensor_parameters(core), **change})
    if not isinstance(core, Arx):
        return dataclasses.replace(core, **change)
    sides = {"numerator": list(core.numerator), "denominator": list(core.denominator)}
    for name, value in change.items():
        side, place = _coefficient(core, name, "covariance.parameters")
        sides[side][place] = value
    return dataclasses.replace(core, **{side: tuple(values) for side, values in sides.items()})
