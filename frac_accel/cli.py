"""The command ``frac_accel``: one verb per file of `frac_accel.commands`."""

import contextlib
import importlib
import sys

from .commands.parser import Parser, nearest
from .commands.process import Stopped, stopping_cleanly, tolerant_output, write_details
from .errors import FracAccelError
from .io.outputs import together
from .signals import one_thread

one_thread.prefer()

# Order of the help: the way through the work.
VERBS = {
    "simulate": "reference -> what a sensor would say",
    "identify": "measured pair -> sensor model with standard uncertainties",
    "validate": "error metrics of a model and of its correction",
    "correct": "raw acceleration -> corrected acceleration",
    "convert": "between MCAP, sqlite3, CSV, Parquet, MDF4 and numpy",
    "budget": "what is left, parted by kind, in seconds, without naming anything",
    "diagnose": "what a simulation gets wrong, the cause, the extension, the gain",
    "fleet": "many bags through a command, and what they show together",
    "report": "the page of a diagnosis again, from its result file",
    "watch": "live in the terminal: RMS, rate, latency and verdict of each sensor",
    "layout": "a layout for Foxglove or PlotJuggler, with the corrected samples' band",
    "paper": "the seed paper's tables and figures again, and the audit of its claims",
    "bench": "speed, latency and memory, beside peers in the same run",
    "completion": "a script that completes all this in bash, zsh or fish",
}
_PIP_NAMES = {"yaml": "PyYAML"}
_MORE = "frac_accel COMMAND --help tells more of each, with examples."


def main(arguments=None):
    """Run one verb.

    Parameters
    ----------
    arguments : list of str, optional
        Default: those of the process.

    Returns
    -------
    int
        Exit status: 0 done, whatever the verdict; 2 bad input, or files that cannot be read or
        written, with one line that says what; 3 an error that nobody has foreseen, with one line
        that says where its details are; 4 where some bags of a fleet failed and the others are
        done; 128 and the signal's number if it was stopped. Unless it is 0 or 4, no output was
        written, but for the rows of a fleet's bags that were done.
    """
    arguments = sys.argv[1:] if arguments is None else arguments
    if not arguments:
        print(_list())
        return 0
    if arguments[0] == "--version":
        from . import __version__
        print(f"frac_accel {__version__}")
        return 0
    verb = next((word for word in arguments if not word.startswith("-")), None)
    if verb is not None and verb not in VERBS:
        print(f"frac_accel: no command '{verb}'{nearest(verb, VERBS)}; frac_accel lists them",
              file=sys.stderr)
        return 2
    try:
        parser, parsers, module = _parser(verb, arguments)
    except ModuleNotFoundError as error:
        print(f"frac_accel: {_missing(error)}", file=sys.stderr)
        return 2
    chosen, rest = parser.parse_known_args(arguments)
    if verb is None or rest:
        (parsers[verb] if verb else parser).error(f"unknown argument {' '.join(rest)}")
    chosen.parser, chosen.parsers = parser, parsers.values()
    with tolerant_output():
        return _run(chosen, module, arguments)


def _run(chosen, module, arguments):
    from .commands._common import guard_files, one_line
    try:
        with stopping_cleanly(), together():
            guard_files(chosen)
            status = module.run(chosen) or 0
            sys.stdout.flush()
        sys.stdout.flush()
        return status
    except FracAccelError as error:
        words, status = one_line(error), 2
    except OSError as error:
        status = 2
        words = ": ".join(str(part) for part in (error.filename, error.strerror or error)
                          if part is not None)
    except ModuleNotFoundError as error:
        words, status = _missing(error), 2
    except MemoryError:
        words, status = "there is not enough memory for this input", 2
    except KeyboardInterrupt:
        words, status = "interrupted", 130
    except Stopped as stopped:
        words, status = f"stopped by {stopped.signal.name}", 128 + stopped.signal
    except Exception as error:
        words, status = (f"an error that nobody has foreseen ({type(error).__name__}); details: "
                         f"{write_details(error, arguments)}"), 3
    with contextlib.suppress(OSError):
        print(f"frac_accel {chosen.verb}: {' '.join(words.split())}", file=sys.stderr, flush=True)
    return status


def _missing(error):
    library = (error.name or str(error)).partition(".")[0]
    return (f"the Python library {library} is missing; install it with pip install "
            f"{_PIP_NAMES.get(library, library)}")


def _parser(verb, arguments):
    """Parser of the command, those of its verbs by name, and the module of the one asked for."""
    parser = Parser(
        prog="frac_accel", epilog=_MORE,
        description="Simulate, identify, validate, correct and diagnose accelerometers.")
    parser.add_argument("--version", action="store_true", help="print the version")
    verbs, parsers, module = parser.add_subparsers(dest="verb", metavar="COMMAND"), {}, None
    for name, summary in VERBS.items():
        parsers[name] = verbs.add_parser(name, help=summary)
        # a verb's libraries are loaded only if it, or its help, is asked for
        if verb in (name, "completion"):
            loaded = importlib.import_module(f".commands.{name}", __package__)
            module = loaded if name == verb else module
            parsers[name].describe(loaded)
    if module is None:
        parser.given = arguments
    else:
        parsers[verb].given = arguments[arguments.index(verb) + 1:]
    return parser, parsers, module


def _list():
    """The verbs with a line of each."""
    width = max(map(len, VERBS))
    return "\n".join([f"frac_accel {name:{width}}  {summary}" for name, summary in VERBS.items()]
                     + [_MORE])


if __name__ == "__main__":
    sys.exit(main())
