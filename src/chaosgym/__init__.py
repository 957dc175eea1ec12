"""chaosgym: machines with clearance that rattle, bounce and turn chaotic."""

__version__ = "0.1.0.dev0"
