"""The mechanics compiled by Numba, for one robot or many."""
