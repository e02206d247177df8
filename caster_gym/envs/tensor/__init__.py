"""The life of a step on Torch's tensors."""
