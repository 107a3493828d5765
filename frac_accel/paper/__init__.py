"""The seed paper: its tables and figures again, its claims audited, its experiment done properly.

Everything here uses the package as any user could. What the paper prints is in `published`; all
other numbers are computed.
"""

import dataclasses

from ..io.shared_files import shared_folder
from . import curves, models, tables
from .claims import STATUSES, Claim, audit

__all__ = ["BAGS", "STATUSES", "Claim", "PaperResult", "reproduce"]

# Where the study's bags are.
BAGS = shared_folder("bags")

# Where a column is one of these its cells are ours, otherwise the paper's.
_OURS = (tables.REPRODUCED, tables.FOLLOWS, tables.NOT_IN_PAPER)


@dataclasses.dataclass(frozen=True)
class PaperResult:
    """What `reproduce` gives.

    Attributes
    ----------
    tables : dict of str to tables.Table
    figures : dict of str to curves.Figure
    claims : list of Claim
    study : study.Study or None
        None where it was not asked for.
    """

    tables: dict
    figures: dict
    claims: list
    study: object

    def as_dict(self):
        """Plain numbers and lists, as the command writes them."""
        return {"tables": {number: _table(number, table) for number, table in self.tables.items()},
                "claims": [claim.as_dict() for claim in self.claims],
                "domain_correct": domain_correct(self.claims),
                "figures": {number: _figure(figure) for number, figure in self.figures.items()},
                "study": None if self.study is None else self.study.as_dict()}


def reproduce(study=True, bags=None, progress=None):
    """Compute the paper's tables and figures, audit its claims, and do its experiment properly.

    Parameters
    ----------
    study : bool
        Whether to do the experiment, which takes a minute or two.
    bags : str or Path, optional
        Folder of the bench's bags; default: those that come with the package.
    progress : callable, optional
        Called with a few words before each step, and with the share that is done.

    Returns
    -------
    PaperResult

    Raises
    ------
    FracAccelError
        If the study's bags are missing or cannot be read.
    """
    progress = progress or (lambda words, share: None)
    found = None
    if study:
        from .study import run_study
        found = run_study(bags, progress)
    progress("reproducing tables and figures", 1.0)
    return PaperResult(tables.tables(), curves.figures(), audit(), found)


def domain_correct(claims):
    """The s-domain model that really follows from G(z), with its error, as plain numbers."""
    core = models.by_bilinear_transform(models.identified())
    claim = next(claim for claim in claims if claim.key == "advantage_of_the_fractional_model")
    return {"method": "bilinear transform, z = (1 + sT/2) / (1 - sT/2)",
            "denominator_coefficients": list(core.denominator_coefficients),
            "numerator_coefficients": list(core.numerator_coefficients),
            "orders": list(core.denominator_orders),
            "frequency_hz": list(tables.published.FREQUENCY_HZ), **claim.numbers}


def _table(number, table):
    result = {"title": table.title}
    if number != "4":
        result["frequency_hz"] = list(tables.published.FREQUENCY_HZ)
    for column in table.columns:
        values = column.computed if column.status in _OURS else column.printed
        result[column.name] = list(values)
    result["columns"] = {column.name: column.as_dict() for column in table.columns}
    return result


def _figure(figure):
    return {"title": figure.title, "status": figure.status, "remark": figure.remark,
            "x": _short(figure.x),
            "series": {name: {kind: _short(values) for kind, values in parts.items()}
                       for name, parts in figure.series.items()}}


def _short(values):
    """Values of a curve to six digits, to keep the file small."""
    return [float(f"{value:.6g}") for value in values]
