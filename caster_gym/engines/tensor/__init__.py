"""The mechanics on Torch's tensors."""
