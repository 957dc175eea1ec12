"""Environments in processes of their own, however these begin."""

import os
import subprocess
import sys

import pytest

from chaosgym.envs import ENVIRONMENTS

WORKERS = """
import sys
import gymnasium as gym, numpy as np
import chaosgym

ID = "chaosgym/{machine}-v1"

def play(envs):
    observations = [envs.reset(seed=7)[0]] + [envs.step(np.array([0, 0]))[0] for _ in range(3)]
    envs.close()
    return np.array(observations)

def workers():
    return play(gym.make_vec(ID, num_envs=2, vectorization_mode="async", vector_kwargs={{"context": "{context}"}}))

if __name__ == "__main__":
    alone = gym.make(ID)
    alone.reset(seed=0)
    alone.step(0)
    after_one = workers() if "{context}" == "fork" else None  # the others take nothing over
    here = play(gym.make_vec(ID, num_envs=2))
    assert after_one is None or np.array_equal(after_one, here)
    assert np.array_equal(workers(), here)
    print("equal")
"""


def _run(*command):
    # two threads, so that vector environments start some
    return subprocess.run(
        [sys.executable, *command], env={**os.environ, "NUMBA_NUM_THREADS": "2"}, capture_output=True, text=True
    )


@pytest.mark.parametrize(
    ("machine", "context"),
    [
        ("ImpactBeam", "fork"),
        ("ImpactBeam", "forkserver"),
        ("ImpactBeam", "spawn"),
        pytest.param("SliderCrank", "fork", marks=pytest.mark.slow),
    ],
)
def test_workers_play_as_the_vector_environment_does(tmp_path, machine, context):
    """Begun after a step of one environment and after steps of many on all threads, they see the same bytes."""
    script = tmp_path / "play.py"
    script.write_text(WORKERS.format(machine=machine, context=context))
    done = _run(str(script))
    assert done.stdout == "equal\n", done.stderr


@pytest.mark.parametrize(
    ("name", "found"), [("chaosgym:chaosgym/ImpactBeam-v1", True), ("chaosgym/ImpactBeam-v1", False)]
)
def test_a_worker_that_imports_nothing_needs_an_id_that_does(name, found):
    """A spawned process that makes an environment by id knows it only if the id or the process imports the package."""
    code = (
        "import gymnasium as gym, chaosgym\n"
        f"make = lambda: gym.make({name!r})\n"
        "envs = gym.vector.AsyncVectorEnv([make], context='spawn')\n"
        "print(envs.reset(seed=0)[0].shape)\n"
        "envs.close()"
    )
    done = _run("-c", code)
    assert (done.stdout == "(1, 14)\n") == found, done.stderr
    assert ("NamespaceNotFound" in done.stderr) != found


def test_human_mode_runs_without_a_screen():
    """On a headless computer human mode draws every machine without opening a window and without a warning."""
    drawn = [name for name in ENVIRONMENTS if name.endswith("Tolerance-v1")]  # tasks of a machine are drawn alike
    code = (
        "import chaosgym, gymnasium, matplotlib.pyplot\n"
        f"for name in {drawn}:\n"
        "    env = gymnasium.make(name, render_mode='human')\n"
        "    env.reset(seed=0)\n"
        "    env.step(env.action_space.sample())\n"
        "    drawn = env.render()\n"
        "    env.close()\n"
        "    print(drawn, matplotlib.pyplot.get_fignums())"
    )
    known = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")}
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code], env={**known, "MPLBACKEND": "agg"}, capture_output=True, text=True
    )
    assert done.stdout.splitlines() == ["None []"] * len(drawn), done.stderr
