"""Levels say what differs between machines, splits share them out; today's ids keep their machines."""

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import chaosgym
from chaosgym.control.controllers import Follow
from chaosgym.control.rollout import play
from chaosgym.envs import levels as known
from chaosgym.envs.levels import tolerances_of
from chaosgym.envs.variants import HELD_OUT_SEED, SPLITS, Variants, sealed_seed
from chaosgym.envs.vector_env import native_envs
from chaosgym.errors import ParameterError
from chaosgym.machines import MACHINES

BEAM, CRANK = "chaosgym/ImpactBeamTolerance-v1", "chaosgym/SliderCrankTolerance-v1"
FLEET = tolerances_of(chaosgym.ImpactBeam(), "fleet")


def test_the_ids_are_levels():
    """The three ids of a machine are its levels nominal, clearance and wear, with the machines that they had."""
    by_id = {level: native_envs(f"chaosgym/ImpactBeam{task}-v1") for level, task in LEVELS.items()}
    for level, envs in by_id.items():
        same = native_envs("chaosgym/ImpactBeam-v1", level=level)
        assert (envs.task, envs.settings.variants.tolerances) == (same.task, same.settings.variants.tolerances)
    shares = np.random.default_rng([HELD_OUT_SEED, 13]).uniform(-1.0, 1.0, 1)
    thirteen = by_id["clearance"].settings.variants.held_out(13)
    assert thirteen.clearance == pytest.approx(0.127e-3 * (1.0 + 0.2 * shares[0]), rel=1e-15)


LEVELS = {"nominal": "", "clearance": "Tolerance", "wear": "Wear"}


@pytest.mark.parametrize("env", [BEAM, CRANK])
def test_a_fleet_varies_what_no_sensor_tells(env):
    """Two machines of a fleet differ in every field of the level, and their clearance grows in the job."""
    fleet = gym.make(env, level="fleet").unwrapped
    fleet.reset(seed=1)
    one = fleet.machine
    fleet.reset(seed=2)
    widths = fleet.settings.variants.tolerances
    assert len(widths) >= 5
    assert all(getattr(one, field) != getattr(fleet.machine, field) for field in widths)
    before = getattr(fleet.machine, fleet.nominal.clearance_field)
    fleet.step(0)
    assert getattr(fleet.machine, fleet.nominal.clearance_field) > before


@given(seed=st.integers(0, 10**6), machine=st.integers(0, 255), level=st.sampled_from(["clearance", "fleet"]))
def test_splits_share_no_machine(seed, machine, level):
    """Train and test are told by the cells of the draw; outside has one field beyond, and corner all of them."""
    widths = tolerances_of(chaosgym.ImpactBeam(), level)
    for split in SPLITS:
        variants = Variants(chaosgym.ImpactBeam(), widths, split)
        for shares in (
            variants.shares(np.random.default_rng(seed)),
            variants.shares(np.random.default_rng([HELD_OUT_SEED, machine]), machine),
        ):
            beyond = np.abs(shares) > 1.0
            assert beyond.sum() == {"outside": 1, "corner": len(shares)}.get(split, 0)
            cells = sum(int((share + 1.0) // 0.25) for share in shares)
            if split not in ("outside", "corner"):
                assert (cells % 4 == 1) == (split != "train")


def test_outside_goes_field_by_field():
    """Machine k of outside has field k // 2 beyond its tolerance, above for even k and below for odd ones."""
    variants = Variants(chaosgym.ImpactBeam(), FLEET, "outside")
    nominal = chaosgym.ImpactBeam()
    for number in range(2 * len(FLEET)):
        machine = variants.held_out(number)
        ratios = {field: getattr(machine, field) / getattr(nominal, field) for field in FLEET}
        beyond = [field for field, width in FLEET.items() if not 1.0 - width <= ratios[field] <= 1.0 + width]
        assert beyond == [list(FLEET)[number // 2]]
        assert (ratios[beyond[0]] > 1.0) == (number % 2 == 0)
        assert ratios[beyond[0]] > 0.0


def test_sealed_machines_are_others():
    """There are 512, the seed follows from the version alone, and none is a machine of development."""
    open_ones, sealed = (Variants(chaosgym.ImpactBeam(), FLEET, "test", sealed=flag) for flag in (False, True))
    assert (open_ones.count, sealed.count) == (256, 512)
    assert sealed.seed == sealed_seed() != HELD_OUT_SEED
    known = {open_ones.held_out(k) for k in range(256)}
    assert not known & {sealed.held_out(k) for k in range(512)}
    with pytest.raises(ParameterError, match="0 to 255"):
        gym.make(BEAM, level="fleet").reset(options={"machine": 256})
    gym.make(BEAM, level="fleet", sealed=True).reset(seed=0, options={"machine": 511})


def test_who_plays_meets_the_machines_of_the_split():
    """A rollout on outside runs machines that lie outside, with jobs of their own where they are sealed."""
    follow = Follow()
    played = {split: play(follow, BEAM, [0, 1], split=split, steps=3) for split in ("test", "outside")}
    assert not np.array_equal(played["test"].felt, played["outside"].felt)
    sealed = play(follow, BEAM, [0, 1], split="test", sealed=True, steps=3)
    assert not set(sealed.seeds) & set(played["test"].seeds)


def test_a_machine_without_a_task_of_its_own_gets_shares_of_its_range():
    """Seven slews cross its range; a demand changes by a fourteenth of it at least."""
    from tests.third_machine import ImpactOscillator

    machine = ImpactOscillator()
    low, high = machine.usual_ranges[machine.speed_field]
    task = known._usual_task(machine)
    told = [getattr(task, name) for name in SHARES]
    assert told == pytest.approx([(high - low) * share for share in SHARES.values()])
    assert task.reference_force == 100.0


SHARES = {
    "slew_limit": 1 / 7,
    "trim_step": 1 / 56,
    "largest_trim": 1 / 7,
    "smallest_change": 1 / 14,
    "largest_change": 2 / 7,
    "start_below": 1 / 7,
}


def test_jobs_of_a_vector_have_an_action_each():
    """Its spaces are those of a job, stacked."""
    envs = native_envs(BEAM, 3, action="speed")
    assert envs.action_space.shape == (3, *envs.single_action_space.shape)
    assert envs.observation_space.shape == (3, *envs.single_observation_space.shape)


def test_a_machine_does_several_jobs_in_turn():
    """Three jobs on a machine, then three on another, with other demands, in a vector too; a seed begins anew."""
    single = gym.make(BEAM, level="fleet", jobs=3, steps=2).unwrapped
    seen = []
    for k in range(7):
        single.reset(seed=5 if k == 0 else None)
        seen.append((single.machine.damping_ratio, tuple(single._job.demand[0])))
    ratios, demands = zip(*seen, strict=True)
    assert [ratios.index(ratio) for ratio in ratios] == [0, 0, 0, 3, 3, 3, 6]
    assert len(set(demands)) > 3
    envs = native_envs(BEAM, 2, level="fleet", jobs=3, steps=2, autoreset_mode="Disabled")
    for k in range(4):
        envs.reset(seed=[5, 6] if k == 0 else None)
        assert envs.jobs.machines[0].damping_ratio == ratios[k]
    single.reset(seed=5)
    assert single.machine.damping_ratio == ratios[0]
    _, info = single.reset(options={"machine": 7})
    number = [info["machine"], *(single.reset()[1]["machine"] for _ in range(3))]
    assert number == [7, 7, 7, -1]
    with pytest.raises(ParameterError, match="jobs = 0"):
        gym.make(BEAM, jobs=0)


@pytest.mark.parametrize(
    ("keywords", "message"),
    [
        ({"level": "hard"}, "level = 'hard' is not one of nominal, clearance, wear, fleet"),
        ({"split": "other"}, "split = 'other' is not one of train, test, outside"),
        ({"split": "other_machines"}, "chaosgym/AnyMachine-v0 has it, and `chaosgym compare FILE` plays"),
        ({"split": "test", "level": "nominal"}, "split = 'test' needs machines that differ"),
        ({"spilt": "test"}, "did you mean split"),
    ],
)
def test_what_is_refused_says_what_to_do(keywords, message):
    """A level or a split that does not exist, one that has no machines, and a misspelt keyword."""
    with pytest.raises(ParameterError, match=message):
        native_envs(BEAM, **keywords)


def test_pictures_of_another_program_are_refused_by_its_name():
    """Any machine has none either, and says so."""
    with pytest.raises(ParameterError, match="not possible with split = 'other_simulator'; allowed: None"):
        gym.make(BEAM, split="other_simulator", render_mode="rgb_array")
    with pytest.raises(ParameterError, match="not possible with any machine; allowed: None"):
        gym.make("chaosgym/AnyMachine-v0", render_mode="rgb_array")


def test_every_machine_has_every_level():
    """A machine that names nothing hidden has a fleet too: its tolerances and growing clearance."""
    for name in MACHINES:
        levels = {level: tolerances_of(MACHINES[name](), level) for level in known.LEVELS}
        assert levels["clearance"].items() <= levels["fleet"].items()
