"""What the command line makes of its arguments: help with examples, refusals in one line."""

import argparse
import textwrap


class Parser(argparse.ArgumentParser):
    """argparse whose refusals are one line that names the nearest of what there is.

    Attributes
    ----------
    given : list of str
        Arguments of the process, among which misspelt options are looked for.
    """

    given = ()

    def describe(self, module):
        """Take description, examples and options from the module of a verb."""
        self.description = module.__doc__
        self.exemplify(module.EXAMPLES)
        module.add_arguments(self)

    def exemplify(self, examples):
        """End the help with some lines as they can be given."""
        self.epilog = "examples:\n" + textwrap.indent(examples.strip(), "  ")
        self.formatter_class = argparse.RawDescriptionHelpFormatter

    def error(self, message):
        """Say in one line what is wrong, and end with status 2."""
        # a misspelt option is behind most that argparse finds missing
        words = next(map(self._misspelt, self._unknown_options()), message)
        self.exit(2, f"{self.prog}: {' '.join(words.split())}; see {self.prog} --help\n")

    def _check_value(self, action, value):
        """Refuse what is none of an argument's choices; argparse's own words name no nearest."""
        if action.choices is not None and value not in action.choices:
            choices = list(action.choices)
            raise argparse.ArgumentError(action, f"{value!r} given, expected one of "
                                         f"{', '.join(choices)}{nearest(value, choices)}")

    def _misspelt(self, option):
        return f"unknown option {option}{nearest(option, self._options())}"

    def _unknown_options(self):
        for word in self.given:
            if word == "--":
                return
            name = word.partition("=")[0]
            if name.startswith("--") and not any(option.startswith(name)
                                                 for option in self._options()):
                yield name

    def _options(self):
        """Its own options, and those of verbs within it."""
        within = [other for action in self._actions if isinstance(action.choices, dict)
                  for other in action.choices.values()]
        return [option for action in self._actions for option in action.option_strings] + [
            option for other in within for option in other._options()]


def nearest(name, names):
    """Hint at the one of some names that is most like another, or nothing.

    Examples
    --------
    >>> nearest("identfy", ["simulate", "identify"])
    ": did you mean 'identify'?"
    """
    import difflib  # only after a mistake: the command is to start in no time
    # the dashes of two options make them no more alike
    bare = {other.lstrip("-"): other for other in names}
    near = difflib.get_close_matches(name.lstrip("-"), bare, 1)
    return f": did you mean '{bare[near[0]]}'?" if near else ""
