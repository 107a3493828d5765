"""YAML from strangers: plain mappings, lists, text and numbers, in time and memory like its length.

A small text of aliases unfolds to gigabytes, a long number takes minutes, tags run code that was
not made for any text: all are refused before anything is made of the text.
"""

import yaml

MOST_LEVELS = 30
MOST_DIGITS = 40
# libyaml, where it is built in, is ten times as fast
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_NUMBERS = ("tag:yaml.org,2002:int", "tag:yaml.org,2002:float")


class YamlError(ValueError):
    """Not YAML, or not of the plain kind.

    Attributes
    ----------
    where : str
        The line, as ", line 3"; empty where it is not known.
    problem : str
        What is wrong.
    quotes : bool
        Whether that may quote the text.
    """

    def __init__(self, problem, mark=None, quotes=False):
        self.problem = problem
        self.quotes = quotes
        self.where = f", line {mark.line + 1}" if mark else ""
        super().__init__(f"{problem}{self.where}")


def load(text):
    """Content of one YAML document.

    Parameters
    ----------
    text : str
        The caller limits its length.

    Raises
    ------
    YamlError
        If it is not YAML, or has aliases, tags, twin keys, keys that are not plain text, more than
        `MOST_LEVELS` levels, or numbers with colons or more than `MOST_DIGITS` characters.
    """
    try:
        _check(yaml.parse(text, Loader=_LOADER))
        return yaml.load(text, Loader=_LOADER)
    except YamlError:
        raise
    except yaml.YAMLError as error:
        problem = getattr(error, "problem", None) or type(error).__name__
        raise YamlError(problem, getattr(error, "problem_mark", None), quotes=True) from None
    except Exception as error:
        # a date such as 2024-99-99 is a ValueError of datetime; others have other errors
        raise YamlError(type(error).__name__) from None


def _check(events):
    # for each open level: the keys of a mapping so far and whether a key is next, or None
    levels = []
    for event in events:
        if isinstance(event, (yaml.MappingEndEvent, yaml.SequenceEndEvent)):
            levels.pop()
            continue
        if not isinstance(event, yaml.NodeEvent):
            continue
        if isinstance(event, yaml.AliasEvent):
            raise YamlError("an alias, which such a file does not need", event.start_mark)
        if event.tag is not None:
            raise YamlError("a tag, which such a file does not need", event.start_mark)
        if levels and levels[-1] is not None:
            _check_key(levels[-1], event)
        if isinstance(event, yaml.ScalarEvent):
            _check_scalar(event)
        else:
            levels.append([set(), True] if isinstance(event, yaml.MappingStartEvent) else None)
            if len(levels) > MOST_LEVELS:
                raise YamlError(f"more than {MOST_LEVELS} levels", event.start_mark)


def _check_key(level, event):
    keys, is_key = level
    level[1] = not is_key
    if not is_key:
        return
    if not isinstance(event, yaml.ScalarEvent):
        raise YamlError("a key that is not plain text", event.start_mark)
    if event.value in keys:
        raise YamlError(f"the key {event.value!r:.60} stands twice", event.start_mark, quotes=True)
    keys.add(event.value)


def _check_scalar(event):
    if event.implicit[0] and (len(event.value) > MOST_DIGITS or ":" in event.value) and (
            _RESOLVER.resolve(yaml.ScalarNode, event.value, (True, False)) in _NUMBERS):
        # those to the base 60 take minutes, too, and mean nothing
        raise YamlError(f"a number with colons or of more than {MOST_DIGITS} digits",
                        event.start_mark)


_RESOLVER = yaml.resolver.Resolver()
