"""Controllers and policies that set the speed of a machine, and their comparison on the same machines."""
