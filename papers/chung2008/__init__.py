"""The sections of the page on Chung et al. (2008)."""
