"""The sections of the page on Kim et al. (2001)."""
