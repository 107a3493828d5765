"""Engines that search a record beside a model."""

import dataclasses
import functools
from typing import Any

import numpy as np
from scipy.ndimage import binary_erosion

from ..record import Record
from .engine import Engine
from .model_in_use import candidates_for, in_every_fit, left_free
from .other_axes import OtherAxes
from .prepared import by_record, shown_by_record, with_noise
from .spikes import spikes

# Samples around one that does not count whose residual is not searched for spikes.
_EDGE = 4


@dataclasses.dataclass
class Engines:
    """What engines have in common that search one axis of a record, whatever model is in use.

    Attributes
    ----------
    record : Record
    column : int
    moving, used : ndarray of bool, shape (n,)
        Instants that can be compared, and those that count.
    found : Integrity
    noise : ReferenceNoise or None
    stages : Stages
    shown : dict of str to Effect
        Causes that the record shows by itself.
    """

    record: Record
    column: int
    moving: np.ndarray
    found: Any
    noise: Any
    stages: Any

    def __post_init__(self):
        self.found = with_noise(self.found, self.noise)
        self.shown, self.used, self._stray, self._at_limit = shown_by_record(
            self.found, self.record, self.column, self.record.valid & self.moving)

    def know(self, noise):
        """Take noise of the reference that shows only now."""
        self.noise, self.found = noise, with_noise(self.found, noise)
        self.shown = by_record(self.found, self.record.sensor[:, self.column])

    def begin(self, model, stds, seed):
        """What begins an engine, of a model and what is known of it (`stds`); no `seed` (None) is
        of a model that is stated."""
        record, found, own = self.record, self.found, model.axis(self.column)
        # the common lag of the stamps is a median of scattered ones
        loose = left_free(own, stds, 1.25 * found.jitter_rms_s / np.sqrt(found.samples))
        return functools.partial(
            Engine, record.comparable(self.column, self.used), self.column, model,
            base=in_every_fit(loose, self.shown), candidates=candidates_for(own.core),
            stages=self.stages, step=found.step, limit=self.stages.limit,
            passed_on=None if self.noise and self.noise.bends else self.noise, loose=loose,
            others=OtherAxes(tuple(cause for cause, entry in loose.items()
                                   if seed is not None and entry.effect.restates_core),
                             alike=np.count_nonzero(np.ptp(record.reference, axis=0)) > 1))

    def ready(self, model, stds, seed):
        """The same, and its engine, whose fits leave out what stands out of the residual, too."""
        begin = self.begin(model, stds, seed)
        engine, spiked = self._without_spikes(begin)
        engine.spikes, engine.aside = spiked, spiked | (self.record.valid & ~self.moving)
        engine.at_limit, engine.found = self._at_limit, self.found
        engine.identified = {cause: effect for cause, effect in (seed or {}).items()
                             if effect.everyday}
        return begin, engine

    def _without_spikes(self, begin):
        """An engine, and all that its fits leave out as spikes."""
        used, first = self.used, begin(used=self.used)
        # where samples do not count the residual is 0, and steps at their edges are no spikes
        p = first.problem
        inside = binary_erosion(p.used, iterations=_EDGE)
        more = p.put_back(inside & spikes(
            first.search.baseline.residual, p.taken(self.record.reference[:, self.column]),
            self.found.step), np.zeros(len(used), bool))
        return (begin(used=used & ~more) if more.any() else first), self._stray | more
