"""What the figures of the reports are made of: panels above each other, lines, bands, points.

Colours are chosen to be read on white and on dark paper; the page sets those of axes and text.
"""

import textwrap

import numpy as np

from .page import require_plotly

MEASURED = "#8a919a"
MODEL = "#2f86c9"
RESIDUAL = "#d9772b"
SERIES = (MODEL, RESIDUAL, "#3d9c63", "#9467bd", MEASURED, "#c2498a")
# Half-width of a 95 % interval in standard uncertainties, as calibration certificates have it.
COVERAGE_FACTOR = 2.0

_FONT = "system-ui, -apple-system, 'Segoe UI', 'DejaVu Sans', sans-serif"
# Characters of an axis title that a phone shows in one line, along a panel and beneath it.
_UPRIGHT, _LEVEL = 24, 34
# Samples above which a signal is drawn by its ends, and columns that these are drawn in: half the
# pixels of a wide page.
MOST_IN_LINE, _COLUMNS = 1600, 400
# Decades of an axis from which 1, 2 and 5 are labelled, and up to which not only the powers of ten,
# and values below which these are written as such; page.html has the same for what is zoomed into.
_FEWEST_DECADES, _FEW_DECADES = 0.7, 3.2
_TINY = 1e-4


def rows(count, height, x_label, y_labels, weights=None, x_type="linear"):
    """Empty figure of panels above each other on a common axis."""
    require_plotly()
    from plotly.subplots import make_subplots
    figure = make_subplots(rows=count, cols=1, shared_xaxes=True, vertical_spacing=0.06,
                           row_heights=list(weights) if weights else None)
    figure.update_layout(
        template="none", height=height, margin={"l": 76, "r": 16, "t": 34, "b": 52},
        font={"family": _FONT, "size": 13},
        legend={"orientation": "h", "x": 0, "y": 1, "yanchor": "bottom"}, hovermode="closest")
    figure.update_xaxes(type=x_type, showline=True, ticks="outside", zeroline=False, mirror=True,
                        automargin=True)
    figure.update_yaxes(showline=True, ticks="outside", zeroline=False, mirror=True,
                        automargin=True, title={"standoff": 8})
    figure.update_xaxes(title={"text": _wrapped(x_label, _LEVEL)}, row=count, col=1)
    for row, label in enumerate(y_labels, 1):
        figure.update_yaxes(title={"text": _wrapped(label, _UPRIGHT)}, row=row, col=1)
    return figure


def finished(figure):
    """The figure, once all is drawn, with labels such as 0.1, 0.2, 0.5, 1 on logarithmic axes."""
    for letter in "xy":
        for axis in getattr(figure, f"select_{letter}axes")():
            if axis.type != "log":
                continue
            number = axis.plotly_name.removeprefix(f"{letter}axis") or ""
            # panels share their x axes
            own = [trace for trace in figure.data
                   if letter == "x" or (trace.yaxis or "y") == f"y{number}"]
            values = np.concatenate([[], *(np.asarray(trace[letter], float) for trace in own)])
            values = values[np.isfinite(values) & (values > 0)]
            decades = np.log10(values.max() / values.min()) if len(values) else 0.0
            # 0.1, 0.01; over many decades powers of ten, not 0.000001 beside 1e-7
            is_tiny = decades > _FEW_DECADES and values.min() < _TINY
            axis.update(tickformat="" if is_tiny else "~g", exponentformat="power")
            if decades >= _FEWEST_DECADES:
                axis.update(dtick="D2" if decades <= _FEW_DECADES else 1)
    return figure


def line(figure, x, y, row, name, colour, legend=True, dash="solid", width=1.4):
    """Add a line."""
    add(figure, row, x=x, y=y, mode="lines", name=name, showlegend=legend,
        line={"color": colour, "width": width, "dash": dash})


def signal(figure, x, y, row, name, colour, legend=True, width=1.4):
    """Add a signal: a line, or where it is long its lower and upper end with what is between.

    A line through all extremes of a long signal would hide whatever is behind it.
    """
    if len(y) <= MOST_IN_LINE:
        line(figure, x, y, row, name, colour, legend, width=width)
        return
    x, low, high = ends(x, y)
    group = f"{name} {row}"
    add(figure, row, x=x, y=low, mode="lines", name=f"{name}, lower end", showlegend=False,
        legendgroup=group, hoverinfo="skip", line={"width": 0.7, "color": colour})
    add(figure, row, x=x, y=high, mode="lines", name=name, showlegend=legend, legendgroup=group,
        line={"width": 0.7, "color": colour}, fill="tonexty", fillcolor=faint(colour, 0.35))


def ends(x, y):
    """Lower and upper end of a signal, or of the extremes that `envelope` has left of it.

    Parameters
    ----------
    x, y : array_like, shape (n,)

    Returns
    -------
    x, low, high : ndarray, shape (m,)
        At most `_COLUMNS`, about one for each column of pixels; NaN where there is a gap.
    """
    starts = np.arange(0, len(y), -(-len(y) // _COLUMNS))
    y = np.asarray(y, float)
    return (np.asarray(x, float)[starts], np.fmin.reduceat(y, starts),
            np.fmax.reduceat(y, starts))


def points(figure, x, y, row, std=None, legend=True):
    """Add measured points with 95 % intervals."""
    error = None if std is None else {"array": COVERAGE_FACTOR * std, "thickness": 1, "width": 2}
    add(figure, row, x=x, y=y, mode="markers", name="measured", showlegend=legend, error_y=error,
        marker={"color": RESIDUAL, "size": 4})


def band(figure, x, low, high, row, name="95 % interval", legend=True, colour=MODEL):
    """Add an interval."""
    add(figure, row, x=np.r_[x, x[::-1]], y=np.r_[high, low[::-1]], mode="lines", fill="toself",
        name=name, showlegend=legend, hoverinfo="skip", line={"width": 0, "color": colour},
        fillcolor=faint(colour, 0.25))


def focus(figure, values, row):
    """Let the middle of the values choose the range: a few wild ones must not hide the rest."""
    size = np.nanpercentile(np.abs(values), 90) if len(values) else 0
    if size > 0:
        figure.update_yaxes(range=[-2.5 * size, 2.5 * size], row=row, col=1)


def faint(colour, share):
    """A colour such as "#2f86c9" that lets through what is behind it."""
    red, green, blue = (int(colour[i:i + 2], 16) for i in (1, 3, 5))
    return f"rgba({red}, {green}, {blue}, {share:g})"


def add(figure, row, **trace):
    """Add a trace."""
    figure.add_scatter(**trace, row=row, col=1)


def _wrapped(label, width):
    """An axis title in lines that fit a phone."""
    if len(label) > width:
        label = label.replace(" [", "<br>[")
    return "<br>".join(part for line in label.split("<br>")
                       for part in textwrap.wrap(line, width, break_long_words=False))
