"""What an engineer writes down: a machine in SI units, and its reduction to the model that the kernels know."""
