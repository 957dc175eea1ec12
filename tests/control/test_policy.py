"""A trained policy is the same numbers under numpy as under torch, and a file that is not one is refused."""

import json

import gymnasium as gym
import numpy as np
import pytest
from sb3_contrib import RecurrentPPO
from stable_baselines3 import DQN, PPO, SAC
from stable_baselines3.common.vec_env import VecNormalize

from chaosgym.control.policies import TrainedPolicy, load_policy, save_policy, shipped_policy
from chaosgym.control.policies.export import exported
from chaosgym.control.policies.network import Dense, Network
from chaosgym.control.policies.policy import Normalisation
from chaosgym.control.policies.shipped import shipped_folder, shipped_name
from chaosgym.control.rollout import play
from chaosgym.envs import ENVIRONMENTS, SB3VecEnv
from chaosgym.envs.sb3 import SB3VisitedSpeeds
from chaosgym.envs.vector_env import native_envs
from chaosgym.errors import ModelFileError, ParameterError
from tests.control.made_up import ENV, trained

SMALL = {"n_steps": 32, "batch_size": 32, "n_epochs": 1}
MODELS = {
    "PPO": lambda: trained(PPO, "MlpPolicy", **SMALL),
    "PPO that explores by state": lambda: trained(PPO, "MlpPolicy", {"action": "continuous"}, use_sde=True, **SMALL),
    "recurrent PPO": lambda: trained(RecurrentPPO, "MlpLstmPolicy", policy_kwargs={"lstm_hidden_size": 16}, **SMALL),
    "DQN": lambda: trained(DQN, "MlpPolicy", learning_starts=2, train_freq=1, learning_rate=0.05, buffer_size=100),
    "SAC": lambda: trained(
        SAC, "MlpPolicy", {"action": "continuous"}, learning_starts=16, batch_size=16, buffer_size=100
    ),
}


@pytest.mark.parametrize("name", list(MODELS))
def test_numpy_plays_what_torch_plays(name, tmp_path):
    """Over 30 steps of two jobs, the actions of the files differ from those of torch by less than 1e-5."""
    model, envs = MODELS[name]()
    space = envs.observation_space
    save_policy(exported(model, ENV, envs), tmp_path)
    policy = load_policy(tmp_path)
    policy.start(envs.venv.env)
    observations = np.random.default_rng(0).uniform(space.low, space.high, (30, 2, *space.shape)).astype(np.float32)
    state, start = None, np.ones(2, bool)
    answers = []
    for observation in observations:
        expected, state = model.predict(envs.normalize_obs(observation), state, start, deterministic=True)
        start[:] = False
        np.testing.assert_allclose(policy(observation), expected, atol=1e-5)
        answers.append(expected)
    assert np.ptp(answers) > 0.0


def test_a_policy_remembers_what_it_remembered_in_training(tmp_path):
    """The files hold what is usual at each speed: the policy, given plain observations, does what the model does."""
    envs = VecNormalize(SB3VisitedSpeeds(SB3VecEnv(ENV, 2, steps=20)))
    model = PPO("MlpPolicy", envs, seed=3, device="cpu", **SMALL).learn(64)
    save_policy(exported(model, ENV, envs, memory=True), tmp_path)
    policy = load_policy(tmp_path)
    envs.training, envs.venv.memory.learns = False, False
    envs.seed(5)
    seen, plain = envs.reset(), envs.venv.venv.env
    policy.start(plain)
    for _ in range(9):
        action, _ = model.predict(seen, deterministic=True)
        np.testing.assert_array_equal(policy(plain._last), action)
        seen = envs.step(np.array([1, 3]))[0]


def _saved(folder):
    answers = np.zeros((6, 14), np.float32)
    layer = Dense(answers, np.arange(6, dtype=np.float32), "none")
    folder.mkdir(exist_ok=True)
    plain = Normalisation(np.zeros(14), np.ones(14), 10.0)
    save_policy(TrainedPolicy(ENV, "trim", Network(None, (layer,)), plain), folder)
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
    "'somebody:Else-v0' is unknown; known: chaosgym/": lambda f: _edit(f, env="somebody:Else-v0", machine=""),
    "the limit of the normalisation is nan": lambda folder: _edit(folder, normalisation_limit=float("nan")),
    "activation 'cosine'": lambda folder: _edit(folder, activations=["cosine"]),
    "KeyError: 'usual.count": lambda folder: _edit(folder, memory=True),
    "the kind of actions is 'jump'": lambda folder: _edit(folder, action="jump"),
    "expected: float32 (2, 14)": lambda folder: _edit(folder, action="continuous"),
}


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


@pytest.mark.parametrize("observation", [np.zeros((1, 12)), np.full((1, 14), np.nan), np.zeros(14)])
def test_an_observation_that_is_none_is_refused(observation, tmp_path):
    """An action that means nothing would drive a machine without a word."""
    with pytest.raises(ParameterError, match="all finite"):
        load_policy(_saved(tmp_path / "policy"))(observation)


def test_a_policy_of_another_machine_is_refused(tmp_path):
    """The message names the environment that it was trained on."""
    policy = load_policy(_saved(tmp_path / "policy"))
    crank = gym.make_vec("chaosgym/SliderCrank-v1", num_envs=1).unwrapped
    with pytest.raises(ModelFileError, match=f"trained on {ENV} .machine impact-beam.*slider-crank"):
        policy.start(crank)


def test_an_environment_without_a_policy_says_so():
    """And says how to get one."""
    with pytest.raises(ModelFileError, match=r"no policy is shipped for chaosgym/Nothing-v1.*agents/ppo.py"):
        shipped_policy("chaosgym/Nothing-v1")
    with pytest.raises(ModelFileError, match=f"for {ENV}; shipped: "):
        shipped_policy(ENV)
    with pytest.raises(ModelFileError, match=f"for {ENV}, level nominal; shipped: "):
        shipped_policy(ENV, "nominal")


def test_a_policy_at_steps_of_another_length_is_warned_of():
    """It reads means over other numbers of cycles than in training."""
    layer = Dense(np.zeros((6, 14), np.float32), np.zeros(6, np.float32), "none")
    policy = TrainedPolicy(ENV, "trim", Network(None, (layer,)), cycles_per_step=7)
    with pytest.warns(UserWarning, match="steps of 7 cycles"):
        policy.start(native_envs(ENV, 2))


@pytest.mark.parametrize("level", [None, "fleet"])
@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_shipped_policies_load_and_have_a_card(name, level):
    """Whatever is shipped can be loaded and says how it scores."""
    if not shipped_folder(name, level).is_dir():
        with pytest.raises(ModelFileError, match="no policy is shipped"):
            shipped_policy(name, level)
        return
    assert shipped_policy(name, level).env == name
    assert "score" in (shipped_folder(name, level) / "card.md").read_text()


def test_the_own_level_of_an_id_has_the_policy_of_the_id():
    """Asking for what an id plays anyway asks for nothing else."""
    assert shipped_name("chaosgym/ImpactBeamWear-v1", "wear") == shipped_name("chaosgym/ImpactBeamWear-v1")
    assert shipped_name("chaosgym/ImpactBeamWear-v1", "clearance") == "ImpactBeamWear-v1-clearance"


@pytest.mark.parametrize("level", [None, "fleet"])
def test_one_lost_reading_costs_next_to_nothing(level):
    """A NaN in step 10 of a job costs less than 1 in return, on the mean over machines and on each as a rule."""

    class Lost:
        knows = "measurements"

        def __init__(self, policy):
            self.policy, self.keywords = policy, policy.keywords

        def start(self, envs):
            """Begin."""
            self.policy.start(envs)
            self.step = 0

        def __call__(self, observations):
            """With one reading lost."""
            self.step += 1
            seen = observations.copy()
            seen[:, 6:] = np.nan if self.step == 10 else seen[:, 6:]
            return self.policy(seen)

    name, seeds = "chaosgym/ImpactBeamTolerance-v1", range(31_000_000, 31_000_008)
    policies = shipped_policy(name, level), Lost(shipped_policy(name, level))
    whole, lost = (play(policy, name, seeds=seeds, steps=60).returns for policy in policies)
    cost = whole - lost
    assert abs(cost.mean()) < 1.0
    assert np.median(np.abs(cost)) < 1.0
