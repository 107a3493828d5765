"""Write docs/thresholds.md: every named number of the rooms that judge, and what it means.

usage: python tools/thresholds.py
"""

import ast
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "thresholds.md"
# diagnosis and budget have their table, with reasons, in docs/diagnosis.md; a cause's own numbers
# are its own
ROOMS = ("record", "identification", "simulation", "correction", "streaming", "uncertainty",
         "signals", "monitoring", "fleet")
HEAD = """# Thresholds

Every named number of the rooms that decide something, with the comment of its file; values with a
unit name it. Those of diagnosis and budget stand with their reasons in
[diagnosis.md](diagnosis.md#thresholds). This page is made from the code by
`python tools/thresholds.py`, and a test says when it is old.
"""


def groups(path):
    """Yield (constants, words) of a file: consecutive named numbers and the comment above them."""
    lines = path.read_text(encoding="utf-8").splitlines()
    names, words, last = [], "", None
    for node in ast.parse("\n".join(lines)).body:
        found = _numbers(node)
        if not found:
            continue
        above = _comment(lines, node.lineno - 2)
        beside = lines[node.end_lineno - 1][node.end_col_offset:].partition("#")[2].strip()
        if above or beside or node.lineno - 1 != last:
            if names:
                yield names, words
            names, words = [], above or beside
        names.extend(found)
        last = node.end_lineno
    if names:
        yield names, words


def _comment(lines, row):
    """Comment that ends in a row, as one line."""
    found = []
    while row >= 0 and lines[row].startswith("#"):
        found.insert(0, lines[row].lstrip("# "))
        row -= 1
    return " ".join(found)


def _numbers(node):
    """[(name, value)] of an assignment of numbers to names in capitals."""
    if not isinstance(node, ast.Assign) or len(node.targets) != 1:
        return []
    target = node.targets[0]
    targets = target.elts if isinstance(target, ast.Tuple) else [target]
    values = node.value.elts if isinstance(target, ast.Tuple) \
        and isinstance(node.value, ast.Tuple) else [node.value]
    if not all(isinstance(name, ast.Name) and name.id.isupper() for name in targets) \
            or not all(map(_is_number, values)):
        return []
    return [(name.id, ast.unparse(value)) for name, value in zip(targets, values)]


def _is_number(node):
    if isinstance(node, (ast.Tuple, ast.List)):
        return bool(node.elts) and all(map(_is_number, node.elts))
    if isinstance(node, ast.BinOp):
        return _is_number(node.left) and _is_number(node.right)
    if isinstance(node, ast.UnaryOp):
        return _is_number(node.operand)
    return isinstance(node, ast.Constant) and type(node.value) in (int, float)


def page():
    """The page as text."""
    parts = [HEAD]
    for room in ROOMS:
        folder = ROOT / "frac_accel" / room
        rows = [f"| `{path.relative_to(folder).with_suffix('')}` | "
                + ", ".join(f"`{name}` = {value}" for name, value in names) + f" | {words} |"
                for path in sorted(folder.rglob("*.py")) for names, words in groups(path)]
        parts.append("\n".join([f"## {room}", "", "| file | values | meaning |", "|---|---|---|",
                                *(row.replace(" [", " \\[") for row in rows)]) + "\n")
    return "\n".join(parts)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
