"""Opening files and nothing else: no pipe, on which one would wait for ever, and no device."""

import hashlib
import os
import stat

# Bytes that are read at a time.
_PART = 1 << 20


def open_regular(path):
    """A file opened for reading bytes.

    Raises
    ------
    OSError
        If it cannot be opened, or is not a regular file.
    """
    # without O_NONBLOCK a pipe without a writer would never open
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    try:
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            kind = "it is a directory" if os.path.isdir(path) else "it is not a regular file"
            raise OSError(0, kind, str(path))
        return open(descriptor, "rb")
    except BaseException:
        os.close(descriptor)
        raise


def sha256_of(*paths):
    """SHA-256 of files, one after the other; raises as `open_regular`."""
    digest = hashlib.sha256()
    for path in paths:
        with open_regular(path) as file:
            while part := file.read(_PART):
                digest.update(part)
    return digest.hexdigest()


def read_text(path, most_bytes):
    """Text of a small file in UTF-8.

    Raises
    ------
    OSError
        As `open_regular`.
    ValueError
        If it is longer than `most_bytes`, or not UTF-8 (UnicodeDecodeError).
    """
    with open_regular(path) as file:
        data = file.read(most_bytes + 1)
    if len(data) > most_bytes:
        raise ValueError(f"longer than {most_bytes // 1024} KiB")
    return data.decode("utf-8")
