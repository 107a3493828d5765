"""One self-contained HTML page of text, tables and interactive figures; needs no network."""

import datetime
import html
import json
from pathlib import Path
from string import Template
from urllib.parse import quote

from ..errors import FracAccelError
from ..io.outputs import write_text

_TEMPLATE = Path(__file__).with_name("page.html")
# A page with more sections than this has a table of contents.
_FEW_SECTIONS = 4
# Cells of tables with so many characters stay in one line.
_SHORT = 32
# Names of what `commands._common.provenance` knows; other keys are shown by their own.
_LABELS = {"sha256": "SHA-256", "frac_accel_version": "frac_accel"}
_CODE = ("sha256", "command")


class Page:
    """A page to be filled section by section and written.

    Parameters
    ----------
    title : str
    provenance : dict of str to (str or list of str), optional
        Where the content comes from, shown below the title: bag, sha256, command,
        frac_accel_version. The date of the page is added where there is none.

    Examples
    --------
    >>> page = Page("Sensor 7", {"bag": "drive.mcap"})
    >>> _ = page.section("Parameters").text("As fitted.").table(["f0 [Hz]"], [["180.00"]])
    >>> "<h2" in page.html()
    True
    """

    def __init__(self, title, provenance=None):
        self.title = title
        now = datetime.datetime.now(datetime.timezone.utc)
        self.provenance = {**(provenance or {})}
        self.provenance.setdefault("date", now.strftime("%Y-%m-%d %H:%M UTC"))
        self._sections = []
        self._counts = {"table": 0, "figure": 0}

    def section(self, heading):
        """New section at the end of the page.

        Parameters
        ----------
        heading : str

        Returns
        -------
        Section
            To be filled; each of its methods returns it again.
        """
        self._sections.append(Section(heading, self._counts))
        return self._sections[-1]

    def html(self):
        """The page as text.

        Raises
        ------
        FracAccelError
            If the page has figures and plotly is not installed.
        """
        sections = "\n".join(section.html(f"section-{number}")
                             for number, section in enumerate(self._sections, 1))
        return Template(_TEMPLATE.read_text(encoding="utf-8")).substitute(
            title=html.escape(self.title), provenance=self._provenance(),
            contents=self._contents(), sections=sections,
            plotly=f"<script>{_plotly_js()}</script>" if self._counts["figure"] else "")

    def write(self, path):
        """Write the page; the file is complete or not there.

        Raises
        ------
        FracAccelError
            If it cannot be written, or plotly is not installed.
        """
        try:
            write_text(path, self.html())
        except OSError as error:
            raise FracAccelError(f"{path}: cannot write the report: {error.strerror}") from None

    def _provenance(self):
        entries = []
        for key, value in self.provenance.items():
            text = "\n".join(map(str, value)) if isinstance(value, (list, tuple)) else str(value)
            kind = ' class="mono"' if key in _CODE else ""
            entries.append(f"<dt>{html.escape(_LABELS.get(key, key.replace('_', ' ')))}</dt>"
                           f"<dd{kind}>{html.escape(text)}</dd>")
        return '<dl class="provenance">\n' + "\n".join(entries) + "\n</dl>"

    def _contents(self):
        if len(self._sections) <= _FEW_SECTIONS:
            return ""
        items = "\n".join(
            f'<li><a href="#section-{number}">{html.escape(section.heading)}</a></li>'
            for number, section in enumerate(self._sections, 1))
        return f'<nav aria-label="Contents"><ol>\n{items}\n</ol></nav>'


class Section:
    """Part of a page under one heading; made by `Page.section`.

    All texts are shown as they are: nothing in them is taken for HTML.
    """

    def __init__(self, heading, counts):
        self.heading = heading
        self._counts = counts
        self._parts = []

    def subheading(self, words):
        """Add a heading within the section."""
        return self._add(f"<h3>{html.escape(words)}</h3>")

    def text(self, words):
        """Add a paragraph."""
        return self._add(f"<p>{html.escape(words)}</p>")

    def notice(self, words):
        """Add a paragraph that must not be overlooked, such as a verdict."""
        return self._add(f'<p class="notice">{html.escape(words)}</p>')

    def items(self, lines):
        """Add a list, one entry per line of words; nothing where there is none."""
        entries = "\n".join(f"<li>{html.escape(line)}</li>" for line in lines)
        return self._add(f"<ul>\n{entries}\n</ul>") if entries else self

    def table(self, headers, rows, caption=""):
        """Add a table.

        Parameters
        ----------
        headers : sequence of str
        rows : sequence of sequences of (str or number)
            Columns whose cells all start like a number, or are empty, are set flush right;
            short words are not broken.
        caption : str
        """
        cells = [[_cell(value) for value in row] for row in rows]
        kinds = [_kind(column) for column in zip(*cells)] or [""] * len(headers)

        def line(tag, texts):
            return "<tr>" + "".join(f"<{tag}{kind}>{html.escape(text)}</{tag}>"
                                    for kind, text in zip(kinds, texts)) + "</tr>"
        body = "\n".join(line("td", row) for row in cells)
        return self._add(
            f'<div class="scroll"><table>\n<caption>{self._label("table", caption)}</caption>\n'
            f"<thead>{line('th', headers)}</thead>\n<tbody>\n{body}\n</tbody></table></div>")

    def linked_table(self, headers, rows, caption=""):
        """Add a table whose first column is of pairs: words, and the file they link to or None.

        Files are named from the page's own folder.
        """
        plain = [[row[0][0], *row[1:]] for row in rows]
        self.table(headers, plain, caption)
        for words, file in {row[0] for row in rows if row[0][1]}:
            text = html.escape(_cell(words))
            self._parts[-1] = self._parts[-1].replace(
                f">{text}</td>", f'><a href="{html.escape(quote(file))}">{text}</a></td>')
        return self

    def figure(self, figure, caption=""):
        """Add an interactive figure. A click on a point with ``customdata`` opens that file.

        Parameters
        ----------
        figure : plotly.graph_objects.Figure
            Such as those of `figures`.
        caption : str
        """
        label = self._label("figure", caption)
        name = f"figure-{self._counts['figure']}"
        content = json.loads(figure.to_json())
        height = content["layout"].get("height", 450)
        # "<" would end the script where a text of the figure holds "</script>"
        data = json.dumps(content, separators=(",", ":")).replace("<", "\\u003c")
        return self._add(
            f'<figure><div class="plot" id="{name}" role="img" aria-label="'
            f'{html.escape(caption)}" style="height:{height}px"></div>\n'
            f'<script type="application/json" id="{name}-data">{data}</script>\n'
            f"<noscript>The figure needs JavaScript.</noscript>\n"
            f"<figcaption>{label}</figcaption></figure>")

    def html(self, name):
        """The section as text, to be linked to as `name`."""
        parts = "\n".join(self._parts)
        return (f'<section id="{name}">\n<h2>{html.escape(self.heading)}</h2>\n{parts}\n'
                "</section>")

    def _label(self, kind, caption):
        self._counts[kind] += 1
        return f"<b>{kind.capitalize()} {self._counts[kind]}.</b> {html.escape(caption)}"

    def _add(self, part):
        self._parts.append(part)
        return self


def require_plotly():
    """Refuse early what a report would fail at in the end.

    Returns
    -------
    module
        ``plotly.graph_objects``

    Raises
    ------
    FracAccelError
        If plotly is not installed; says how to get it.
    """
    try:
        import plotly.graph_objects
    except ModuleNotFoundError:
        raise FracAccelError("the report needs the Python library plotly; install it with "
                             "pip install plotly") from None
    return plotly.graph_objects


def _plotly_js():
    require_plotly()
    from plotly.offline import get_plotlyjs
    try:
        text = get_plotlyjs()
    except OSError as error:
        raise FracAccelError(f"the installed plotly has no plotly.min.js ({error.strerror}); "
                             "install it with pip install plotly") from None
    # in a text of the library it would end our script
    return text.replace("</script", "<\\/script")


def _cell(value):
    return value if isinstance(value, str) else f"{value:.6g}"


def _kind(column):
    """Attribute of the cells of a column of a table."""
    if any(column) and all(_like_number(text) for text in column):
        return ' class="number"'
    return ' class="short"' if max(map(len, column)) <= _SHORT else ""


def _like_number(text):
    return not text or text.lstrip("-+−±<>≤≥(")[:1].isdigit() or text in ("–", "nan", "inf")
