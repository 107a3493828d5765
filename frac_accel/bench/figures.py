"""One measured figure, what it is measured against, and the table of many."""

import dataclasses


@dataclasses.dataclass(frozen=True)
class Figure:
    """A figure of a benchmark.

    Attributes
    ----------
    suite, name : str
    value : float
    unit : str
        Empty for ratios and counts.
    least, most : float, optional
        What we hold it to.
    peer : str
        What it was compared with in the same run; empty for our own alone.
    """

    suite: str
    name: str
    value: float
    unit: str
    least: float | None = None
    most: float | None = None
    peer: str = ""

    @property
    def verdict(self):
        """``met``, ``MISSED``, or empty where nothing is asked."""
        if self.least is None and self.most is None:
            return ""
        low = self.least is None or self.value >= self.least
        return "met" if low and (self.most is None or self.value <= self.most) else "MISSED"

    @property
    def wanted(self):
        """The bar in words."""
        if self.least is not None:
            return f"at least {self.least:g}"
        return "" if self.most is None else f"at most {self.most:g}"

    def as_dict(self):
        """Plain values."""
        return {**dataclasses.asdict(self), "verdict": self.verdict}


def table(figures):
    """Lines of a text table."""
    rows = [(figure.suite, figure.name, f"{figure.value:.4g} {figure.unit}".rstrip(),
             f"{figure.wanted} {figure.unit}".rstrip() if figure.wanted else "", figure.verdict)
            for figure in figures]
    rows.insert(0, ("", "figure", "value", "wanted", ""))
    widths = [max(map(len, column)) for column in zip(*rows)]
    return ["  ".join(entry.ljust(width) for entry, width in zip(row, widths)).rstrip()
            for row in rows]
