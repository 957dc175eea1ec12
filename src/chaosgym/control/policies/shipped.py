"""The trained policies that come with chaosgym: one folder of package data for each environment that has one.

A folder holds policy.json and weights.npz, and card.md: how it was trained, how it scores, what to know before use.
"""

from importlib import resources
from pathlib import Path

from chaosgym.control.policies.policy import TrainedPolicy, load_policy
from chaosgym.errors import ModelFileError


def shipped_folder(env: str) -> Path:
    """Return the folder of the shipped policy of an environment id, whether it exists or not."""
    return Path(str(resources.files("chaosgym.control.policies"))) / "shipped" / env.rpartition("/")[2]


def shipped_policy(env: str) -> TrainedPolicy:
    """Return the policy that is shipped for an environment id.

    Raises
    ------
    ModelFileError
        If none is shipped for it; names those that have one.
    """
    folder = shipped_folder(env)
    if not folder.is_dir():
        known = sorted(path.name for path in folder.parent.glob("*/"))
        raise ModelFileError(
            f"no policy is shipped for {env}; shipped: {', '.join(known) or 'none'}. "
            "Train one with agents/ppo.py and give its folder with --policy"
        )
    return load_policy(folder)
