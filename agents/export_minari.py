"""Write an offline dataset in Minari's format: whole jobs of one environment, by a trained policy or at random.

    python agents/export_minari.py --env chaosgym/ImpactBeamTolerance-v1 --jobs 100 --out minari

Needs the extra [offline]. With MINARI_DATASETS_PATH=minari, `minari.load_dataset(
"chaosgym/ImpactBeamTolerance/random-v1")` loads it.
"""

import argparse
import os
import shutil
from pathlib import Path

import gymnasium as gym
from tqdm import trange

from chaosgym.control.policies import load_policy
from chaosgym.envs import environment
from chaosgym.files import made_whole


def main() -> None:
    """Play the jobs and write the dataset."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--env", default="chaosgym/ImpactBeamTolerance-v1", help="id, or file of a machine")
    parser.add_argument("--policy", type=Path, default=None, help="folder of a policy; random actions by default")
    parser.add_argument("--jobs", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=Path("minari"))
    asked = parser.parse_args()
    behaviour = asked.policy.name if asked.policy else "random"
    name = f"chaosgym/{Path(asked.env).stem.removesuffix('-v1')}/{behaviour}-v1"
    if (asked.out / name).exists():
        raise SystemExit(f"{asked.out / name} exists; choose another folder with --out")
    with made_whole(asked.out / name) as folder:
        _export(asked, name, behaviour, folder)
    print(f"{name}: {asked.jobs} jobs in {asked.out}")


def _export(asked: argparse.Namespace, name: str, behaviour: str, folder: Path) -> None:
    """Write the dataset into a folder, by way of one in which Minari keeps its datasets."""
    store = folder / "minari"
    store.mkdir()
    os.environ["MINARI_DATASETS_PATH"] = str(store.resolve())
    from minari import DataCollector  # it looks for the folder when it is imported

    policy = load_policy(asked.policy) if asked.policy else None
    env = gym.make(environment(asked.env), **(policy.keywords if policy else {}))
    env.action_space.seed(asked.seed)
    collector = DataCollector(env)
    for job in trange(asked.jobs, desc=name, unit="job"):
        observation, ended = collector.reset(seed=asked.seed + job)[0], False
        if policy:
            policy.begin(env.unwrapped.task, 1)
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
        description=f"{asked.jobs} jobs of {asked.env} from seed {asked.seed}, {behaviour}",
    )
    collector.close()
    for part in (store / name).iterdir():
        part.rename(folder / part.name)
    shutil.rmtree(store)


if __name__ == "__main__":
    main()
