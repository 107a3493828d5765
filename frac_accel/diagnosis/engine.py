"""Diagnosis of one axis: from a record and a model to named causes."""

import numpy as np
from scipy.fft import rfft
from scipy.ndimage import uniform_filter1d

from ..identification.excitation import learning_length, strongest_stretch
from ..identification.uncertainty import sandwich
from .gain import gain
from .leftover import leftover
from .problem import Problem
from .search import Search

# Improvement, in variances of one sample's noise and for each parameter, that chance does not give.
_CHANCE = 30.0
# Causes that compete for the place of each one found.
_RIVALS = 4
# Records of more samples are searched in part first.
_LONG = 40_000


def noise_peak(residual, used):
    """Largest density of a residual's smoothed spectrum, over its mean: 1 for white noise."""
    power = np.abs(rfft(residual))**2
    smooth = uniform_filter1d(power, max(5, len(power) // 64), mode="reflect")
    return float(max(smooth.max() / smooth.mean(), 1.0))


class Engine:
    """Search, competition and judgement for one record."""

    def __init__(self, record, axis, baseline, used, base=None, candidates=None, log=None):
        self.problem = Problem(record, axis, baseline, used)
        self._wanted = used
        keywords = {"candidates": candidates} if candidates else {}
        self.search = Search(self.problem, base, log=log, **keywords)
        self.split = learning_length(record.reference[:, axis])
        self._learnt = {}
        # what the numerics of the simulation may still be wrong by
        self.floor = 3e-5 * float(np.std(record.sensor[used, axis]))

    def threshold(self, fitted):
        """Cost by which a further parameter must improve on a fit."""
        left = self.problem.count
        variance = fitted.cost / left
        return max(_CHANCE * variance * noise_peak(fitted.residual, self.problem.used),
                   self.floor**2 * left)

    def run(self, seed=None):
        """The smallest set of causes that describes the record.

        Parameters
        ----------
        seed : dict of str to Effect, optional
            Causes to begin with.

        Returns
        -------
        Fitted
        """
        p = self.problem
        if len(p.record) > _LONG:
            # where the motion is strongest is enough to find most causes
            part = strongest_stretch(p.record.reference[:, p.axis], _LONG // 2)
            found = Engine(p.record.part(part), p.axis, p.baseline, self._wanted[part],
                           self.search.base, self.search.candidates, self.search.log).run(seed)
            seed = {cause: effect for cause, effect in found.effects.items()
                    if cause not in self.search.base}
        best = self.search.run(self.threshold, lambda fitted: self.left(fitted).share == 0, seed)
        return self.compete(best)

    def score(self, fitted, variance):
        """Cost with a penalty for each parameter, in units of the noise's variance."""
        return fitted.cost / variance + _CHANCE * len(fitted.unknowns)

    def compete(self, best):
        """Let every cause's nearest rivals take its place; the winner of all."""
        for _ in range(4):
            for cause in best.effects:
                if cause in self.search.base:
                    continue
                less = self.search.without(best, cause)
                self.search.fit_all([{**less.effects, rival: begin} for _, rival, begin in
                                     self.search.screen(less)[:_RIVALS] if rival != cause]
                                    + [best.effects])
            variance = best.cost / self.problem.count
            winner = min((fit for fit in self.search.fits.values()
                          if len(fit.effects) <= len(best.effects)),
                         key=lambda fit: self.score(fit, variance))
            if winner is best:
                return best
            best = winner
        return best

    def rivals(self, best, cause):
        """Sets without a cause, no larger than the best, by score; (margin, causes)."""
        variance = best.cost / self.problem.count * noise_peak(best.residual, self.problem.used)
        own = self.score(best, variance)
        found = [(self.score(fit, variance) - own, fit.causes) for fit in
                 self.search.fits.values()
                 if cause not in fit.causes and len(fit.causes) <= len(best.causes)]
        return sorted(found, key=lambda entry: entry[0])

    def uncertainties(self, fitted):
        """Standard uncertainties by cause and parameter, for any spectrum of the residual."""
        if not fitted.unknowns:
            return {}
        jacobian = fitted.jacobian.copy()
        for i, unknown in enumerate(fitted.unknowns):
            value = getattr(fitted.effects[unknown.cause], unknown.name)
            jacobian[:, i] /= value if unknown.logarithmic else unknown.scale
        used = self.problem.used
        covariance = sandwich(jacobian[used], fitted.residual[used], used)
        result = {}
        for unknown, variance in zip(fitted.unknowns, np.diag(covariance)):
            result.setdefault(unknown.cause, {})[unknown.name] = float(np.sqrt(max(variance, 0)))
        return result

    def learnt(self, fitted):
        """The same causes, fitted to the learning part of the record only."""
        if fitted.causes not in self._learnt:
            learn = self.problem.used.copy()
            learn[self.split:] = False
            part = self.problem.restricted(learn)
            self._learnt[fitted.causes] = part.fit(fitted.effects, iterations=6)
        return self._learnt[fitted.causes]

    def held_out(self, best, cause):
        """Gain of a fitted cause on the part of the record that its fit has not seen."""
        rest = self.problem.used.copy()
        rest[:self.split] = False
        errors = [(self.problem.measured - self.learnt(fit).simulated)[rest]
                  for fit in (self.search.without(best, cause), best)]
        return gain(*errors)

    def left(self, fitted):
        """What the residual still holds."""
        p = self.problem
        across = [signal for axis, signal in enumerate(p.record.reference.T)
                  if axis != p.axis and np.ptp(signal)]
        return leftover(fitted.residual, fitted.simulated, p.used, across)
