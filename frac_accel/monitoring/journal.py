"""Folder of what was found and done on a vehicle: complete or not there, and never too large."""

import datetime
import json
import os
import shutil
from pathlib import Path

from ..errors import FracAccelError
from ..io.announcement import sync

_JOURNAL, _PARTIAL = "journal.jsonl", ".partial"


class Journal:
    """Results of diagnoses, a folder each, and a line for each step.

    Parameters
    ----------
    folder : str or Path
    limit_mb : float
        The oldest results go where all together take more; never one whose model is in use or to
        come back to.

    Raises
    ------
    FracAccelError
        If it cannot be written to.
    """

    def __init__(self, folder, limit_mb):
        self.folder, self._limit = Path(folder).resolve(), limit_mb * 1e6
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            # what a killed process was making
            for path in self.folder.glob(f"*{_PARTIAL}"):
                shutil.rmtree(path, ignore_errors=True)
            with open(self.folder / _JOURNAL, "a+", encoding="utf-8") as file:
                # a line that was cut off must not swallow the next one
                file.seek(0)
                if not ("\n" + file.read()).endswith("\n"):
                    file.write("\n")
        except OSError as error:
            raise FracAccelError(f"{folder}: cannot be written to: {error.strerror}") from None

    def note(self, step, **what):
        """Write a line that the disk has confirmed; returns it."""
        line = {"time": datetime.datetime.now(datetime.timezone.utc).isoformat(), "step": step,
                **what}
        with open(self.folder / _JOURNAL, "a", encoding="utf-8") as file:
            file.write(json.dumps(line) + "\n")
            file.flush()
            os.fsync(file.fileno())
        return line

    def steps(self):
        """All lines; one that was cut off by a power failure is left out."""
        lines = []
        for text in (self.folder / _JOURNAL).read_text(encoding="utf-8").splitlines():
            try:
                lines.append(json.loads(text))
            except ValueError:
                continue
        return lines

    def models(self):
        """Models that the corrector was given and not taken back from, the newest last."""
        stack = []
        for line in self.steps():
            if line["step"] == "applied":
                stack.append((line["before"], line["model"]))
            elif line["step"] == "rolled back" and stack:
                stack.pop()
        return stack

    def begin(self):
        """Folder in which a result is made."""
        name = datetime.datetime.now(datetime.timezone.utc).strftime("%Y-%m-%dT%H-%M-%S.%f")
        path = self.folder / f"{name}{_PARTIAL}"
        path.mkdir()
        return path

    def complete(self, path):
        """Give such a folder its name, once it is on the disk; returns it."""
        sync(*path.iterdir(), path)
        target = path.with_name(path.name.removesuffix(_PARTIAL))
        os.rename(path, target)
        self._keep_small(target)
        return target

    def _keep_small(self, newest):
        kept = {Path(model).parent.name for pair in self.models() for model in pair}
        results = sorted(path for path in self.folder.iterdir()
                         if path.is_dir() and not path.name.endswith(_PARTIAL))
        sizes = {path: sum(file.stat().st_size for file in path.iterdir()) for path in results}
        total = sum(sizes.values())
        for path in results:
            if total <= self._limit:
                break
            if path.name not in kept and path != newest:
                shutil.rmtree(path, ignore_errors=True)
                total -= sizes[path]
