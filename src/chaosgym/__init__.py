"""chaosgym: machines with clearance that rattle, bounce and turn chaotic."""

import chaosgym.envs  # noqa: F401  (registers the environments)

__version__ = "0.1.0.dev0"
