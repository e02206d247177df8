"""The mechanics at work: on NumPy arrays, on Torch tensors, compiled by Numba. No formula lives here."""
