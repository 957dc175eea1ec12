"""The trained policies that come with chaosgym: one folder of package data for each environment that has one.

A folder holds policy.json and weights.npz, and card.md: how it was trained, how it scores, what to know before use. Its
name is that of the id, and of the level where another one than the id's is played: ImpactBeamTolerance-v1-fleet.
"""

from importlib import resources
from pathlib import Path

from chaosgym.control.policies.learned_map import LearnedMap
from chaosgym.control.policies.policy import TrainedPolicy, load_policy
from chaosgym.envs import environment
from chaosgym.errors import ModelFileError


def _folders() -> Path:
    """Where the folders of all of them are."""
    return Path(str(resources.files("chaosgym.control.policies"))) / "shipped"


def shipped_name(env: str, level: str | None = None) -> str:
    """Name of what is shipped for an environment id at a level; None for the id's own.

    Examples
    --------
    >>> from chaosgym.control.policies.shipped import shipped_name
    >>> shipped_name("chaosgym/ImpactBeamTolerance-v1", "fleet")
    'ImpactBeamTolerance-v1-fleet'
    """
    own = level is None or environment(env).kwargs.get("level") == level
    return env.rpartition("/")[2] + ("" if own else f"-{level}")


def shipped_folder(env: str, level: str | None = None) -> Path:
    """Return the folder of the shipped policy of an environment id, whether it exists or not."""
    return _folders() / shipped_name(env, level)


def shipped_policy(env: str, level: str | None = None) -> TrainedPolicy | LearnedMap:
    """Return the policy that is shipped for an environment id, or for a level of it.

    Raises
    ------
    ModelFileError
        If none is shipped for it; names those that have one.
    """
    folder = shipped_folder(env, level)
    if not folder.is_dir():
        known = sorted(path.name for path in _folders().glob("*/"))
        raise ModelFileError(
            f"no policy is shipped for {env}{f', level {level}' if level else ''}; "
            f"shipped: {', '.join(known) or 'none'}. "
            "Train one with agents/ppo.py and give its folder with --policy"
        )
    return load_policy(folder)


def map_of_the_fleet(machine: str) -> LearnedMap | None:
    """Return the learned map that is shipped for the fleet of a machine, by its ``definition``; None without one."""
    for folder in sorted(_folders().glob("*-fleet")):
        policy = load_policy(folder)
        if isinstance(policy, LearnedMap) and policy.machine == machine:
            return policy
    return None
