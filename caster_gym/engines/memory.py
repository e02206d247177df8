"""Refuses batches that do not fit into memory, before anything is allocated."""

import os

_COPIES = 3  # of a robot's numbers exist for a moment while a batch is set up


def check_memory(robots: int, numbers: int) -> None:
    """Raise ValueError if a batch of robots of so many double-precision numbers each needs more than there is."""
    if "SC_PHYS_PAGES" not in os.sysconf_names:  # not on every system
        return
    there = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    each = 8 * numbers * _COPIES
    if robots * each > there:
        raise ValueError(
            f"a batch of {robots:,} robots needs {robots * each / 1e9:,.0f} GB of memory, this machine has "
            f"{there / 1e9:.0f} GB: {there // each:,} robots at most"
        )
