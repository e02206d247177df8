"""Controllers that know the model."""
