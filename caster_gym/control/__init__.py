"""Motor torques for wanted wrenches."""
