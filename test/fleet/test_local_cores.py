"""Processes that die: who is blamed for it."""

import multiprocessing
import os
from concurrent.futures import ProcessPoolExecutor

from frac_accel.fleet.workers import LocalCores


class Dying(LocalCores):
    """Its first processes die before they begin."""

    def __init__(self, dying):
        super().__init__(1, 100.0)
        self.left = dying

    def _pool(self, count):
        self.left -= 1
        return ProcessPoolExecutor(count, multiprocessing.get_context("fork"),
                                   os._exit if self.left >= 0 else None, (1,)
                                   if self.left >= 0 else ())


def die(task):
    os._exit(task)


def test_a_task_is_not_blamed_for_processes_that_die_while_they_start():
    assert list(Dying(5).run(abs, [-3])) == [(-3, 3)]


def test_a_task_that_ends_its_process_again_and_again_is_given_up():
    assert list(Dying(0).run(die, [1])) == [(1, None)]


def test_where_no_process_can_start_it_ends():
    assert list(Dying(100).run(abs, [-3])) == [(-3, None)]
