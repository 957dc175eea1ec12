"""A checkpoint is read by who wrote it, and by nobody else."""

import io
import os
import pickle
import random

import pytest

from agents.training import CHECKPOINT, load_checkpoint, save_checkpoint
from chaosgym.errors import ModelFileError


class Env:
    """Environments with a state."""

    def __init__(self, venv=None):
        self.venv, self.state = venv, 0


class Model:
    """A model that saves one number."""

    def __init__(self, env, weight=0):
        self.env, self.weight, self.replay_buffer = env, weight, [weight]

    def save(self, file):
        """Write the number."""
        file.write(bytes([self.weight]))

    @classmethod
    def load(cls, file, envs, *, device, force_reset):
        """Read the number."""
        assert (device, force_reset) == ("cpu", False), "a job that was begun goes on"
        model = cls(envs, file.read()[0])
        model.replay_buffer = None
        return model


class Evil:
    """An object whose pickle makes a folder when it is read."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return os.mkdir, (str(self.path),)


@pytest.fixture(autouse=True)
def home(tmp_path, monkeypatch):
    """A user with a key of their own."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "me"))


def _written(folder):
    model = Model(Env(Env()), 7)
    model.env.state, model.env.venv.state = 1, 2
    random.seed(5)
    save_checkpoint(folder, model, {"rows": 3})
    return random.random()


def test_a_run_goes_on_where_it_was(tmp_path):
    """Model, what it does not save itself, all layers of environments and the random numbers are as they were."""
    assert load_checkpoint(tmp_path, Model, Env()) is None
    following = _written(tmp_path)
    model, kept = load_checkpoint(tmp_path, Model, Env(Env()))
    assert (model.weight, model.replay_buffer, model.env.state, model.env.venv.state) == (7, [7], 1, 2)
    assert kept == {"rows": 3}
    assert random.random() == following
    assert (tmp_path / "me" / "chaosgym" / "checkpoint.key").stat().st_mode & 0o077 == 0


def test_random_actions_go_on_where_they_were(tmp_path):
    """SAC explores at first by actions from the space of actions, whose generator ``load`` of SB3 seeds anew."""
    from stable_baselines3 import SAC

    from chaosgym.envs import SB3VecEnv

    def envs():
        return SB3VecEnv("chaosgym/ImpactBeamTolerance-v1", 1, action="continuous")

    model = SAC("MlpPolicy", envs(), buffer_size=10, seed=3, device="cpu")
    model.action_space.sample()
    save_checkpoint(tmp_path, model)
    following = model.action_space.sample()
    again, _ = load_checkpoint(tmp_path, SAC, envs())
    assert (again.action_space.sample() == following).all()


def test_the_pickle_of_others_is_not_read(tmp_path, monkeypatch):
    """Another user's file, one without a key, a cut one and one with a bit flipped are refused before they are read."""
    _written(tmp_path)
    path, mark = tmp_path / CHECKPOINT, tmp_path / "mark"
    sound = path.read_bytes()
    file = io.BytesIO()
    pickle.dump(Evil(mark), file)
    flipped = sound[:-9] + bytes([sound[-9] ^ 1]) + sound[-8:]
    for content in (file.getvalue(), sound[:32] + file.getvalue(), b"", sound[:20], sound[:-1], flipped):
        path.write_bytes(content)
        with pytest.raises(ModelFileError, match="was not written by this user"):
            load_checkpoint(tmp_path, Model, Env(Env()))
    assert not mark.exists()
    path.write_bytes(sound)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "somebody else"))
    with pytest.raises(
        ModelFileError, match="it is a pickle and may hold anything, so it is not read: choose another f"
    ):
        load_checkpoint(tmp_path, Model, Env(Env()))


def test_other_environments_than_those_of_the_run_are_refused(tmp_path):
    """Each layer has its state; a run that wraps more or fewer is another run."""
    _written(tmp_path)
    with pytest.raises(ValueError, match="longer"):
        load_checkpoint(tmp_path, Model, Env())


def test_another_number_of_environments_is_refused(tmp_path):
    """The states of eight do not fit into four."""
    envs = Env()
    envs.num_envs = 8
    save_checkpoint(tmp_path, Model(envs, 7))
    assert load_checkpoint(tmp_path, Model, envs)[0].weight == 7
    envs.num_envs = 4
    with pytest.raises(ModelFileError, match="give --envs 8"):
        load_checkpoint(tmp_path, Model, envs)


def test_the_key_lies_where_the_user_keeps_state(tmp_path, monkeypatch):
    """``~/.local/state`` unless told otherwise, also if the folder is there; made once, and for every checkpoint."""
    monkeypatch.delenv("XDG_STATE_HOME")
    for variable in ("HOME", "USERPROFILE"):
        monkeypatch.setenv(variable, str(tmp_path))
    folder = tmp_path / ".local" / "state" / "chaosgym"
    folder.mkdir(parents=True)
    _written(tmp_path)
    key = (folder / "checkpoint.key").read_bytes()
    assert len(key) == 32
    _written(tmp_path)
    assert (folder / "checkpoint.key").read_bytes() == key
