"""Tasks, and the Gymnasium environments that pose them."""
