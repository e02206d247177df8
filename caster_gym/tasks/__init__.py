"""What robots are asked to do: a folder for each task, with one object `TASK` that says everything about it."""
