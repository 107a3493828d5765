"""What to measure where a record cannot tell causes apart."""

from ..model.effects import known_effects


def separating_experiment(causes):
    """Words that say which experiments separate these causes from each other and from the rest.

    Parameters
    ----------
    causes : iterable of str
    """
    known = known_effects()
    causes = sorted(causes)
    if len(causes) == 1:
        return known[causes[0]].experiment
    return " ".join(f"For {cause}: {known[cause].experiment}" for cause in causes)
