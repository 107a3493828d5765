"""The documentation: links lead somewhere, no page is lost, each cause has its picture."""

import importlib.util
import re
from pathlib import Path

import pytest

from frac_accel.model.effects import known_effects

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = sorted([*ROOT.glob("*.md"), *DOCS.glob("*.md"), *DOCS.glob("how_to/*.md")])
LINK = re.compile(r"(?<!!)\[[^\]]*\]\(([^)\s]+)\)|!\[[^\]]*\]\(([^)\s]+)\)")
# Described where they are made: they are no findings.
NO_CAUSES = {"empirical_link", "empirical_map"}


def anchors(page):
    """Names of the headings of a page, as GitHub and the site make them."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.M)
    plain = [re.sub(r"[^\w\- ]", "", heading.lower()) for heading in headings]
    return {heading.replace(" ", "-") for heading in plain}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page):
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    for found in LINK.finditer(text):
        target, _, anchor = (found[1] or found[2]).partition("#")
        if target.startswith(("http:", "https:", "mailto:")):
            continue
        # what the site makes is not there before it is built
        if target.startswith("../made/") or target.startswith("made/"):
            continue
        file = (page.parent / target).resolve() if target else page
        assert file.exists(), f"{target} of {page.name}"
        if anchor and file.suffix == ".md":
            assert anchor in anchors(file), f"{target}#{anchor} of {page.name}"


def test_every_page_is_in_the_contents():
    entries = set(re.findall(r"^([\w/]+)$", (DOCS / "index.md").read_text(encoding="utf-8"), re.M))
    pages = {str(page.relative_to(DOCS).with_suffix(""))
             for page in [*DOCS.glob("*.md"), *DOCS.glob("*.rst"), *DOCS.glob("how_to/*.md")]}
    assert entries - {"made/causes"} == pages - {"index"}


def test_the_newcomers_page_leads_to_the_tutorial_and_is_short():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert "](docs/tutorial.md)" in text and len(text.splitlines()) < 180


@pytest.fixture(scope="module")
def pictures():
    spec = importlib.util.spec_from_file_location("pictures", DOCS / "pictures.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_each_cause_has_a_picture(pictures):
    assert {*pictures.DRAWN, *pictures._OWN} == set(known_effects()) - NO_CAUSES


@pytest.mark.parametrize("cause", ["quantization", "free_mass_friction"])
def test_a_picture_shows_what_is_left(cause, pictures):
    signals, sizes, spectra = pictures.draw(cause).axes
    measured, simulated, left = (line.get_ydata() for line in signals.lines)
    assert abs(measured - simulated - left).max() < 1e-12 * abs(measured).max()
    assert left.std() > 1e-3 * measured.std()
    assert len(sizes.lines[0].get_ydata()) > 4000 and len(spectra.lines) == 2
