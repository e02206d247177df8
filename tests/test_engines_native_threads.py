"""Blocks of robots shared out over threads."""

import multiprocessing
import subprocess
import sys
import threading
import time

import pytest

from caster_gym.engines.native.threads import BLOCKS_PER_SHARE, get_threads, over_blocks, set_threads


@pytest.fixture(params=[1, 2])
def threads(request):
    before = get_threads()
    set_threads(request.param)
    yield request.param
    set_threads(before)


@pytest.mark.parametrize("blocks", [1, 2 * BLOCKS_PER_SHARE - 1, 2 * BLOCKS_PER_SHARE, 101])
def test_every_block_is_done_once(threads, blocks):
    done = [0] * blocks

    def count(first, end):
        for i in range(first, end):
            done[i] += 1

    over_blocks(count, blocks)
    assert done == [1] * blocks


def test_many_blocks_go_to_as_many_threads_as_are_allowed(threads):
    """Each waits for the others, so that none can do the work of two."""
    together = threading.Barrier(threads, timeout=30)
    names = set()

    def meet(first, end):
        together.wait()
        names.add(threading.current_thread().name)

    over_blocks(meet, 100)
    assert len(names) == threads


def test_the_number_of_threads_is_positive():
    with pytest.raises(ValueError, match="threads must be 1 or more, got 0"):
        set_threads(0)


@pytest.mark.slow
def test_stepping_a_batch_leaves_the_pool_of_numba_asleep():
    """It shares OpenMP's settings with Torch: once it is awake, training on one thread spins on all cores."""
    code = (
        "import numpy, caster_gym\n"
        "from caster_gym.engines.native.fleet import Fleet\n"
        "from numba.np.ufunc import parallel\n"
        "Fleet(caster_gym.load_robot('chung2008'), 300).step(numpy.zeros((300, 6)), 1e-3)\n"
        "print(parallel._is_initialized)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout.strip() == "False"


def test_few_blocks_stay_in_the_calling_thread(threads):
    names = []
    over_blocks(lambda first, end: names.append(threading.current_thread().name), 2 * BLOCKS_PER_SHARE - 1)
    assert names == [threading.current_thread().name]


@pytest.mark.parametrize("broken", [0, 99])
def test_an_error_in_any_thread_is_raised(threads, broken):
    def fail(first, end):
        if first <= broken < end:
            raise RuntimeError("block broke")

    with pytest.raises(RuntimeError, match="block broke"):
        over_blocks(fail, 100)


def test_nothing_goes_on_after_an_interrupt():
    """Shares that nobody has begun stay undone, and those begun elsewhere are over when the caller hears of it."""
    before = get_threads()
    set_threads(2)
    begun, over, caller = [], [], threading.current_thread()

    def step(first, end):
        if threading.current_thread() is caller:
            raise KeyboardInterrupt
        begun.append(first)
        time.sleep(0.05)
        over.append(first)

    with pytest.raises(KeyboardInterrupt):
        over_blocks(step, 100)
    assert len(begun) <= 1
    assert over == begun
    time.sleep(0.1)
    assert over == begun
    set_threads(before)


def _work_after_fork(reply):
    over_blocks(lambda first, end: None, 100)
    reply.put("done")


def test_a_forked_process_makes_threads_of_its_own(threads):
    """The parent's threads do not exist there: waiting for them would never end."""
    over_blocks(lambda first, end: None, 100)
    context = multiprocessing.get_context("fork")
    reply = context.Queue()
    child = context.Process(target=_work_after_fork, args=(reply,))
    child.start()
    try:
        assert reply.get(timeout=30) == "done"
    finally:
        child.kill()
        child.join()
