"""Write an offline dataset in Minari's format: whole jobs of one environment, by a trained policy or by wandering.

    python agents/export_minari.py --env chaosgym/ImpactBeam-v0 --jobs 100 --out minari

Wandering means speeds drawn from the whole range, each kept for 20 steps on average. Needs the extra [offline]. With
MINARI_DATASETS_PATH=minari, `minari.load_dataset("chaosgym/ImpactBeam/wandering-v0")` loads it.
"""

import os
from dataclasses import dataclass
from pathlib import Path

import common
import gymnasium as gym
from tqdm import trange
from wandering import wandering

from chaosgym.control.policies import load_policy


@dataclass(frozen=True)
class Arguments:
    """Everything that decides a dataset."""

    env: str = "chaosgym/ImpactBeam-v0"
    policy: str = "wandering"
    jobs: int = 100
    seed: int = 0
    out: str = "minari"


def main() -> None:
    """Play the jobs and write the dataset."""
    arguments = common.parse(Arguments, __doc__)
    folder = Path(arguments.out)
    folder.mkdir(parents=True, exist_ok=True)
    os.environ["MINARI_DATASETS_PATH"] = str(folder.resolve())
    from minari import DataCollector  # it looks for the folder when it is imported

    behaviour = "wandering" if arguments.policy == "wandering" else Path(arguments.policy).name
    name = f"{arguments.env.removesuffix('-v0')}/{behaviour}-v0"
    if (folder / name).exists():
        raise SystemExit(f"{folder / name} exists; choose another folder with --out")
    trained, env = None if arguments.policy == "wandering" else load_policy(arguments.policy), gym.make(arguments.env)
    if trained:
        trained.fits(env)
    collector = DataCollector(env)
    for job in trange(arguments.jobs, desc=name, unit="job"):
        if trained:
            trained.reset()
        act = trained or wandering(arguments.seed + job)
        observation, ended = collector.reset(seed=arguments.seed + job)[0], False
        while not ended:
            observation, _, terminated, truncated, _ = collector.step(act(observation))
            ended = terminated or truncated
    collector.create_dataset(
        name,
        algorithm_name=behaviour,
        author="The chaosgym developers",
        requirements=["chaosgym"],
        code_permalink="agents/export_minari.py",
        description=f"{arguments.jobs} jobs of {arguments.env} from seed {arguments.seed}, {behaviour}",
    )
    collector.close()
    print(f"{name}: {arguments.jobs} jobs in {folder}")


if __name__ == "__main__":
    main()
