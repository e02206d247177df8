"""Where to go: timed trajectories of the platform."""
