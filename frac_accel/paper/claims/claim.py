"""One audited claim."""

import dataclasses

CONFIRMED = "confirmed"
FOLLOWS = "follows from other cells"
ARTEFACT = "artefact"
CONTRADICTED = "contradicted"
NOT_REPRODUCIBLE = "not reproducible"
NOT_TESTED = "not tested by the paper's data"

# What each status means, for readers.
STATUSES = {
    CONFIRMED: "what was computed agrees, and the conclusion follows",
    FOLLOWS: "one printed number follows from others by arithmetic",
    ARTEFACT: "the number is reproduced, but it comes from something else than is said",
    CONTRADICTED: "the paper's own numbers, or what follows from them, say otherwise",
    NOT_REPRODUCIBLE: "does not follow from what is published, and the data are not published",
    NOT_TESTED: "no number of the paper speaks for or against it",
}


@dataclasses.dataclass(frozen=True)
class Claim:
    """A claim of the paper and what became of it.

    Attributes
    ----------
    key : str
        Short name.
    where : str
        Section, equation, table or figure.
    claim : str
        What the paper says, in its words or close to them.
    status : str
        One of `STATUSES`.
    cause : str
        Why it is as it is; says so where that is unknown.
    evidence : str
        What was computed.
    numbers : dict
        The same for machines.
    """

    key: str
    where: str
    claim: str
    status: str
    cause: str
    evidence: str
    numbers: dict = dataclasses.field(default_factory=dict)

    def __post_init__(self):
        if self.status not in STATUSES:
            raise ValueError(f"status {self.status!r}: expected one of {', '.join(STATUSES)}")

    def as_dict(self):
        """Plain values."""
        return dataclasses.asdict(self)


def listed(values, places=2):
    """Numbers as words."""
    return ", ".join(f"{value:.{places}f}" for value in values)
