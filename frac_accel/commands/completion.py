"""Print a script that completes commands, options and files in a shell."""

from ..errors import FracAccelError
from ._common import INPUTS, OUTPUTS

EXAMPLES = """
frac_accel completion bash > ~/.local/share/bash-completion/completions/frac_accel
frac_accel completion zsh > ~/.zfunc/_frac_accel    # a folder in $fpath
frac_accel completion fish > ~/.config/fish/completions/frac_accel.fish
"""


def add_arguments(parser):
    """Options of the verb."""
    parser.add_argument("shell", choices=["bash", "zsh", "fish"])


def run(arguments):
    """Do it."""
    try:
        import shtab
    except ModuleNotFoundError:
        raise FracAccelError("the script is made by the Python library shtab, which is missing; "
                             "install it with pip install shtab") from None
    if arguments.shell not in shtab.SUPPORTED_SHELLS:
        raise FracAccelError(f"the installed shtab does not know {arguments.shell}; install a "
                             "newer one with pip install -U shtab")
    for parser in arguments.parsers:
        for action in parser._actions:
            if action.dest in (*INPUTS, *OUTPUTS):
                action.complete = shtab.FILE
    print(shtab.complete(arguments.parser, arguments.shell))
