#!/bin/sh
# Print the first of the given Pythons that runs here, is 3.10 to 3.MAX, and can make a venv.
# usage: find_python.sh MAX_MINOR COMMAND...
max=$1
shift
suits='import ensurepip, sys, venv; sys.exit(not (3, 10) <= sys.version_info[:2] <= (3, int(sys.argv[1])))'
for command in "$@"; do
    # Those of pyenv that are not on PATH, too.
    for python in "$command" "${PYENV_ROOT:-$HOME/.pyenv}/versions/${command#python}".*/bin/python; do
        if "$python" -c "$suits" "$max" >/dev/null 2>&1; then
            command -v "$python"
            exit
        fi
    done
done
echo "no Python 3.10 to 3.$max with venv and ensurepip among: $*" \
     "(name one with PYTHON=; Debian and Ubuntu have ensurepip in python3-venv)" >&2
exit 1
