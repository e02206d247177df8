"""What two papers on this robot print, beside what this package computes."""
