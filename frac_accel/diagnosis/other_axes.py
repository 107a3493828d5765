"""Which causes the axes of one sensor have in common."""

import dataclasses

import numpy as np

from ..errors import FracAccelError
from ..model import AXES, is_link
from ..model.effects import known_effects
from ..model.effects.base import CROSS_AXIS, OFFSET
from .empirical import EmpiricalFit
from .gain import gain

# Share of the power of what is left that comes from across, from which on it asks for an answer.
_FROM_ACROSS = 0.2
# Share of an axis at which a fit begins.
_ACROSS = 1e-3
# Share of what another axis leaves (power) below which it shows causes that were found on this one.
_FOLLOWS = 0.5
# Standard uncertainties of a share from which it is there, and share of it within which it is what
# a turn says.
_SHOWN, _AS_TOLD = 10.0, 0.15
# Share of another axis that a sensor shows which was mounted by eye (a degree or so), and standard
# uncertainties from which a zero is more open than its fit alone says.
_BY_EYE, _MORE_OPEN = 0.02, 2.0


@dataclasses.dataclass(frozen=True)
class OtherAxes:
    """What the axes that are not diagnosed have as well, of the causes of the one that is.

    Attributes
    ----------
    in_own_core : tuple of str
        Causes that say what a core is that nobody has stated: it is that of all axes.
    alike : bool
        Whether all axes have the same mount, dynamics and filters, as those of one housing do.
    same_laws : bool
        Whether they have the same laws, too: forces, play, and gains that change.
    """

    in_own_core: tuple = ()
    alike: bool = False
    same_laws: bool = False

    def have(self, effect):
        """Whether the other axes have an effect too."""
        return effect.common_to_axes or (effect.of_reference and not effect.of_own_axis) \
            or effect.cause in self.in_own_core or self._share(effect)

    def _share(self, effect):
        return (self.alike and is_of_all_if_alike(effect)) or (self.same_laws and is_law(effect))

    def common(self, effects):
        """Of these effects, by cause, what the other axes have too."""
        return {cause: effect for cause, effect in effects.items() if self.have(effect)}

    def shown_by(self, problem, effects):
        """The same as far as the record shows it: by what comes across with these effects (by
        cause), or of a turned sensor by the other axes' own samples."""
        alike = self.alike and (_crosses(effects) or _others_follow(problem, effects))
        return dataclasses.replace(self, alike=alike,
                                   same_laws=self.same_laws and _crosses(effects))

    def said(self, finding):
        """A finding with words where it is written for all axes."""
        if not self._share(finding.effect):
            return finding
        return dataclasses.replace(finding, evidence=[
            *finding.evidence,
            "written for all axes: the others show it as well"])


# Nothing but what is common to all axes by its nature.
UNLIKE = OtherAxes()


def _crosses(effects):
    """Whether the other axes' outputs are part of this one's."""
    return any(effect.mixes_outputs for effect in effects.values())


def _others_follow(problem, effects):
    """Whether each other axis of a turned sensor follows its reference far better with the mount,
    dynamics and filters of these effects than without, but for its gain and its zero."""
    p, unlike = problem, dataclasses.replace(problem.others, alike=False)
    common = unlike.common(effects)
    every = {**common, **{cause: effect for cause, effect in effects.items()
                          if is_of_all_if_alike(effect)}}
    others = [axis for axis in range(len(AXES)) if axis != p.axis
              and np.ptp(p.record.sensor[p.used, axis]) > 0]
    if every == common or not others or not any(e.mixes_axes for e in effects.values()):
        return False

    def left(axis, effects):
        output = p.response(axis, tuple(effects.values()))[p.used]
        rest = p.record.sensor[p.used, axis] - p.record.sensor[p.used, axis].mean()
        output = output - output.mean()
        return rest @ rest - (output @ rest)**2 / max(output @ output, np.finfo(float).tiny)
    return all(left(axis, every) < _FOLLOWS * left(axis, common) for axis in others)


def is_of_all_if_alike(effect):
    """Whether an effect is one of mount, dynamics or filters, and acts on what comes across."""
    return acts_before(effect) and not effect.of_reference


def is_law(effect):
    """Whether an effect bends the motion or changes with it or with time before axes are mixed."""
    return effect.stage < CROSS_AXIS and not (effect.of_reference or effect.mixes_axes
                                              or effect.restates_core or is_link(effect))


def acts_before(effect):
    """Whether an effect changes dynamics before axes are mixed."""
    return effect.stage < CROSS_AXIS and (
        effect.restates_core or (is_link(effect) and not effect.is_constant))


def may_be_unlike(engine, best):
    """Whether a set of causes of axes that are alike may be another one where they are not: with
    something across, it leaves more than noise, or leaves as little without their filters."""
    p, fitted = engine.problem, (engine.part or engine)
    if not p.others.alike:
        return False
    crosses = _crosses(best.effects)
    if not fitted.noise_only(best):
        shares = {part: share for share, part in fitted.structure(best)}
        return crosses or shares.get("across", 0.0) > _FROM_ACROSS
    if not crosses or not any(is_of_all_if_alike(effect) and effect.cause not in
                              p.others.in_own_core for effect in best.effects.values()):
        return False
    unlike = fitted.problem.beside(dataclasses.replace(p.others, alike=False))
    return unlike.fit(best.effects).cost - best.cost < fitted.threshold(best)


def beside_same_laws(engine, best):
    """Effects of a set whose other axes have the laws that were found on this one, where that
    describes clearly better what comes across, or as well what needs a turn, and a gain that takes
    back what the turn does to it, to be said otherwise; or None."""
    p, fitted = engine.problem, (engine.part or engine)
    effects, base = best.effects, engine.search.base
    if p.others.same_laws or not any(is_law(effect) and cause not in base
                                     for cause, effect in effects.items()):
        return None
    least = fitted.threshold(best)
    if not _crosses(effects):
        effects, least = _across_for_a_turn(p, effects, base), -least
    if effects is None or p.limit.ends_search(
            "whether the other axes have the same laws was not tried"):
        return None
    same = fitted.problem.beside(dataclasses.replace(p.others, same_laws=True))
    try:
        fit = same.fit(effects)
    except FracAccelError:  # along another axis, the motion has no bound
        return None
    return fit.effects if best.cost - fit.cost > least else None


def _across_for_a_turn(problem, effects, base):
    """Effects with shares of the other axes for a turn and a constant gain, or None."""
    turns = {cause: effect for cause, effect in effects.items()
             if cause not in base and effect.mixes_axes}
    gains = {cause for cause, effect in effects.items()
             if cause not in base and is_link(effect) and effect.is_constant}
    if len(turns) != 1 or not gains:
        return None
    turn, = turns.values()
    shares = turn.share_of_axes(problem.axis)
    if np.argmax(np.abs(shares)) != problem.axis:
        return None
    cls, others = _bringing_across(problem)
    across = cls(**{name: float(shares[AXES.index(name)] / shares[problem.axis])
                    for name in others})
    return {**{cause: effect for cause, effect in effects.items()
               if cause not in turns.keys() | gains}, cls.cause: across}


def shows_turn(problem, effects):
    """Whether another axis has the share of the diagnosed one that a turn among these effects gives
    it: of a turn either has the other's, with opposite signs."""
    shares, stds = problem.mixing(effects)
    own = problem.axis
    for other in (axis for axis in range(len(AXES)) if axis != own):
        share, std = np.array([shares[other, own], stds[other, own]]) / shares[other, other]
        for effect in effects.values():
            if not effect.mixes_axes or effect.describes == "across":
                continue
            told = effect.share_of_axes(other)[own] / effect.share_of_axes(other)[other]
            if abs(told) > _SHOWN * abs(std) and abs(share / told - 1) < _AS_TOLD:
                return True
    return False


def _bringing_across(problem):
    """Class of the effect that adds shares of the other axes, and the axes that it can add."""
    cls, = (cls for cls in known_effects().values() if cls.describes == "across")
    return cls, cls.fitted_parameters(AXES[problem.axis], problem.excited)


def as_they_show(engine, fitted):
    """A fit whose effects say of the other axes what these show beside all that was found.

    A search begins with what they show beside less: a delay between two axes looks like a turn.
    What the model in use says of them stays.
    """
    p = engine.problem
    shares, _ = p.mixing(fitted.effects)
    effects = {cause: effect if cause in engine.search.base
               else effect.with_other_axes(p.axis, shares)
               for cause, effect in fitted.effects.items()}
    return fitted if effects == fitted.effects else engine.search.again(effects)


def with_unknown_turn(engine, fitted, finding):
    """A finding of a zero, as uncertain as a turn makes it whose constant is in no fit: of what
    another axis shows all the time, such as gravity, a turn that hardly shows in the motion brings
    a zero, and so does one that is known where the reference does not show that constant.

    Either zero may be the sensor's: both ends of a uniform distribution (JCGM 100:2008, 4.3.7),
    or that of the known turn.
    """
    p, effect = engine.problem, finding.effect
    others = [other for other in range(len(AXES))
              if other != p.axis and p.record.reference[:, other].any()]
    if effect.stage != OFFSET or not effect.everyday or not others:
        return finding
    responses = np.stack([p.response(other) for other in others], axis=1)
    # gravity, where the reference does not show it; an axis that is not there shows nothing
    shown = p.record.sensor[p.used][:, others]
    hidden = np.where(np.ptp(shown, axis=0) > 0, np.mean(shown - responses[p.used], axis=0), 0.0)
    shares = np.zeros(len(AXES))
    for each in p.axis_model(fitted.effects).effects:
        if each.mixes_axes:
            shares += each.share_of_axes(p.axis)
    turned = np.hypot(_of_a_turn(p, fitted, responses + hidden), shares[others] @ hidden)
    (name, std), = finding.std.items()
    words = ["a turn of the sensor brings as much of what the other axes have all the time, such "
             "as gravity: so uncertain is the zero"] if turned > _MORE_OPEN * std else []
    return dataclasses.replace(finding, std={name: float(np.hypot(std, turned))},
                               evidence=[*finding.evidence, *words])


def _of_a_turn(problem, fitted, responses):
    """Standard uncertainty of a zero, of a turn that is in no fit: by one step of least squares
    beside a gain and a delay, with the other axes' shares as far as the record knows them, and none
    before that (`_BY_EYE`; C. M. Bishop, *Pattern Recognition and Machine Learning* (2006), 3.3).
    `responses`, shape (n, axes), are those of the other axes."""
    p = problem
    own = fitted.output - fitted.output[p.used].mean()
    columns = np.c_[np.ones(len(own)), own, np.gradient(own), responses][p.used]
    rest = fitted.residual[p.used]
    known = np.r_[np.zeros(3), np.full(responses.shape[1], np.mean(rest**2) / _BY_EYE**2)]
    inverse = np.linalg.pinv(columns.T @ columns + np.diag(known), hermitian=True)
    away = float((inverse @ (columns.T @ rest))[0])
    # either zero may be the sensor's
    return np.sqrt(away**2 / 3 + np.mean(rest**2) * max(inverse[0, 0], 0.0))


def fit_shares(problem, effects, output, rest):
    """Share of each other axis that describes what an output leaves (`EmpiricalFit`; its `order` is
    their number), learnt on all but the rows that are held out.

    Raises
    ------
    FracAccelError
        If no other axis moves, or something comes across from them already.
    """
    p = problem
    cls, others = _bringing_across(p)
    if not others or any(effect.mixes_axes for effect in effects.values()):
        raise FracAccelError("nothing more can come across")
    learning = p.restricted(p.used & ~rest)
    start = cls(**dict.fromkeys(others, _ACROSS))
    effect = learning.fit({**effects, cls.cause: start}, held=effects).effects[cls.cause]
    described = p.simulate({**effects, cls.cause: effect})
    return EmpiricalFit(effect, len(others), None,
                        gain((p.measured - output)[rest], (p.measured - described)[rest]))
