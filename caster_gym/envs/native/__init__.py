"""The control period of a task, compiled by Numba."""
