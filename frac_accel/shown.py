"""How results show themselves: figures, and numbers with their nouns."""

from __future__ import annotations

import base64
import html
import io
from typing import Any


class Shown:
    """A result with a line of text and a figure; it says what to draw in `_draw`."""

    def _draw(self, figure: Any) -> None:
        raise NotImplementedError

    def plot(self) -> Any:
        """Main figure of this result, as a matplotlib Figure of its own."""
        from matplotlib.figure import Figure
        figure = Figure(figsize=(8, 4.5), layout="constrained")
        self._draw(figure)
        return figure

    def _repr_html_(self) -> str:
        image = io.BytesIO()
        self.plot().savefig(image, format="png", dpi=90)
        data = base64.b64encode(image.getvalue()).decode()
        return f'<p>{html.escape(repr(self))}</p><img src="data:image/png;base64,{data}">'


def several(count: int, one: str, more: str | None = None) -> str:
    """A number with its noun, and its verb if given: ``1 gap was``, ``2 gaps were``.

    Without `more` the plural is the noun with an s.
    """
    return f"{count} {one}" if count == 1 else f"{count} {more or one + 's'}"


def listed(names: list[str]) -> str:
    """``x, y and z``."""
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def above(axes: Any) -> None:
    """Put the legend of a matplotlib Axes above it, where it hides no peak."""
    axes.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=4, frameon=False, fontsize="small",
                borderaxespad=0.2)


def plain_logarithms(axes: Any) -> None:
    """Label logarithmic axes with 0.1, 0.2, 0.5, 1, or with powers of ten where these are many."""
    from matplotlib.ticker import LogFormatterMathtext, LogLocator, NullFormatter
    for axis in (axes.xaxis, axes.yaxis):
        if axis.get_scale() != "log":
            continue
        low, high = axis.get_view_interval()
        is_short = high < 2000 * low
        axis.set_major_locator(LogLocator(subs=(1, 2, 5) if is_short else (1,)))
        # 0.0001 beside 1e-05 reads badly
        axis.set_major_formatter("{x:g}" if is_short or low > 1e-5 else LogFormatterMathtext())
        axis.set_minor_formatter(NullFormatter())
