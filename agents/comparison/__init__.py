"""Episodes rolled out, measured and compared."""
