"""docs/thresholds.md has the named numbers of the code, each with its meaning."""

import importlib
import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))
thresholds = importlib.import_module("thresholds")
sys.path.remove(str(ROOT / "tools"))
PAGE = (ROOT / "docs" / "thresholds.md").read_text(encoding="utf-8")


def test_the_page_is_that_of_the_code():
    assert PAGE == thresholds.page(), "run: python tools/thresholds.py"


def test_every_number_has_its_meaning():
    rows = re.findall(r"^\| `(.+?)` \| (.+) \| (.*) \|$", PAGE, re.M)
    assert len(rows) > 200
    assert [row for row in rows if len(row[2]) < 10] == []


@pytest.mark.parametrize("name", ["SIGNIFICANT", "_SIGNIFICANT", "_CHANCE"])
def test_a_name_has_one_meaning(name):
    """Standard uncertainties by which two values differ; a gain in cost by chance alone."""
    words = {"SIGNIFICANT": "tandard", "_SIGNIFICANT": "tandard", "_CHANCE": "variances"}[name]
    for path in (ROOT / "frac_accel").rglob("*.py"):
        for constants, meaning in thresholds.groups(path):
            if name in dict(constants):
                assert words in meaning, path
