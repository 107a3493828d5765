"""Imports between the rooms run one way (pyproject.toml), and every room is in the plan."""

import importlib
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def contracts_of(folder):
    """Whether the contracts hold in a folder, and what is said."""
    pytest.importorskip("importlinter")
    code = ("import sys; from importlinter.cli import lint_imports; "
            "sys.exit(lint_imports(no_cache=True))")
    done = subprocess.run([sys.executable, "-c", code], cwd=folder, text=True,
                          capture_output=True, env={"PYTHONPATH": str(folder)})
    return done.returncode == 0, done.stdout + done.stderr


def test_imports_between_rooms_run_one_way():
    kept, said = contracts_of(ROOT)
    assert kept, said


@pytest.mark.parametrize("file, line", [
    ("record/upwards.py", "from ..simulation import simulate"),
    ("identification/fit/upwards.py", "from ..judge.choice import choose"),
    ("new_room.py", "")])
def test_a_wrong_import_or_a_room_without_a_place_is_found(tmp_path, file, line):
    for source in (ROOT / "frac_accel").rglob("*.py"):
        copy = tmp_path / source.relative_to(ROOT)
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_bytes(source.read_bytes())
    (tmp_path / "pyproject.toml").write_bytes((ROOT / "pyproject.toml").read_bytes())
    (tmp_path / "frac_accel" / file).write_text(f"{line}\n")
    kept, said = contracts_of(tmp_path)
    assert not kept and Path(file).stem in said


@pytest.mark.parametrize("old, new", [
    ("effects.base", "model.effects.base"), ("effects.fit_starts", "model.effects.fit_starts"),
    ("effects", "model.effects"), ("parameters", "model.parameters")])
def test_names_that_plug_ins_import_are_the_same_modules(old, new):
    code = f"import frac_accel.{old} as a, frac_accel.{new} as b; assert a is b"
    subprocess.run([sys.executable, "-c", code], check=True)
    assert importlib.import_module(f"frac_accel.{old}") is importlib.import_module(
        f"frac_accel.{new}")
