"""What can be said of a robot without simulating it."""
