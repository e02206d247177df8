"""The control period of a task on Torch tensors."""
