"""How to make the robot move as wanted: torques for wrenches."""
