"""Write offline datasets in Minari's format: whole jobs of one environment, by a trained policy or at random.

    python agents/export_minari.py --level nominal clearance wear fleet --split train --jobs 100 --out minari

writes one of each level. Needs the extra [offline]. With MINARI_DATASETS_PATH=minari, `minari.load_dataset(
"chaosgym/ImpactBeamTolerance/random-fleet-train-v1")` loads the last one; without level and split the name ends in
`random-v1`.
"""

import argparse
import os
import shutil
import sys
from pathlib import Path
from typing import Any

import gymnasium as gym
from tqdm import trange

from chaosgym.control.policies import load_policy
from chaosgym.envs import environment
from chaosgym.envs.vector_env import native_envs
from chaosgym.errors import ChaosgymError, ParameterError
from chaosgym.files import made_whole


def main() -> None:
    """Play the jobs and write the dataset."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--env", default="chaosgym/ImpactBeamTolerance-v1", help="id, or file of a machine")
    parser.add_argument("--level", nargs="+", default=[None], help="what differs from job to job; a dataset of each")
    parser.add_argument("--split", default=None, help="part of the level's machines, such as train")
    parser.add_argument("--policy", type=Path, default=None, help="folder of a policy; random actions by default")
    parser.add_argument("--jobs", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=Path("minari"))
    asked = parser.parse_args()
    try:
        for level in asked.level:
            split = None if level == "nominal" else asked.split  # which is one machine
            _write(asked, {name: value for name, value in (("level", level), ("split", split)) if value})
    except ChaosgymError as error:
        print(f"Error: {error}", file=sys.stderr)
        sys.exit(2)
    except ModuleNotFoundError as error:
        print(f"Error: {error}; install it with: pip install '.[offline,learn]'", file=sys.stderr)
        sys.exit(2)


def _write(asked: argparse.Namespace, keywords: dict[str, Any]) -> None:
    """Write the dataset of one level."""
    behaviour = asked.policy.name if asked.policy else "random"
    kind = "-".join([behaviour, *keywords.values()])
    name = f"chaosgym/{Path(asked.env).stem.removesuffix('-v1')}/{kind}-v1"
    if (asked.out / name).exists():
        raise ParameterError(f"{asked.out / name} exists; choose another folder with --out")
    with made_whole(asked.out / name) as folder:
        _export(asked, name, keywords, folder)
    print(f"{name}: {asked.jobs} jobs in {asked.out}")


def _export(asked: argparse.Namespace, name: str, keywords: dict[str, Any], folder: Path) -> None:
    """Write the dataset into a folder, by way of one in which Minari keeps its datasets."""
    store = folder / "minari"
    store.mkdir()
    os.environ["MINARI_DATASETS_PATH"] = str(store.resolve())
    from minari import DataCollector  # it looks for the folder when it is imported

    policy = load_policy(asked.policy) if asked.policy else None
    keywords = keywords | (policy.keywords if policy else {})
    env = gym.make(environment(asked.env), **keywords)
    behaviour = asked.policy.name if asked.policy else "random"
    env.action_space.seed(asked.seed)
    collector = DataCollector(env)
    for job in trange(asked.jobs, desc=name, unit="job"):
        observation, ended = collector.reset(seed=asked.seed + job)[0], False
        if policy:
            policy.start(native_envs(asked.env, **keywords))
        while not ended:
            action = policy(observation[None])[0] if policy else env.action_space.sample()
            observation, _, terminated, truncated, _ = collector.step(action)
            ended = terminated or truncated
    collector.create_dataset(
        name,
        algorithm_name=behaviour,
        author="The chaosgym developers",
        requirements=["chaosgym"],
        code_permalink="agents/export_minari.py",
        description=f"{asked.jobs} jobs of {asked.env} ({keywords}) from seed {asked.seed}, {behaviour}",
    )
    collector.close()
    for part in (store / name).iterdir():
        part.rename(folder / part.name)
    shutil.rmtree(store)


if __name__ == "__main__":
    main()
