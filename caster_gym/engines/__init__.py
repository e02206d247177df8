"""Runs the mechanics on NumPy arrays, on Torch tensors, and compiled by Numba. Contains no formula."""
