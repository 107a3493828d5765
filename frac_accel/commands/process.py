"""What a command is for other processes: how it ends when told to, and what it says on its way."""

import contextlib
import os
import platform
import shlex
import signal
import sys
import tempfile
import threading
import traceback

# Time [s] after which a signal comes again that Python dropped: then that call is over.
_AGAIN_S = 0.05


class Stopped(BaseException):
    """A signal asked the process to end; ``signal`` is its number."""

    def __init__(self, number):
        super().__init__(number)
        self.signal = signal.Signals(number)


@contextlib.contextmanager
def stopping_cleanly():
    """SIGTERM and SIGHUP raise `Stopped`, once, so that what is half done is cleaned up.

    A signal that the process was started to ignore (``nohup``) stays ignored.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    numbers = [number for number in (signal.SIGTERM, signal.SIGHUP)
               if signal.getsignal(number) == signal.SIG_DFL]

    def stop(number, frame):
        for each in numbers:
            signal.signal(each, signal.SIG_IGN)
        _end_silently(number, stop)
        raise Stopped(number)

    def interrupt(number, frame):
        _end_silently(number, interrupt)
        raise KeyboardInterrupt

    for number in numbers:
        signal.signal(number, stop)
    interrupts = signal.getsignal(signal.SIGINT)
    if interrupts is signal.default_int_handler:
        signal.signal(signal.SIGINT, interrupt)
    try:
        yield
    finally:
        for number in numbers:
            signal.signal(number, signal.SIG_DFL)
        if interrupts is signal.default_int_handler:
            signal.signal(signal.SIGINT, interrupts)


def _end_silently(number, handler):
    """What is torn down half made, such as a progress bar, has no say any more.

    Python drops an exception in a finalizer or a weak reference's callback. Where it is the one
    that ends the process, the signal is sent once more, when that call is over.
    """
    def ignore(unraisable):
        if isinstance(unraisable.exc_value, (Stopped, KeyboardInterrupt)):
            signal.signal(number, handler)
            again = threading.Timer(_AGAIN_S, signal.pthread_kill,
                                    (threading.main_thread().ident, number))
            again.daemon = True
            again.start()

    sys.unraisablehook = ignore


@contextlib.contextmanager
def tolerant_output():
    """Names that are not UTF-8 are printed with escapes; a reader who has gone is no error."""
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(AttributeError, ValueError):
            stream.reconfigure(errors="backslashreplace")
    with contextlib.redirect_stdout(_Output(sys.stdout)):
        yield


class _Output:
    """Standard output, until its reader has seen enough."""

    def __init__(self, stream):
        self._stream = stream

    def __getattr__(self, name):
        return getattr(self._stream, name)

    def write(self, text):
        """Write text, if somebody reads it."""
        self._tolerating(self._stream.write, text)
        return len(text)

    def flush(self):
        """Hand on what was written."""
        self._tolerating(self._stream.flush)

    def _tolerating(self, function, *arguments):
        try:
            function(*arguments)
        except OSError as error:
            # what is still buffered goes nowhere, also at the interpreter's end
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self._stream.fileno())
            os.close(nowhere)
            if not isinstance(error, BrokenPipeError):
                raise


def write_details(error, arguments):
    """Write what is known of an unforeseen error to a file in the folder for temporary files.

    Parameters
    ----------
    error : BaseException
    arguments : list of str
        Of the command.

    Returns
    -------
    str
        Name of the file, or why there is none.
    """
    text = "".join([
        f"frac_accel {shlex.join(arguments)}\n",
        f"Python {platform.python_version()} on {platform.platform()}\n",
        *traceback.format_exception(error)])
    try:
        descriptor, path = tempfile.mkstemp(prefix="frac_accel-error-", suffix=".txt")
        with open(descriptor, "w", encoding="utf-8", errors="backslashreplace") as file:
            file.write(text)
    except OSError as trouble:
        return f"nowhere ({trouble.strerror})"
    return path
