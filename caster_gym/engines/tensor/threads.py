"""The number of threads for learning and evaluation: one, unless the user chooses another.

Users choose by --threads or by OMP_NUM_THREADS, which is read when this module is imported, as OpenMP does.

Networks and batches are so small here that a second thread gains little on a machine at rest, and beside another busy
process the two wait for each other most of the time. Sums depend on how they are shared out, so that a training run
repeats only with the same number of threads: it must not follow from the machine.
"""

from collections.abc import Iterator
from contextlib import contextmanager

import torch

from caster_gym.engines.native.cores import learning_threads
from caster_gym.engines.native.threads import get_threads, set_threads

DEFAULT = learning_threads()


@contextmanager
def limit_threads(threads: int) -> Iterator[None]:
    """Torch and the simulator take so many threads at most inside, and as many as before afterwards."""
    if threads < 1:
        raise ValueError(f"the number of threads must be 1 or more, got {threads}")
    before = torch.get_num_threads(), get_threads()
    torch.set_num_threads(threads)
    set_threads(threads)
    try:
        yield
    finally:
        torch.set_num_threads(before[0])
        set_threads(before[1])
