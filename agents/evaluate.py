"""Compare a trained policy with constant speeds on the same jobs.

    python agents/evaluate.py --policy runs/ppo-beam --jobs 10

Prints a table and writes evaluation.json beside the policy.
"""

import argparse
import json
from pathlib import Path

import gymnasium as gym
import numpy as np

import chaosgym  # noqa: F401  (registers the environments)
from chaosgym.envs.evaluation import constant_speed, evaluate
from chaosgym.errors import ModelFileError
from chaosgym.policies import load_policy


def main() -> None:
    """Load, compare, print, save."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--policy", required=True, help="folder written by a training script")
    parser.add_argument("--jobs", type=int, default=10)
    parser.add_argument("--seed", type=int, default=10_000, help="first seed; training used others")
    parser.add_argument("--speeds", type=int, default=14, help="constant speeds to try over the range")
    arguments = parser.parse_args()
    folder = Path(arguments.policy)
    try:
        policy = load_policy(folder)
    except ModelFileError as error:
        raise SystemExit(f"--policy: {error}; train one first") from None
    config = json.loads((folder / "config.json").read_text())["arguments"]
    env = gym.make(config["env"])
    drive = env.get_wrapper_attr("drive")
    contenders = {
        f"constant {speed:5.1f}": constant_speed(env, speed)
        for speed in np.linspace(drive.lowest_speed, drive.highest_speed, arguments.speeds)
    }
    contenders["policy"] = policy
    results = {
        name: evaluate(env, policy, arguments.jobs, arguments.seed, progress=name).summary()
        for name, policy in contenders.items()
    }
    columns = ("return", "return_std", "type_iii_share", "cost_share", "damage", "time_cost")
    print(f"{config['env']}, {arguments.jobs} jobs from seed {arguments.seed}")
    print(" " * 16 + "".join(f"{column:>16}" for column in columns))
    for name, row in results.items():
        print(f"{name:16s}" + "".join(f"{row[column]:16.3f}" for column in columns))
    report = {"jobs": arguments.jobs, "seed": arguments.seed, "results": results}
    (folder / "evaluation.json").write_text(json.dumps(report, indent=2) + "\n")


if __name__ == "__main__":
    main()
