"""Other processes that work: on this machine, or on a cluster."""
