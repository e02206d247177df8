"""The life of a step, compiled by Numba."""
