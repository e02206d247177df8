"""Searching settings of tasks and agents: many trainings, of which later ones learn from earlier ones."""
