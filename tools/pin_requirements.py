"""Resolve ``requirements/NAME.in`` for several Pythons into one pinned ``requirements/NAME.txt``.

Each pin carries the hashes of all its files, so that pip takes no other, whoever serves it.

usage: python tools/pin_requirements.py requirements/venv.in PYTHON [PYTHON ...]
       python tools/pin_requirements.py requirements/venv.in
           (without Pythons: the hashes of the pins that there are, anew)
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path


def resolve(python, requirements):
    """Return ``{package: version}`` that pip of a fresh venv of `python` would install."""
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([python, "-m", "venv", folder], check=True)
        report = Path(folder) / "report.json"
        subprocess.run(
            [f"{folder}/bin/python", "-m", "pip", "install", "--quiet", "--dry-run",
             "--ignore-installed", "--report", report, "-r", requirements],
            check=True)
        packages = json.loads(report.read_text())["install"]
    return {p["metadata"]["name"]: p["metadata"]["version"] for p in packages}


def python_version(python):
    """Return `python`'s version as ``(major, minor)``."""
    command = [python, "-c", "import sys; print(*sys.version_info[:2])"]
    return tuple(map(int, subprocess.check_output(command, text=True).split()))


def pins(resolved):
    """Yield requirement lines from ``{(major, minor): {package: version}}``."""
    pythons = sorted(resolved)
    names = sorted({name for versions in resolved.values() for name in versions}, key=str.lower)
    for name in names:
        by_version = {}
        for python in pythons:
            if name in resolved[python]:
                by_version.setdefault(resolved[python][name], []).append(python)
        for version, having in by_version.items():
            bounds = []
            if having[0] != pythons[0]:
                bounds.append('python_version >= "{}.{}"'.format(*having[0]))
            if having[-1] != pythons[-1]:
                bounds.append('python_version <= "{}.{}"'.format(*having[-1]))
            yield f"{name}=={version}" + (" ; " + " and ".join(bounds) if bounds else "")


def with_hashes(lines):
    """Return the requirement lines `lines` as one text with the hashes of all files of each."""
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([sys.executable, "-m", "venv", folder], check=True)
        subprocess.run([f"{folder}/bin/python", "-m", "pip", "install", "--quiet", "uv"],
                       check=True)
        pinned, hashed = Path(folder) / "pins.in", Path(folder) / "pins.txt"
        pinned.write_text("\n".join(lines) + "\n")
        subprocess.run([f"{folder}/bin/uv", "pip", "compile", "--quiet", "--universal",
                        "--no-deps", "--generate-hashes", "--no-header", "--no-annotate",
                        "--python-version", "3.10", "--output-file", hashed, pinned], check=True)
        text = hashed.read_text()
    names = [line for line in text.splitlines() if "==" in line]
    if len(names) != len(lines) or text.count(" \\\n    --hash=") < len(lines):
        raise SystemExit(f"{len(lines)} pins, but hashes of {len(names)}")
    return text


def pinned_before(path):
    """Yield the requirement lines of a file without their hashes."""
    for line in path.read_text().splitlines():
        if "==" in line:
            yield line.removesuffix(" \\")


def main():
    source = Path(sys.argv[1])
    target = source.with_suffix(".txt")
    if sys.argv[2:]:
        lines = [*pins({python_version(python): resolve(python, source)
                        for python in sys.argv[2:]})]
    else:
        lines = [*pinned_before(target)]
    target.write_text(f"# Made from {source.name} by `make pins`.\n" + with_hashes(lines))


if __name__ == "__main__":
    main()
