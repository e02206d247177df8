"""Which robot suits a task: sizes of motors, places of casters, isotropy."""
