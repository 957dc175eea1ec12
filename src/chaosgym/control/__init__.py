"""Ways to set the speed of a machine, and who does it better on the same machines."""
