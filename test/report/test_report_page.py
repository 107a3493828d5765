"""A report is one file: complete, escaped, with nothing loaded from elsewhere."""

import re
import sys
from html.parser import HTMLParser

import numpy as np
import pytest

from frac_accel.errors import FracAccelError
from frac_accel.report import Page, figures

pytest.importorskip("plotly", reason="figures of reports are drawn by plotly")

HOSTILE = "</script><script>alert('x')</script> & \"quoted\" $title"
LINE = np.arange(3.0)


class Reader(HTMLParser):
    """Tags and visible text of a page, and every address that it would load."""

    LOADING = {"src", "srcset", "data", "poster", "action", "background", "href", "xlink:href"}

    def __init__(self, text):
        super().__init__()
        self.tags, self.texts, self.addresses, self.styles, self._open = [], [], [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        self._open.append(tag)
        self.addresses += [value for name, value in attributes if name in self.LOADING]

    def handle_endtag(self, tag):
        if tag in self._open:
            while self._open.pop() != tag:
                pass

    def handle_data(self, data):
        inside = self._open[-1] if self._open else ""
        if inside == "style":
            self.styles.append(data)
        elif inside != "script":
            self.texts.append(data)


def full_page(words="words"):
    page = Page(words, {"bag": words, "sha256": "0" * 64, "command": words})
    for number in range(5):
        page.section(f"{number} {words}").text(words).notice(words).items([words]).table(
            [words, "n"], [[words, 1.5], [words, 2.0]], words).figure(
            figures.lines(LINE, {words: LINE}, words, words), words)
    return page.html()


def test_texts_are_shown_as_they_are():
    reader = Reader(full_page(HOSTILE))
    plain = Reader(full_page())
    assert reader.tags == plain.tags
    shown = "".join(reader.texts)
    # title twice, bag, command; per section contents, heading, text, notice, item, header, two
    # cells and two captions
    assert shown.count(HOSTILE) == 4 + 5 * 10


def test_nothing_is_loaded_from_elsewhere():
    text = full_page()
    reader = Reader(text)
    assert "script" in reader.tags and reader.styles
    assert all(address.startswith(("#", "data:")) for address in reader.addresses)
    assert not re.search(r"url\(|@import", "".join(reader.styles))
    # the browser itself refuses what the page's scripts might want
    assert "default-src 'none'" in text and "http:" not in text[:text.index("<style>")]


def test_plotly_is_embedded_once_and_only_for_figures():
    from plotly.offline import get_plotlyjs
    library = get_plotlyjs()[-2000:]
    assert full_page().count(library) == 1
    assert library not in Page("words").html()


def test_contents_are_listed_where_there_are_many_sections():
    page = Page("Title")
    for number in range(4):
        page.section(f"Part {number}")
    assert "<nav" not in page.html()
    page.section("Part 4")
    text = page.html()
    links = re.findall(r'<li><a href="#([^"]*)">([^<]*)</a>', text)
    assert [name for _, name in links] == [f"Part {number}" for number in range(5)]
    assert all(f'<section id="{target}">' in text for target, _ in links)


def test_provenance_is_shown_with_the_date():
    reader = Reader(Page("Title", {"bag": ["a.mcap", "b.mcap"], "sha256": "f" * 64}).html())
    shown = "".join(reader.texts)
    assert "a.mcap\nb.mcap" in shown and "f" * 64 in shown
    assert re.search(r"\d{4}-\d\d-\d\d \d\d:\d\d UTC", shown)


def test_columns_of_numbers_are_flush_right():
    section = Page("Title").section("Part").table(
        ["name", "value"], [["a", "1.5e-4"], ["b", "–"], ["c", -3]])
    text = section.html("part")
    assert text.count('<td class="number">') == 3 and '<td class="short">a</td>' in text


def test_missing_plotly_is_said_in_one_line(monkeypatch):
    monkeypatch.setitem(sys.modules, "plotly", None)
    monkeypatch.setitem(sys.modules, "plotly.graph_objects", None)
    with pytest.raises(FracAccelError, match="pip install plotly"):
        figures.lines(LINE, {"line": LINE}, "x", "y")


def test_a_page_that_cannot_be_written_is_refused(tmp_path):
    with pytest.raises(FracAccelError, match="nowhere.*cannot write the report"):
        Page("Title").write(tmp_path / "nowhere" / "r.html")
    (tmp_path / "folder").mkdir()
    with pytest.raises(FracAccelError, match="cannot write the report"):
        Page("Title").write(tmp_path / "folder")
    assert [path.name for path in tmp_path.iterdir()] == ["folder"]
