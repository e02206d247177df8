"""Properties of a robot that need no simulation."""
