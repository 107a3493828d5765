"""What the pages show: found, run, and written anew by ``python test/readme_examples.py``."""

import re
import subprocess
import sys
import tempfile
from pathlib import Path

import real_records

ROOT = Path(__file__).resolve().parents[1]
README = ROOT / "README.md"
# Pages whose examples are run.
PAGES = (README, ROOT / "docs" / "tutorial.md", *sorted((ROOT / "docs" / "how_to").glob("*.md")))
RECORDS_PAGE = ROOT / "docs" / "real_records.md"
CONSOLE = re.compile(r"```console\n(.*?)```", re.DOTALL)
RECORDS = re.compile(r"(<!-- real records -->\n)(.*?)(<!-- end -->)", re.DOTALL)
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def blocks(language, page):
    """Fenced blocks of one language, in the order of the page."""
    text = page.read_text(encoding="utf-8")
    return re.findall(rf"```{language}\n(.*?)```", text, re.DOTALL)


def commands(block):
    """Pairs of command and shown output of one console block."""
    parts = re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]
    return [(command, shown) for command, _, shown in (part.partition("\n") for part in parts)]


def run(script, folder, **kwargs):
    """Output, both streams, of a script in a folder that has the project's bags."""
    link = Path(folder) / "bags"
    if not link.exists():
        link.symlink_to(ROOT / "bags")
    script = re.sub(r"^frac_accel ", f"{sys.executable} -m frac_accel.cli ", script, flags=re.M)
    # a machine from wheels has no `ros2`; the page says what to write instead
    script = re.sub(r"\bros2 run frac_accel (\w+)", rf"{sys.executable} -m frac_accel.nodes.\1",
                    script)
    kwargs.setdefault("env", {"PATH": "/usr/bin:/bin", "PYTHONPATH": str(ROOT), "HOME": "/tmp"})
    result = subprocess.run(["bash", "-c", script], cwd=folder, timeout=120,
                            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, **kwargs)
    # progress takes itself back
    return re.sub(r"[^\n]*\r", "", result.stdout.decode())


def same(shown, printed, tolerance=0.03):
    """Whether two texts have the same words, and numbers that differ by rounding only."""
    if NUMBER.sub("#", shown).split() != NUMBER.sub("#", printed).split():
        return False
    return all(abs(float(a) - float(b)) <= tolerance * max(abs(float(a)), abs(float(b))) + 2e-3
               for a, b in zip(NUMBER.findall(shown), NUMBER.findall(printed)))


def renew(page):
    """Write a page's outputs as they are today."""
    with tempfile.TemporaryDirectory() as folder:
        def again(match):
            pairs = [(command, run(command, folder)) for command, _ in commands(match.group(1))]
            return "```console\n" + "".join(f"$ {c}\n{out}" for c, out in pairs) + "```"
        page.write_text(CONSOLE.sub(again, page.read_text(encoding="utf-8")), encoding="utf-8")


def main():
    """Write all of them, or those that are named, and the table of the real records."""
    for page in map(Path, sys.argv[1:] or PAGES):
        renew(page)
    if real_records.FOLDER.is_dir() and not sys.argv[1:]:
        text = RECORDS.sub(lambda match: match[1] + real_records.table() + match[3],
                           RECORDS_PAGE.read_text(encoding="utf-8"))
        RECORDS_PAGE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
