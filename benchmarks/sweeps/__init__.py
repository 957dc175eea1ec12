"""Cost and consistency of labelled sweeps."""
