"""The record's frequency response without a model, and what a structure makes of it."""

import dataclasses

from ...errors import IdentificationError
from ...model import AXES
from ..fit.arx import ArxStructure
from ..fit.frequency_domain import fit_response
from ..response.points import ResponsePoints, response_points
from ..response.recognise import Recognised, recognise
from .agreement import compare_domains

# RMS relative error of a fit to the points with which it is a start for the time domain.
_CLOSE = 0.1


@dataclasses.dataclass(frozen=True)
class MeasuredResponse:
    """Points of the frequency response, if the record gives any, and fits to them.

    Attributes
    ----------
    excitation : Recognised
    points : ResponsePoints or None
    notes : list of str
    sampling_rate_hz : float
    """

    excitation: Recognised
    points: ResponsePoints | None
    notes: list
    sampling_rate_hz: float

    @classmethod
    def of(cls, pair, axis):
        """Measure one axis of a pair."""
        try:
            points = response_points(pair, axis)
            found, notes = points.excitation, points.notes
        except IdentificationError as error:
            found = recognise(pair.reference[:, AXES.index(axis)], pair.sampling_rate_hz)
            points, notes = None, [f"no frequency response: {error}"]
        return cls(found, points, notes, pair.sampling_rate_hz)

    @property
    def stepped(self):
        """Whether a start in the time domain is in doubt.

        The correlation of sines, on which it rests, has its peak at any whole number of their
        periods.
        """
        return self.excitation.kind == "stepped_sine"

    def start(self, structure):
        """Unknowns of a fit to the points from which the time domain can start, or None."""
        if not (self.stepped or structure.starts_from_points) or not self._suits(structure):
            return None
        try:
            found = fit_response(structure, self.points, self.sampling_rate_hz)
        except IdentificationError:
            return None
        return found.unknowns if found.relative_error < _CLOSE else None

    def compared(self, structure, fit):
        """`compare_domains` with a fit in the time domain (None without), and notes."""
        if not self._suits(structure):
            return None, []
        try:
            other = fit_response(structure, self.points, self.sampling_rate_hz, fit["delay_s"],
                                 fit.unknowns)
        except IdentificationError as error:
            return None, [f"no frequency-domain fit: {error}"]
        compared = compare_domains(fit, other)
        return compared, [] if compared["agrees"] else [compared["words"]]

    def _suits(self, structure):
        return self.points is not None and bool(structure.names) \
            and not isinstance(structure, ArxStructure)
