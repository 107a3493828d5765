r"""Motion of a mass with Coulomb friction, compiled.

Coulomb friction is the set-valued law of A. F. Filippov (1988). A step of `exponential_step` is
split where the velocity turns and where the mass breaks loose. While it sticks, the force N that
holds it is unknown, and follows from an acceleration of zero.
"""

from typing import NamedTuple

import numpy as np

from .exponential_step import (
    add,
    advance,
    beyond,
    derivative,
    displace,
    exact,
    fast,
    follow_laws,
    inlined,
    look,
    power_terms,
    prepare,
    seen,
    slip,
)

_SPLITS = 12            # of one step
_SHORTEST = 1e-9        # part of a step that is none
_TURN_PASSES = 4
_TURNED = 1e-4          # of a step, the permitted error of a turn
_HALVINGS, _SECANTS = 5, 3  # of a step where a turn is looked for


class _Modes(NamedTuple):
    """The oscillator's modes with their states, and what is seen of them now and in a step."""

    poles: np.ndarray
    residues: np.ndarray
    of_displacement: np.ndarray
    of_velocity: np.ndarray
    pairs: int
    mass: float
    real: np.ndarray
    imaginary: np.ndarray
    now: np.ndarray
    free: np.ndarray


class _Law(NamedTuple):
    """The force: level of the friction, and the smooth rest with its states."""

    level: float
    terms: np.ndarray
    parameters: np.ndarray
    functions: tuple
    count: int
    constants: np.ndarray
    states: np.ndarray


class _Length(NamedTuple):
    """All about a step that depends only on its length: see `exponential_step.prepare`."""

    rows: np.ndarray
    gains: np.ndarray
    sums: np.ndarray


class _Path(NamedTuple):
    """Linear motion on the grid, its values in the middle of intervals, and an interval."""

    motion: np.ndarray
    middles: np.ndarray
    step: float


class _Mass(NamedTuple):
    """Motion and hysteresis, the way it slides or whether it sticks; the force in the last step,
    now, and in the middle and at the end of this step."""

    q: float
    v: float
    z: float
    sense: float
    sticks: bool
    last: float
    n0: float
    nm: float
    ne: float


@fast
def integrate_with_friction(poles, residues, of_displacement, of_velocity, pairs, mass, terms,
                            parameters, functions, count, constants, begin, step, motion, middles,
                            start):
    """Deviation on the grid; its end is NaN where the motion grows without bound."""
    m = len(poles)
    real, imaginary, now = np.zeros(m), np.zeros(m), np.empty((6, m))
    rows, gains, sums, free = (np.empty((12, m)), np.empty((6, m)), np.empty((2, 3, 3)),
                               np.zeros((2, 3)))
    prepare(step, poles, residues, pairs, rows, gains, sums)
    displace(poles, now, real, imaginary, start, of_displacement)
    states = np.zeros((3, len(functions)))
    states[0] = begin
    modes = _Modes(poles, residues, of_displacement, of_velocity, pairs, mass, real, imaginary,
                   now, free)
    law = _Law(parameters[0], terms, parameters, functions, count, constants, states)
    path, whole = _Path(motion, middles, step), _Length(rows, gains, sums)
    part = _Length(rows.copy(), gains.copy(), sums.copy())
    at = _begun(modes, law, path, start)
    result = np.full(motion.shape[1], np.nan)
    result[0] = start
    for index in range(motion.shape[1] - 1):
        if not at.sticks:
            # nearly always it goes on as it went
            look(rows, real, imaginary, pairs, motion, middles, index, 2, free)
            nm, ne = beyond(at.last, at.nm, at.ne)
            nm, ne, z = slip(free, sums, step, at.n0, at.q, at.v, at.z, nm, ne,
                             parameters[0] * at.sense, terms, parameters, functions, count,
                             constants, states)
            vm = derivative(free, sums, 0, 1, at.n0, nm, ne)
            ve = derivative(free, sums, 1, 1, at.n0, nm, ne)
            if vm * at.sense >= 0 and ve * at.sense >= 0:
                q = derivative(free, sums, 1, 0, at.n0, nm, ne)
                if count:
                    states[0] = states[2]
                advance(rows, gains, real, imaginary, pairs, at.n0, nm, ne)
                at = _Mass(q, ve, z, at.sense, False, at.n0, ne, nm, ne)
                result[index + 1] = q - motion[0, index + 1]
                continue
        position = 0.0
        for split in range(_SPLITS):
            at, position = _part_of_step(modes, law, whole, part, path, index, position, at,
                                         split < _SPLITS - 1)
            if position > 1 - _SHORTEST:
                break
        if not np.isfinite(at.q):
            break
        result[index + 1] = seen(now, 0, real, imaginary, pairs)
    return result


@inlined
def _begun(modes, law, path, start):
    """The mass at the start: a record may begin in mid-motion."""
    q, v, states = path.motion[0, 0] + start, path.motion[1, 0], law.states
    n0 = law.level * np.sign(v) + power_terms(law.terms, q) + follow_laws(
        law.functions, law.count, law.constants, states[0], states[0], q, v, q, v, 0.0)
    if v == 0:
        n0 = modes.mass * (path.motion[2, 0]
                           + seen(modes.now, 4, modes.real, modes.imaginary, modes.pairs))
    return _Mass(q, v, 0.0, np.sign(v), v == 0, n0, n0, n0, n0)


@inlined
def _part_of_step(modes, law, whole, part, path, index, position, at, may_change):
    """The mass after the rest of a step, or after its part up to where it turns or breaks loose;
    and the position then."""
    left = 1.0 - position
    if position == 0:
        look(whole.rows, modes.real, modes.imaginary, modes.pairs, path.motion, path.middles,
             index, 3, modes.free)
    else:
        _prepare_part(modes, part, path, index, position, left)
    length = whole if position == 0 else part
    if at.sticks:
        at, left, changes = _hold(modes, law, length, part, path, index, position, left, at)
    else:
        at, left, changes = _slide(modes, law, length, part, path, index, position, left, at,
                                   may_change)
    return at, position + left if changes else 1.0


@inlined
def _prepare_part(modes, part, path, index, position, left):
    prepare(path.step * left, modes.poles, modes.residues, modes.pairs, part.rows, part.gains,
            part.sums)
    _look_at_part(part.rows, modes.real, modes.imaginary, modes.pairs, path.motion, index,
                  position, left, modes.free)


@inlined
def _smooth(law, at, after, v):
    """All of the force but the friction."""
    return power_terms(law.terms, at.q) + law.parameters[1] * at.z + follow_laws(
        law.functions, law.count, law.constants, law.states[0], after, at.q, v, at.q, v, 0.0)


@inlined
def _hold(modes, law, length, part, path, index, position, left, at):
    """A mass that sticks, up to where the force breaks it loose; how long, and whether it does."""
    smooth = _smooth(law, at, law.states[1], at.v)
    nm, ne = _stick(modes.free, length.sums, at.n0, modes.mass)
    breaks = abs(nm - smooth) > law.level or abs(ne - smooth) > law.level
    if breaks:
        share = _crossing(at.n0 - smooth, nm - smooth, ne - smooth, law.level)
        left *= share
        nm, ne = _parabola(at.n0, nm, ne, share / 2), _parabola(at.n0, nm, ne, share)
        prepare(path.step * left, modes.poles, modes.residues, modes.pairs, part.rows, part.gains,
                part.sums)
        length = part
    if law.count:
        follow_laws(law.functions, law.count, law.constants, law.states[0], law.states[1], at.q,
                    0.0, at.q, 0.0, path.step * left)
        law.states[0] = law.states[1]
    real, imaginary, pairs = modes.real, modes.imaginary, modes.pairs
    advance(length.rows, length.gains, real, imaginary, pairs, at.n0, nm, ne)
    qe, ve, _ = _between(path.motion, index, position + left)
    add(real, imaginary, at.q - qe - seen(modes.now, 0, real, imaginary, pairs),
        modes.of_displacement)
    add(real, imaginary, -ve - seen(modes.now, 2, real, imaginary, pairs), modes.of_velocity)
    if breaks:
        sense = np.sign(ne - smooth)
        force = smooth + law.level * sense
        return (_Mass(at.q, at.v, at.z, sense, False, force, force, force, force), left, breaks)
    return _Mass(at.q, at.v, at.z, at.sense, True, at.n0, ne, nm, ne), left, breaks


@inlined
def _slide(modes, law, length, part, path, index, position, left, at, may_turn):
    """A mass that slides, up to where it turns; how long, and whether it does."""
    guessm, guesse = beyond(at.last, at.nm, at.ne)
    nm, ne, z = _slip(modes, law, length, path.step * left, at, guessm, guesse)
    vm = derivative(modes.free, length.sums, 0, 1, at.n0, nm, ne)
    ve = derivative(modes.free, length.sums, 1, 1, at.n0, nm, ne)
    turns = (vm * at.sense < 0 or ve * at.sense < 0) and may_turn
    if turns:
        nm, ne, z, ve, left = _up_to_turn(modes, law, length, part, path, index, position, left,
                                          at, nm, ne, z, vm, ve)
        length = part
    q = derivative(modes.free, length.sums, 1, 0, at.n0, nm, ne)
    if law.count:
        law.states[0] = law.states[2]
    advance(length.rows, length.gains, modes.real, modes.imaginary, modes.pairs, at.n0, nm, ne)
    after = _Mass(q, ve, z, at.sense, False, at.n0, ne, nm, ne)
    if turns:
        after = _turned(modes, law, path, index, position + left, after)
    return after, left, turns


@exact
def _slip(modes, law, length, duration, at, nm, ne):
    """`slip` where it is not worth its place in the loop."""
    return slip(modes.free, length.sums, duration, at.n0, at.q, at.v, at.z, nm, ne,
                law.level * at.sense, law.terms, law.parameters, law.functions, law.count,
                law.constants, law.states)


@inlined
def _up_to_turn(modes, law, length, part, path, index, position, rest, at, nm, ne, z, vm, ve):
    """Forces, hysteresis and velocity where the velocity is zero in the rest of a step, which would
    be the given ones without; and how long that takes."""
    _, _, a0 = _between(path.motion, index, position)
    a0 += seen(modes.now, 4, modes.real, modes.imaginary, modes.pairs) - at.n0 / modes.mass
    am = derivative(modes.free, length.sums, 0, 2, at.n0, nm, ne) - nm / modes.mass
    ae = derivative(modes.free, length.sums, 1, 2, at.n0, nm, ne) - ne / modes.mass
    duration = path.step * rest
    share = _turn(at.v, vm, ve, duration * a0, duration * am, duration * ae, at.sense)
    left, wholem, wholee = rest, nm, ne
    for _ in range(_TURN_PASSES):
        left = share * rest
        _prepare_part(modes, part, path, index, position, left)
        nm, ne, z = _slip(modes, law, part, path.step * left, at,
                          _parabola(at.n0, wholem, wholee, share / 2),
                          _parabola(at.n0, wholem, wholee, share))
        vm = derivative(modes.free, part.sums, 0, 1, at.n0, nm, ne)
        ve = derivative(modes.free, part.sums, 1, 1, at.n0, nm, ne)
        slope = (at.v - 4 * vm + 3 * ve) / share
        if slope * at.sense >= 0 or abs(ve) <= _TURNED * abs(slope):
            break
        share = min(max(share - ve / slope, 0.1 * share), 1.0)
    return nm, ne, z, ve, left


@inlined
def _turned(modes, law, path, index, position, at):
    """The mass where its velocity is zero: it sticks, or slides back."""
    smooth = _smooth(law, at, law.states[1], 0.0)
    _, _, acceleration = _between(path.motion, index, position)
    force = modes.mass * (acceleration + seen(modes.now, 4, modes.real, modes.imaginary,
                                              modes.pairs))
    sticks, sense = abs(force - smooth) <= law.level, at.sense
    if sticks:
        add(modes.real, modes.imaginary, -at.v, modes.of_velocity)
    else:
        sense = np.sign(force - smooth)
        force = smooth + law.level * sense
    return _Mass(at.q, 0.0, at.z, sense, sticks, force, force, force, force)


@inlined
def _parabola(n0, nm, ne, x):
    """Value at x of the parabola through n0, nm and ne at 0, 1/2 and 1."""
    return n0 + x * (4 * nm - 3 * n0 - ne + x * (2 * n0 - 4 * nm + 2 * ne))


@inlined
def _between(motion, index, part):
    """Motion `part` of an interval after a grid point: by a polynomial through six points."""
    first = min(max(index - 2, 0), motion.shape[1] - 6)
    x0 = index - first + part
    x1, x2, x3, x4, x5 = x0 - 1, x0 - 2, x0 - 3, x0 - 4, x0 - 5
    front, centre, back = x0 * x1, x2 * x3, x4 * x5
    w0, w1 = -x1 * centre * back / 120, x0 * centre * back / 24
    w2, w3 = -front * x3 * back / 12, front * x2 * back / 12
    w4, w5 = -front * centre * x5 / 24, front * centre * x4 / 120
    return (_weighted(motion, 0, first, w0, w1, w2, w3, w4, w5),
            _weighted(motion, 1, first, w0, w1, w2, w3, w4, w5),
            _weighted(motion, 2, first, w0, w1, w2, w3, w4, w5))


@inlined
def _weighted(motion, order, i, w0, w1, w2, w3, w4, w5):
    return (w0 * motion[order, i] + w1 * motion[order, i + 1] + w2 * motion[order, i + 2]
            + w3 * motion[order, i + 3] + w4 * motion[order, i + 4] + w5 * motion[order, i + 5])


@exact
def _look_at_part(rows, real, imaginary, pairs, motion, index, position, left, free):
    """Fill `free` for a step of `left` intervals from `position` after a grid point."""
    for i in range(2):
        q, v, a = _between(motion, index, position + (0.5 + 0.5 * i) * left)
        free[i, 0] = q + seen(rows, 6 * i, real, imaginary, pairs)
        free[i, 1] = v + seen(rows, 6 * i + 2, real, imaginary, pairs)
        free[i, 2] = a + seen(rows, 6 * i + 4, real, imaginary, pairs)


@exact
def _stick(free, sums, n0, mass):
    """Force in the middle and at the end of a step that keeps the acceleration at zero."""
    matrix = np.empty((2, 2))
    right = np.empty(2)
    for i in range(2):
        matrix[i, 0], matrix[i, 1] = sums[i, 2, 1], sums[i, 2, 2]
        matrix[i, i] += 1 / mass
        right[i] = free[i, 2] - n0 * sums[i, 2, 0]
    determinant = matrix[0, 0] * matrix[1, 1] - matrix[0, 1] * matrix[1, 0]
    return ((right[0] * matrix[1, 1] - right[1] * matrix[0, 1]) / determinant,
            (right[1] * matrix[0, 0] - right[0] * matrix[1, 0]) / determinant)


@exact
def _crossing(n0, nm, ne, level):
    """First part of the step at which a parabola leaves the range from -level to level."""
    low, high = 0.0, 1.0
    if abs(nm) > level:
        high = 0.5
    for _ in range(45):
        x = (low + high) / 2
        if abs(_parabola(n0, nm, ne, x)) > level:
            high = x
        else:
            low = x
    return high


@exact
def _turn(v0, vm, ve, a0, am, ae, sense):
    """First part of a step after which the velocity is against `sense`.

    By the polynomial with the velocities v0, vm, ve and the slopes a0, am, ae at the start, in the
    middle and at the end (Hermite's interpolation by divided differences).
    """
    first, second = 2 * (vm - v0), 2 * (ve - vm)
    c2 = 2 * (first - a0)
    e2, e3, e4 = 2 * (am - first), 2 * (second - am), 2 * (ae - second)
    c3, f2, f3 = 2 * (e2 - c2), e3 - e2, 2 * (e4 - e3)
    c4 = f2 - c3
    c5 = f3 - f2 - c4
    low, high, before, after = 0.0, 1.0, v0 * sense, ve * sense
    if vm * sense < 0:
        high, after = 0.5, vm * sense
    for i in range(_HALVINGS + _SECANTS):
        x = (low + high) / 2
        if i >= _HALVINGS and before > 0:
            x = low + (high - low) * before / (before - after)
        y = x - 0.5
        value = (v0 + x * (a0 + x * (c2 + y * (c3 + y * (c4 + (x - 1) * c5))))) * sense
        if value < 0:
            high, after = x, value
        else:
            low, before = x, value
    return high
