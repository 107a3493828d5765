"""Several outputs appear all or none also where the process is killed between their renames.

Before the first rename a list of all of them comes into the hidden folder of the first, by one
rename and on the disk: from then on they are to appear. The hidden folders of the others say where
it is. Whoever finds such a folder that nobody holds renames what is missing, as long as nothing but
these renames has changed since.
"""

import contextlib
import errno
import json
import os
import stat
from pathlib import Path

PREFIX, SUFFIX = ".frac_accel-", ".partial"
_LIST, _SEE = f"{PREFIX}list", f"{PREFIX}see"


def announce(paths, targets):
    """Say which files, complete in their hidden folders, are to be renamed.

    Raises
    ------
    OSError
    """
    first, *others = (path.parent for path in paths)
    for folder in others:
        (folder / _SEE).write_text(str(first / _LIST), "utf-8", "surrogateescape")
        sync(folder / _SEE, folder, folder.parent)
    (first / _SEE).write_text(json.dumps([
        [str(path), _file(path), _state(target)] for path, target in zip(paths, targets)]))
    sync(first / _SEE)
    os.replace(first / _SEE, first / _LIST)
    sync(first, first.parent)


def withdraw(paths):
    """They are not to be renamed any more."""
    (paths[0].parent / _LIST).unlink(missing_ok=True)


def finish(folder):
    """Rename what the list of a folder that nobody holds says; else change nothing."""
    with contextlib.suppress(OSError, ValueError, TypeError):
        listed = folder / _LIST
        if not listed.exists():
            listed = Path((folder / _SEE).read_text("utf-8", "surrogateescape"))
        missing = []
        for name, file, before in json.loads(listed.read_text()):
            path = Path(name)
            target = path.parent.parent / path.name
            if not (_is_ours(path.parent) and _is_ours(listed.parent)):
                return
            if _file(target) != file:
                if _file(path) != file or _state(target) not in (None, before):
                    return
                missing.append((path, target))
        for path, target in missing:
            os.replace(path, target)
            sync(target.parent)


def sync(*paths):
    """Have the disk confirm files and folders."""
    for path in paths:
        descriptor = os.open(path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        except OSError as error:
            # some file systems know no such thing for folders
            if error.errno not in (errno.EINVAL, errno.ENOTSUP):
                raise
        finally:
            os.close(descriptor)


def _is_ours(folder):
    """Whether nobody else can have written what is in a hidden folder."""
    found = os.lstat(folder)
    return (folder.name.startswith(PREFIX) and folder.name.endswith(SUFFIX)
            and stat.S_ISDIR(found.st_mode) and found.st_uid == os.geteuid()
            and not found.st_mode & 0o022)


def _file(path):
    """What stays of a file when it is renamed; None: there is none."""
    return _state(path) and _state(path)[:2]


def _state(path):
    """What changes when a file is written to or replaced; None: there is none."""
    try:
        found = os.lstat(path)
    except FileNotFoundError:
        return None
    return [found.st_dev, found.st_ino, found.st_size, found.st_mtime_ns]
