"""Outputs that are complete or not there, and those of one command all or none.

An output is made in a hidden folder beside its target and renamed when it is complete and on the
disk; within `together` the renames wait for the end. The folder is locked while its process lives.
One that nobody holds was left by a process that was killed: whoever next works there finishes what
was `announced <announcement>`, and removes it.
"""

import contextlib
import contextvars
import errno
import fcntl
import os
import shutil
import signal
import stat
import tempfile
from pathlib import Path

from ..errors import FracAccelError
from .announcement import PREFIX, SUFFIX, announce, finish, sync, withdraw

_STOPPING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_current = contextvars.ContextVar("outputs made together", default=None)


class Output:
    """One output on its way; made by `stage`.

    Attributes
    ----------
    target : Path
        Where it belongs.
    path : Path
        Where to write it meanwhile; of the same name, a file or a folder.
    """

    def __init__(self, target):
        self.target = Path(target)
        self.to_device = _is_device(self.target)
        # os.path's parent, as Path's knows no ".."
        self._parent = Path(tempfile.gettempdir() if self.to_device
                            else os.path.dirname(os.path.abspath(self.target)))
        sweep(self._parent)
        self._folder, self._lock = _locked_folder(self._parent)
        self.path = self._folder / self.target.name
        self._old = self._folder / ("older" if self.target.name == "old" else "old")
        self._is_placed = self._is_kept = False
        self.is_complete = False

    def done(self):
        """It is complete: put it in its place, within `together` at the end.

        Raises
        ------
        OSError
            If that cannot be; nothing has changed then.
        """
        try:
            _sync(self.path)
            self.is_complete = True
            if _current.get() is None:
                _put([self])
        except BaseException:
            self.drop()
            raise
        if _current.get() is None:
            self.drop()

    def drop(self):
        """Remove what is left of it on its way."""
        self.is_complete = False
        if self._folder is not None:
            shutil.rmtree(self._folder, ignore_errors=True)
            os.close(self._lock)
            self._folder = None

    def put(self, is_alone):
        """Rename it to its target, and keep what was there for `take_back`."""
        if self.to_device:
            with open(self.path, "rb") as source, open(self.target, "ab") as device:
                shutil.copyfileobj(source, device)
            return
        if self.target.is_dir() and not self.target.is_symlink():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(self.target))
        self._is_kept = not os.path.lexists(self.target)
        if not self._is_kept:
            try:
                os.link(self.target, self._old, follow_symlinks=False)
                self._is_kept = True
            except OSError:
                # a file system without hard links: for a moment neither is there
                if not is_alone:
                    os.rename(self.target, self._old)
                    self._is_kept = True
        self._is_placed = True
        os.replace(self.path, self.target)

    def take_back(self):
        """Undo `put`."""
        if self._is_placed and self._is_kept and not os.path.lexists(self.path):
            os.replace(self.target, self.path)
        if os.path.lexists(self._old):
            os.replace(self._old, self.target)
        self._is_placed = False

    def settle(self):
        """Have the disk confirm the new name."""
        if self._is_placed:
            sync(self._parent)


class _Together:
    def __init__(self):
        self.outputs = []
        self.words = []


@contextlib.contextmanager
def together():
    """All outputs that are made within appear at its end, or none if it is left by an exception.

    Raises
    ------
    FracAccelError
        If one cannot be put in its place; the others are taken back and what they replaced is
        there again.
    """
    mine = _Together()
    token = _current.set(mine)
    try:
        yield
        try:
            # what cannot be taken back comes last
            _put(sorted(filter(lambda output: output.is_complete, mine.outputs),
                        key=lambda output: output.to_device))
        except OSError as error:
            name = error.filename2 or error.filename or "the outputs"
            raise FracAccelError(f"{name}: cannot be written: {error.strerror}") from None
    finally:
        _current.reset(token)
        for output in mine.outputs:
            output.drop()
    for words in mine.words:
        print(words)


@contextlib.contextmanager
def at_once():
    """Outputs that are made within are put in their places when they are done, even in `together`.

    For files of our own that the same command reads again.
    """
    token = _current.set(None)
    try:
        yield
    finally:
        _current.reset(token)


def stage(target):
    """Begin an `Output`.

    Raises
    ------
    OSError
        If its folder cannot be written to.
    """
    with _unstopped():
        output = Output(target)
        if _current.get() is not None:
            _current.get().outputs.append(output)
    return output


def write_text(path, text):
    """Write a text file as UTF-8: complete or not at all; what UTF-8 has not is escaped.

    Raises
    ------
    OSError
        If it cannot be written; nothing is left behind.
    """
    output = stage(path)
    try:
        output.path.write_text(text, encoding="utf-8", errors="backslashreplace")
    except BaseException:
        output.drop()
        raise
    output.done()


def say(words):
    """Print, within `together` only once all outputs are in their places."""
    if _current.get() is None:
        print(words)
    else:
        _current.get().words.append(words)


def guard(outputs, inputs):
    """Refuse outputs that are an input or each other, by whatever name, or that have no folder.

    Parameters
    ----------
    outputs, inputs : iterable of str or Path
        Of an input that is a folder all bags, models and metadata in it count as inputs.

    Raises
    ------
    FracAccelError
    """
    read = {}
    for source in inputs:
        for path in _files_of(Path(source)):
            read |= dict.fromkeys(_identities(path), path)
    written = {}
    for number, path in enumerate(map(Path, outputs)):
        if _is_device(path):
            continue
        if path.is_dir():
            raise FracAccelError(f"{path}: exists already, as a folder")
        if not Path(os.path.dirname(os.path.abspath(path))).is_dir():
            raise FracAccelError(f"{path}: the folder {os.path.dirname(os.path.abspath(path))} "
                                 "does not exist")
        for identity in _identities(path):
            if identity in read:
                raise FracAccelError(f"{path}: is the input {read[identity]}, expected another "
                                     "file for the output")
            if written.setdefault(identity, number) != number:
                raise FracAccelError(f"{path}: is to hold two outputs, expected a file for each")
        for source in map(Path, inputs):
            if source.is_dir() and _real(path).parent == _real(source) and _is_of_bag(path):
                raise FracAccelError(f"{path}: would become a part of the input {source}, expected "
                                     "another folder for the output")


def sweep(folder):
    """Finish or remove what killed processes left in a folder; what a living one holds stays."""
    with contextlib.suppress(OSError):
        with os.scandir(folder) as entries:
            names = [entry.name for entry in entries
                     if entry.name.startswith(PREFIX) and entry.name.endswith(SUFFIX)]
        for name in names:
            with contextlib.suppress(OSError):
                lock = os.open(os.path.join(folder, name), os.O_RDONLY | os.O_DIRECTORY
                               | os.O_NOFOLLOW)
                try:
                    fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    finish(Path(folder, name))
                    shutil.rmtree(os.path.join(folder, name), ignore_errors=True)
                finally:
                    os.close(lock)


@contextlib.contextmanager
def _unstopped():
    """A signal that ends the process waits."""
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, _STOPPING)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)


def _put(outputs):
    """Rename all or none."""
    files = [output for output in outputs if not output.to_device]
    paths = [output.path for output in files]
    with _unstopped():
        try:
            if len(files) > 1:
                announce(paths, [output.target for output in files])
            for output in outputs:
                output.put(len(outputs) == 1)
            for output in outputs:
                output.settle()
        except BaseException:
            for output in reversed(outputs):
                output.take_back()
            if len(files) > 1:
                withdraw(paths)
            raise


def _locked_folder(parent):
    while True:
        path = tempfile.mkdtemp(prefix=PREFIX, suffix=SUFFIX, dir=parent)
        try:
            lock = os.open(path, os.O_RDONLY | os.O_DIRECTORY)
        except FileNotFoundError:
            # a sweeping neighbour was quicker
            continue
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(lock)
            continue
        except OSError:
            # no locks on this file system: nobody sweeps there either
            pass
        if os.path.isdir(path):
            return Path(path), lock
        os.close(lock)


def _sync(path):
    """Have the disk confirm a file, or all files of a folder."""
    if path.is_dir():
        for file in path.iterdir():
            _sync(file)
    sync(path)


def _is_device(path):
    """Whether an output goes to a terminal, a pipe or the like, which is never replaced."""
    try:
        if not (stat.S_ISREG(os.stat(path).st_mode) or stat.S_ISDIR(os.stat(path).st_mode)):
            return True
    except OSError:
        return False
    # /dev/stdout is a link, to a file where the shell says so
    return path.is_symlink() and os.path.abspath(path).startswith(("/dev/", "/proc/"))


def _files_of(source):
    if not source.is_dir():
        return [source]
    with contextlib.suppress(OSError):
        return [path for path in source.iterdir() if _is_of_bag(path)]
    return []


def _is_of_bag(path):
    return path.suffix in (".mcap", ".db3", ".yaml")


def _identities(path):
    """What two names of one file have in common."""
    yield _real(path)
    with contextlib.suppress(OSError):
        found = os.stat(path)
        yield found.st_dev, found.st_ino


def _real(path):
    return Path(os.path.realpath(path))

