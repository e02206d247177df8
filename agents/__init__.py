"""Controllers, model-based and learned, and the commands that train, evaluate and compare them."""
