"""What does each environment's page say? What the docstring of its class says.

python -m chaosgym.envs.documentation > docs/environments.md
"""

import inspect

import gymnasium as gym

from chaosgym.envs import ENVIRONMENTS


def environments_page() -> str:
    """Return the page of all environments, in the format of Gymnasium's own pages (Markdown)."""
    sections = ["# Environments\n\nThis page is written by `python -m chaosgym.envs.documentation`.\n"]
    for name in ENVIRONMENTS:
        sections.append(f"# {name}\n\n{inspect.getdoc(type(gym.make(name).unwrapped))}\n")
    return "\n".join(sections)


if __name__ == "__main__":
    print(environments_page(), end="")
