"""Errors that a user can act on: the commands print them as one line and exit with status 2."""

import contextlib


class FracAccelError(ValueError):
    """Bad input; the message says what is wrong and where."""


class ModelError(FracAccelError):
    """A sensor model that cannot be used; names the field, its value and what was expected."""


class BagError(FracAccelError):
    """A bag, topic or message that cannot be read or written; names the file and the topic."""


class DesignError(FracAccelError):
    """An inverse filter that cannot be met as asked for; says what can be."""


class IdentificationError(FracAccelError):
    """Data from which the asked-for model cannot be identified; says what is missing."""


@contextlib.contextmanager
def naming(name):
    """Errors from within begin with a name, such as one of several bags has, unless they have it.

    Parameters
    ----------
    name : str
        Empty: they stay as they are.
    """
    try:
        yield
    except FracAccelError as error:
        if not name or name in str(error):
            raise
        raise type(error)(f"{name}: {error}") from None
