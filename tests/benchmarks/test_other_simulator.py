"""A beam behind the plant interface is the beam of an environment, in this simulator and in Exudyn."""

import numpy as np
import pytest

from benchmarks.envs.other_simulator import OwnBeam, Rig
from chaosgym.envs.vector_env import native_envs

ENV = "chaosgym/ImpactBeamTolerance-v1"
IDEAL = {"speed_ripple": 0.0, "sensor_error": 0.0, "bouncing_error": 0.0, "missed_impacts": 0.0, "tolerances": {}}


@pytest.mark.parametrize("speed", [19.0, 23.0])
def test_a_rig_is_the_job_of_an_environment(speed):
    """Without ripple and errors: peaks, impacts, bouncing, irregular cycles and damage, while the clearance grows."""
    envs = native_envs(ENV, 1, action="speed", wear=0.5, **IDEAL)
    seen, _ = envs.reset(seed=0, options={"speed": speed})
    rig = Rig(OwnBeam, envs.nominal, envs.task, seed=0)
    rig.reset()
    told = rig.run(speed, envs.task.run_in_cycles)
    for step in range(4):
        assert np.mean(told["peaks"][-10:]) == pytest.approx(seen[0, 6], rel=1e-6)
        assert step == 0 or [told["impacts"], told["bouncing"]] == pytest.approx(seen[0, 12:], rel=1e-5)
        seen, _, _, _, info = envs.step(np.full((1, 1), speed, np.float32))
        told = rig.run(speed, 10)
        assert rig.irregular[-1] == info["type_iii"][0]
        assert rig.damage == pytest.approx(info["damage"][0], rel=1e-9)


def test_exudyn_moves_the_same_beam():
    """Periodic at 19 Hz with the same peaks, impacts and bouncing; at 23.25 Hz deviations grow in both."""
    pytest.importorskip("exudyn")
    from benchmarks.envs.exudyn_beam import ExudynBeam

    beam = native_envs(ENV, 1).nominal
    runs = [kind(beam.at(19.0)).run(np.full(40, 19.0), beam.clearance) for kind in (OwnBeam, ExudynBeam)]
    ours, theirs = ([values[-8:] for values in ran] for ran in runs)
    np.testing.assert_allclose(theirs[0], ours[0], rtol=0.01)
    np.testing.assert_array_equal(theirs[1], ours[1])
    np.testing.assert_allclose(theirs[2], ours[2], rtol=0.01)
    assert max(ours[3].mean(), theirs[3].mean()) < -0.05
    wild = [kind(beam).run(np.full(40, 23.25), beam.clearance).growth[-25:].mean() for kind in (OwnBeam, ExudynBeam)]
    assert min(wild) > 0.5
