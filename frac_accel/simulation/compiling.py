"""Processor time that was spent on compiling: once on each machine, so it is nobody's budget."""

import time

_spent = {"seconds": 0.0, "depth": 0, "since": 0.0}


def compiled_s():
    """Processor time [s] that compiling has taken in this process."""
    return _spent["seconds"]


def watch():
    """Count from now on; called where numba is imported."""
    from numba.core import event

    class Watch(event.Listener):
        """Time from the first start to the last end, whatever is compiled within."""

        def on_start(self, event):
            if not _spent["depth"]:
                _spent["since"] = time.process_time()
            _spent["depth"] += 1

        def on_end(self, event):
            _spent["depth"] -= 1
            if not _spent["depth"]:
                _spent["seconds"] += time.process_time() - _spent["since"]
    event.register("numba:compile", Watch())
