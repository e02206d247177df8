"""What numbers a robot really has, from recordings of its motion."""
