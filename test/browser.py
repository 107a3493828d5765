"""A headless Chromium for the tests: what it makes of a page, and what it complains about."""

import re
import shutil
import subprocess
import tempfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
_NAMES = ("chromium", "chromium-browser", "google-chrome")
_OPTIONS = ("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
            "--disable-background-networking", "--disable-component-update", "--disable-sync",
            "--disable-dev-shm-usage", "--enable-logging=stderr", "--virtual-time-budget=20000")
_CONSOLE = re.compile(r"CONSOLE[:(]\d+\)?\] (.*)")


def require_browser():
    """Path of a Chromium; skips the test on a machine without (`make browser` installs one)."""
    for name in _NAMES:
        if found := shutil.which(name):
            return found
    pytest.skip("no Chromium on this machine: `make browser`, as root, installs it")


def open_page(path):
    """Open a file in the browser.

    Returns
    -------
    dom : str
        The document after its scripts have run.
    console : list of str
        What the browser and the scripts wrote to the console.
    """
    browser = require_browser()
    with tempfile.TemporaryDirectory() as profile:
        result = subprocess.run(
            [browser, *_OPTIONS, f"--user-data-dir={profile}", "--dump-dom", path.as_uri()],
            capture_output=True, text=True, timeout=120)
    assert result.returncode == 0, result.stderr
    return result.stdout, _CONSOLE.findall(result.stderr)
