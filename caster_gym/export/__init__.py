"""Export of robots to other programs."""
