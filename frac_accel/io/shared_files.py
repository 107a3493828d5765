"""Where the files are that come with the package beside its code."""

import sys
from pathlib import Path


def shared_folder(name):
    """Folder `name` of a checkout, or the one below ``share/`` where the package is installed.

    Installers put ``share/`` beside the ``lib/`` above the code, or beside the code itself. A
    folder that is not there is given as it would be in this Python.
    """
    for parent in Path(__file__).resolve().parents:
        for folder, mark in ((parent / name, parent / "setup.py"),
                             (parent / "share" / "frac_accel" / name, parent)):
            if folder.is_dir() and mark.exists():
                return folder
    return Path(sys.prefix) / "share" / "frac_accel" / name
