"""Errors that a user can act on: the commands print them as one line and exit with status 2."""


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
