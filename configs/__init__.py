"""Robots, tasks, agents and benchmarks as YAML files; they are read with `caster_gym.configuration`."""
