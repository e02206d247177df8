"""How tests are spread over the cores, and which come first."""

import os
from collections import Counter

if "PYTEST_XDIST_WORKER" in os.environ:  # there is one worker for each core
    os.environ["OMP_NUM_THREADS"] = "1"
    os.environ["OMP_WAIT_POLICY"] = "PASSIVE"  # where a test asks for two threads, none spins while it waits


def pytest_collection_modifyitems(items):
    """Files with slow tests first, so that no core is left alone with one of them at the end."""
    slow = Counter(item.path for item in items if item.get_closest_marker("slow"))
    items.sort(key=lambda item: -slow[item.path])
