"""The thresholds in docs/diagnosis.md are those of the code."""

import importlib
import re
from pathlib import Path

import pytest

PAGE = Path(__file__).resolve().parents[2] / "docs" / "diagnosis.md"
ROWS = re.findall(r"^\| `([\w.]+)\.(\w+)` \| (\S+) \|", PAGE.read_text(encoding="utf-8"), re.M)


def test_the_page_has_thresholds():
    assert len(ROWS) >= 6


@pytest.mark.parametrize("module, name, value", ROWS)
def test_threshold(module, name, value):
    path = module if module.startswith(("budget.", "diagnosis")) else f"diagnosis.{module}"
    assert getattr(importlib.import_module(f"frac_accel.{path}"), name) == float(value)
