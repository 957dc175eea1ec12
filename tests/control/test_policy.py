"""A trained policy is the same numbers under numpy as under torch, and a file that is not one is refused."""

import json
import shutil

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.spaces import Box
from sb3_contrib import RecurrentPPO
from stable_baselines3 import PPO, SAC

from chaosgym.control.jobs import run_job
from chaosgym.control.learner_view import BINS
from chaosgym.control.policies import TrainedPolicy, load_policy, save_policy, shipped_policy
from chaosgym.control.policies.export import exported
from chaosgym.control.policies.network import Dense, Network
from chaosgym.control.policies.policy import Normalisation
from chaosgym.control.policies.shipped import shipped_folder
from chaosgym.envs import SB3VecEnv
from chaosgym.envs.sb3 import SB3LearnerView
from chaosgym.errors import ModelFileError, ParameterError
from tests.control.made_up import ENV, trained

SMALL = {"n_steps": 32, "batch_size": 32, "n_epochs": 1}
MODELS = {
    "PPO": lambda: trained(PPO, "MlpPolicy", **SMALL),
    "PPO that explores by state": lambda: trained(PPO, "MlpPolicy", use_sde=True, **SMALL),
    "recurrent PPO": lambda: trained(RecurrentPPO, "MlpLstmPolicy", policy_kwargs={"lstm_hidden_size": 16}, **SMALL),
    "SAC": lambda: trained(SAC, "MlpPolicy", learning_starts=16, batch_size=16, buffer_size=100),
}


@pytest.mark.parametrize("name", list(MODELS))
def test_numpy_plays_what_torch_plays(name, tmp_path):
    """Over 30 steps of four jobs, the actions of the files differ from those of torch by less than 1e-5."""
    model, envs = MODELS[name]()
    space = envs.observation_space
    save_policy(exported(model, ENV, envs, normalise=envs), tmp_path)
    policy = load_policy(tmp_path)
    observations = np.random.default_rng(0).uniform(space.low, space.high, (30, 4, *space.shape)).astype(np.float32)
    state, start = None, np.ones(4, bool)
    for observation in observations:
        expected, state = model.predict(envs.normalize_obs(observation), state, start, deterministic=True)
        start[:] = False
        np.testing.assert_allclose(policy(observation), expected, atol=1e-5)
    assert np.ptp(expected) > 0.0


def test_a_policy_sees_and_moves_as_it_did_in_training():
    """The policy is given plain observations; training had a memory of speeds and increments for actions."""
    plain = SB3VecEnv(ENV, num_envs=2, job_cycles=50)
    envs = SB3LearnerView(plain, memory="speeds")
    model = PPO("MlpPolicy", envs, seed=0, device="cpu", **SMALL)
    policy = exported(model, ENV, plain, memory="speeds", increments=True)
    envs.seed(5)
    seen = envs.reset()
    size = plain.observation_space.shape[0]
    for _ in range(9):
        action, _ = model.predict(seen, deterministic=True)
        speed = seen[:, 0]
        target = 4.0 + 13.0 * (policy(seen[:, :size])[:, 0] + 1.0)
        np.testing.assert_allclose(target, np.clip(speed + action[:, 0], 4.0, 30.0), rtol=1e-5)
        seen = envs.step(np.linspace(-1.0, 1.0, 2, dtype=np.float32)[:, None])[0]


def test_a_single_observation_gives_a_single_action_and_a_job_is_forgotten(tmp_path):
    """A policy is a controller: (13,) in, (1,) out; after reset() it starts as new."""
    model, envs = MODELS["recurrent PPO"]()
    policy = exported(model, ENV, envs, normalise=envs)
    observation = envs.observation_space.high
    first, second = policy(observation), policy(observation)
    policy.reset()
    assert first.shape == (1,)
    assert np.array_equal(policy(observation), first)
    assert not np.array_equal(first, second)


def _saved(folder):
    space = Box(np.zeros(13, np.float32), np.ones(13, np.float32))
    layer = Dense(np.full((1, 13), 0.1, np.float32), np.zeros(1, np.float32), "none")
    folder.mkdir(exist_ok=True)
    plain = Normalisation(np.zeros(13), np.ones(13), 10.0)
    save_policy(TrainedPolicy(ENV, space, Box(-1.0, 1.0, (1,), np.float32), Network(None, (layer,)), plain), folder)
    return folder


def test_the_same_policy_gives_the_same_bytes(tmp_path):
    """Nothing in the files depends on when they were written."""
    one, other = _saved(tmp_path / "one"), _saved(tmp_path / "other")
    for name in ("policy.json", "weights.npz"):
        assert (one / name).read_bytes() == (other / name).read_bytes()


def _edit(folder, **changes):
    path = folder / "policy.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))


DAMAGES = {
    "no weights.npz": lambda folder: (folder / "weights.npz").unlink(),
    "does not match the hash": lambda folder: (folder / "weights.npz").write_bytes(b"PK"),
    "format 1": lambda folder: _edit(folder, format=1),
    "KeyError: 'layer1.weight'": lambda folder: _edit(folder, activations=["none", "none"]),
    "the network has no layers": lambda folder: _edit(folder, activations=[]),
    "'somebody:Else-v0', is none of chaosgym/": lambda folder: _edit(folder, env="somebody:Else-v0"),
    "the largest step is nan": lambda folder: _edit(folder, largest_step=float("nan")),
    "could not convert string to float: 'x'": lambda folder: _edit(folder, largest_step="x"),
    "the limit of the normalisation is nan": lambda folder: _edit(folder, normalisation_limit=float("nan")),
    "activation 'cosine'": lambda folder: _edit(folder, activations=["cosine"]),
    "memory = 'elephant' is not one of none, speeds, belief": lambda folder: _edit(folder, memory="elephant"),
    "expected: float32 (1, 12)": lambda folder: _edit(folder, observation={"low": [0.0] * 12, "high": [1.0] * 12}),
    "expected: float32 (2, 13)": lambda folder: _edit(folder, action={"low": [-1.0] * 2, "high": [1.0] * 2}),
}


def test_a_policy_believes_what_it_believed_in_training(tmp_path):
    """With a belief, the same observations give the same features, and actions correct the same plan."""
    env = "chaosgym/ImpactBeamTolerance-v0"
    plain = SB3VecEnv(env, num_envs=2, job_cycles=50, pool="held-out")
    envs = SB3LearnerView(plain, memory="belief")
    model = PPO("MlpPolicy", envs, seed=0, device="cpu", **SMALL)
    model.policy.action_net.bias.data.fill_(0.5)
    save_policy(exported(model, env, plain, memory="belief", increments=True), tmp_path)
    policy = load_policy(tmp_path)
    envs.seed(5)
    seen = envs.reset()
    size = plain.observation_space.shape[0]
    for _ in range(9):
        action, _ = model.predict(seen, deterministic=True)
        target = 4.0 + 13.0 * (policy(seen[:, :size])[:, 0] + 1.0)
        wanted = np.round(4.0 * (envs._memory.planned[:, 0] + action[:, 0])) / 4.0
        np.testing.assert_allclose(target, np.clip(wanted, 4.0, 30.0), atol=1e-3)
        assert (wanted != envs._memory.planned[:, 0]).all()
        seen = envs.step(np.linspace(-1.0, 1.0, 2, dtype=np.float32)[:, None])[0]


@pytest.mark.parametrize("complaint", list(DAMAGES))
def test_a_damaged_policy_is_refused_by_name(complaint, tmp_path):
    """Every damage ends in a ModelFileError that says what is wrong."""
    folder = _saved(tmp_path / "policy")
    DAMAGES[complaint](folder)
    with pytest.raises(ModelFileError) as refusal:
        load_policy(folder)
    assert complaint in str(refusal.value)


def test_objects_in_the_weights_are_not_unpickled(tmp_path):
    """A file with an object array is refused, even if its hash is right."""
    import hashlib

    folder = _saved(tmp_path / "policy")
    np.savez(folder / "weights.npz", **{"layer0.weight": np.array([print], dtype=object)})
    _edit(folder, sha256=hashlib.sha256((folder / "weights.npz").read_bytes()).hexdigest())
    with pytest.raises(ModelFileError, match="pickle"):
        load_policy(folder)


def test_an_observation_of_another_length_is_refused(tmp_path):
    """The message names both shapes."""
    policy = load_policy(_saved(tmp_path / "policy"))
    with pytest.raises(ModelFileError, match=r"\(12,\).*\(13,\)"):
        policy(np.zeros(12, np.float32))


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_an_observation_that_is_not_finite_is_refused(value, tmp_path):
    """An action that is not a number would stop a machine without a word."""
    policy = load_policy(_saved(tmp_path / "policy"))
    with pytest.raises(ParameterError, match="not finite"):
        policy(np.full(13, value, np.float32))


def test_jobs_do_not_come_and_go_without_a_reset():
    """What is remembered belongs to as many jobs as there were."""
    space = gym.make(ENV).observation_space
    layer = Dense(np.zeros((1, space.shape[0] + 3 * BINS), np.float32), np.zeros(1, np.float32), "none")
    policy = TrainedPolicy(ENV, space, Box(-1.0, 1.0, (1,), np.float32), Network(None, (layer,)), memory="speeds")
    assert policy(space.high[None]).shape == (1, 1)
    with pytest.raises(ParameterError, match="2 jobs after 1: call reset"):
        policy(np.tile(space.high, (2, 1)))
    policy.reset()
    assert policy(np.tile(space.high, (2, 1))).shape == (2, 1)


def test_an_environment_without_a_policy_says_so():
    """And says how to get one."""
    with pytest.raises(ModelFileError, match="no policy is shipped for chaosgym/Nothing-v0"):
        shipped_policy("chaosgym/Nothing-v0")


def test_a_copied_folder_is_the_same_policy(tmp_path):
    """Nothing points out of the folder."""
    copy = shutil.copytree(_saved(tmp_path / "policy"), tmp_path / "copy")
    shutil.rmtree(tmp_path / "policy")
    assert load_policy(copy)(np.full(13, 0.5, np.float32)) == pytest.approx(0.65)


@pytest.mark.parametrize("name", sorted(folder.name for folder in shipped_folder(ENV).parent.iterdir()))
def test_a_shipped_policy_does_what_its_evaluation_says(name):
    """Up to two of the jobs of evaluation.json are played again; the card and how it was trained lie beside it."""
    env = f"chaosgym/{name}"
    told = json.loads((shipped_folder(env) / "evaluation.json").read_text())
    assert all((shipped_folder(env) / name).is_file() for name in ("card.md", "config.json"))
    for job in told["jobs"][-2:]:
        again = run_job(gym.make(env, pool=told["setting"]["pool"]), shipped_policy(env), job["machine"], job["seed"])
        assert again.type_iii_share == pytest.approx(job["type_iii_share"], abs=0.05)
        assert again.job_return == pytest.approx(job["job_return"], abs=0.1)
