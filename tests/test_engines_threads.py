"""Blocks of robots shared out over threads."""

import multiprocessing
import threading

import numba
import pytest

from caster_gym.engines.threads import BLOCKS_PER_THREAD, over_blocks


@pytest.fixture(params=[1, 2])
def threads(request):
    """So many threads, as far as the machine has them."""
    before = numba.get_num_threads()
    numba.set_num_threads(min(request.param, numba.config.NUMBA_NUM_THREADS))
    yield numba.get_num_threads()
    numba.set_num_threads(before)


@pytest.mark.parametrize("blocks", [1, 2 * BLOCKS_PER_THREAD - 1, 2 * BLOCKS_PER_THREAD, 101])
def test_every_block_is_done_once(threads, blocks):
    done = [0] * blocks

    def count(first, end):
        for i in range(first, end):
            done[i] += 1

    over_blocks(count, blocks)
    assert done == [1] * blocks


def test_many_blocks_go_to_as_many_threads_as_are_allowed(threads):
    names = set()
    over_blocks(lambda first, end: names.add(threading.current_thread().name), 100)
    assert len(names) == threads


def test_few_blocks_stay_in_the_calling_thread(threads):
    names = []
    over_blocks(lambda first, end: names.append(threading.current_thread().name), 2 * BLOCKS_PER_THREAD - 1)
    assert names == [threading.current_thread().name]


@pytest.mark.parametrize("broken", [0, 99])
def test_an_error_in_any_thread_is_raised(threads, broken):
    def fail(first, end):
        if first <= broken < end:
            raise RuntimeError("block broke")

    with pytest.raises(RuntimeError, match="block broke"):
        over_blocks(fail, 100)


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
