"""Who does the work: the cores of this machine, a Dask cluster, or a function that is named.

Each yields (task, result) for every task once, in any order, whatever dies on the way; a result is
None where a task has ended its worker again and again. There is no engine of our own: a process
pool of the standard library, `distributed`, or whatever else maps a function over a list.
"""

import collections
import concurrent.futures
import contextlib
import ctypes
import importlib
import multiprocessing
import os
import signal
import time
from concurrent.futures.process import BrokenProcessPool

from ..errors import FracAccelError

# Times that a task may end its worker before it is given up.
_DEATHS = 3
# Processes that are started for it at most, whether they came as far as to begin with it or not.
_STARTS = 6
# Tasks for each worker that are on their way.
_AHEAD = 3
# Longest time [s] to wait for a cluster, at the start and when it is lost.
_REACH_S = 10.0
_PATIENCE_S = 120.0
_POLL_S = 0.02
_PR_SET_PDEATHSIG = 1


class LocalCores:
    """Processes on this machine.

    Parameters
    ----------
    count : int
    memory_mb : float
        Most private memory of each [MB]; what needs more fails with an error of its own.
    """

    def __init__(self, count, memory_mb):
        self._count, self._memory_mb = count, memory_mb

    def run(self, function, tasks):
        """(task, result) of each task.

        A pool breaks when one of its processes is killed. Those tasks that were on their way then
        are run one at a time, so that only what ends its own worker is blamed for it.
        """
        waiting, alone = collections.deque(tasks), collections.deque()
        while waiting:
            yield from self._together(function, waiting, alone)
            while alone:
                yield from self._one_by_one(function, alone)

    def _together(self, function, waiting, alone):
        pool, running = self._pool(self._count), {}
        others = set(multiprocessing.active_children())
        try:
            while waiting or running:
                while waiting and len(running) < _AHEAD * self._count:
                    task = waiting[0]
                    running[pool.submit(function, task)] = task
                    waiting.popleft()
                done, _ = concurrent.futures.wait(
                    running, return_when=concurrent.futures.FIRST_COMPLETED)
                for future in done:
                    result = _result(future)
                    yield running.pop(future), result
        except BrokenProcessPool:
            alone.extend(running.values())
            for future in list(running):
                # some had their result before
                if future.done() and not isinstance(future.exception(), BrokenProcessPool):
                    task = running.pop(future)
                    alone.remove(task)
                    yield task, _result(future)
        except BaseException:
            # nobody waits for what is still running
            for process in set(multiprocessing.active_children()) - others:
                process.terminate()
            raise
        finally:
            pool.shutdown(cancel_futures=True)

    def _one_by_one(self, function, tasks):
        """Those of some tasks that one process lives through, and one that has ended several."""
        deaths = starts = 0
        while tasks and deaths < _DEATHS and starts < _STARTS:
            starts += 1
            with self._pool(1) as pool:
                has_begun = False
                try:
                    # no task is to blame for a process that dies while it starts
                    _result(pool.submit(package_version))
                    has_begun = True
                    while tasks:
                        result = _result(pool.submit(function, tasks[0]))
                        yield tasks.popleft(), result
                        deaths = starts = 0
                except BrokenProcessPool:
                    deaths += has_begun
        if tasks:
            yield tasks.popleft(), None

    def _pool(self, count):
        return concurrent.futures.ProcessPoolExecutor(
            count, multiprocessing.get_context("spawn"), _begin,
            (self._memory_mb, os.getpid()))


def _result(future):
    """What a process has found; None where it had too little memory to begin or to tell."""
    try:
        return future.result()
    except MemoryError:
        return None


def _begin(memory_mb, parent):
    """Prepare a process: it is stopped by its parent alone, with it, and has its bounds."""
    import resource

    from ..signals import one_thread
    one_thread.prefer()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)  # it died before
    limit = int(memory_mb * 1e6)
    resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))


class Cluster:
    """A Dask cluster that is there already.

    Parameters
    ----------
    address : str
        Of the scheduler, ``tcp://…``.

    Raises
    ------
    FracAccelError
        If it is not reached, has no workers, or these have another version of the package.
    """

    def __init__(self, address):
        self._address = address
        self._client = self._connected(_REACH_S)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._client.close(timeout=1)

    def run(self, function, tasks):
        """(task, result) of each task; what a lost scheduler forgets is handed in again."""
        waiting, running = collections.deque(tasks), {}
        while waiting or running:
            try:
                most = _AHEAD * max(sum(self._client.nthreads().values()), 1)
                while waiting and len(running) < most:
                    future = self._client.submit(function, waiting[0], pure=False, retries=_DEATHS)
                    running[future] = waiting.popleft()
                ended = [future for future in running if future.status != "pending"]
                for future in ended:
                    if future.status in ("finished", "error"):
                        result = self._result(future)
                        yield running.pop(future), result
                    else:  # lost with its scheduler
                        waiting.append(running.pop(future))
                if not ended:
                    time.sleep(_POLL_S)
                if self._client.status in ("closed", "closing"):
                    raise OSError("the scheduler is gone")
            except (OSError, RuntimeError, concurrent.futures.CancelledError,
                    concurrent.futures.TimeoutError):
                waiting.extend(running.values())
                running.clear()
                with contextlib.suppress(Exception):  # what is left of it does not matter
                    self._client.close(timeout=1)
                self._client = self._connected(_PATIENCE_S)

    def _result(self, future):
        from distributed import KilledWorker
        try:
            return future.result(timeout=_REACH_S)
        except KilledWorker:
            return None
        except (ImportError, AttributeError) as error:
            raise FracAccelError(f"{self._address}: its workers cannot run frac_accel: {error}"
                                 ) from None

    def _connected(self, seconds):
        try:
            from distributed import Client
        except ModuleNotFoundError:
            raise FracAccelError("--scheduler needs the Python library distributed; install it "
                                 "with pip install 'frac_accel[fleet]'") from None
        end_s = time.monotonic() + seconds
        while True:
            try:
                client = Client(self._address, timeout=min(seconds, _REACH_S), set_as_default=False)
                break
            except (OSError, ValueError, TimeoutError, ImportError) as error:
                if time.monotonic() > end_s or isinstance(error, (ValueError, ImportError)):
                    raise FracAccelError(f"{self._address}: no Dask scheduler is reached there"
                                         ) from None
                time.sleep(1.0)
        self._require_same(client)
        return client

    def _require_same(self, client):
        versions = client.run(package_version, on_error="return")
        mine = package_version()
        others = sorted({version if isinstance(version, str) else "none that can be imported"
                         for version in versions.values()} - {mine})
        if others:
            client.close()
            raise FracAccelError(f"{self._address}: its workers have frac_accel "
                                 f"{', '.join(others)}, this is {mine}")


class Named:
    """A function of somebody else's that maps a function over a list.

    Parameters
    ----------
    name : str
        ``module:function``. It is called with a function and a list, of dictionaries of plain data
        as its results are, and gives the results in any order.
    """

    def __init__(self, name):
        module, _, function = name.partition(":")
        try:
            self._map = getattr(importlib.import_module(module), function)
        except (ImportError, AttributeError, ValueError) as error:
            raise FracAccelError(f"--map: {name!r} cannot be imported: {error}, expected "
                                 "module:function") from None

    def run(self, function, tasks):
        """(task, result) of each task, which carries the bag by which it is known again."""
        by_key = {_key(task): task for task in tasks}
        for result in self._map(function, list(by_key.values())):
            yield by_key.pop(_key(result)), result
        if by_key:
            raise FracAccelError(f"--map: {len(by_key)} of {len(tasks)} tasks gave no result; what "
                                 "is done is kept, and the same command goes on from there")


def _key(entry):
    return entry["bag"], entry.get("axis", "")


def package_version():
    """Version of the package that a process runs."""
    from .. import __version__
    return __version__
