"""Small runs by kernels that are not compiled: `NUMBA_DISABLE_JIT=1 python -m tests.uncompiled.run FILE`."""

import ctypes
import sys

import gymnasium as gym
import numpy as np

import chaosgym
import chaosgym.core.batch
import chaosgym.core.binned.batch
import chaosgym.core.compilation
from chaosgym import ImpactBeam, SliderCrank
from chaosgym.classifier import classifier_for
from chaosgym.simulation import simulate_with_deviations
from tests.classifier.made_up import record_features
from tests.golden.scenes import RECORDED, scenes
from tests.uncompiled.lanes import OPERATIONS, compiled

ALIKE = ("slider-crank: ball joint", "slider-crank: both joints")
"""Scenes of whose deviations another one's are enough: each takes a quarter of a minute."""

TASK = "chaosgym/ImpactBeamTolerance-v1"
"""A task that is calm: chaos would magnify rounding in the 20 cycles before the first step."""


def install():
    """Let every kernel call the operations of numpy: vectors of LLVM exist compiled only."""
    plain = {id(compiled(name)): operation for name, operation in OPERATIONS.items()}
    for module in [module for name, module in sys.modules.items() if name.startswith("chaosgym.")]:
        for name, value in list(vars(module).items()):
            if id(value) in plain:
                setattr(module, name, plain[id(value)])
    for module in (chaosgym.core.batch, chaosgym.core.binned.batch):
        module.pointer = lambda address: ctypes.c_void_p(int(address))
    chaosgym.core.compilation.prepare = lambda *_: None


def results():
    """Arrays by name: a cycle of every golden scene, a deviation, a batch of cranks and one step of a task."""
    found = {}
    for name, machine in scenes():
        record = chaosgym.simulate(machine, 1, samples_per_cycle=3)
        found |= {f"{name}, {field}": getattr(record, field) for field in RECORDED}
        found[f"{name}, history"] = record.history
        if machine.moving.deviations and name not in ALIKE:
            vectors = np.eye(len(record.section[0]))[:1]
            found[f"{name}, deviations"] = simulate_with_deviations(machine, 1, deviations=vectors)[1]
    fixed = chaosgym.RungeKutta4(steps_per_cycle=2000)
    for machine in (ImpactBeam(), SliderCrank()):
        found[f"{machine.name}, fixed steps"] = chaosgym.simulate(machine, 1, integrator=fixed).section
    cranks = SliderCrank().batch(2)
    for i in range(2):
        cranks.start(i, SliderCrank(crank_speed=180.0 + i))
    found["cranks side by side"] = cranks.run(np.arange(2), 1).peak_force
    envs = gym.make_vec(TASK, num_envs=2, cycles_per_step=2)
    found["reset"] = envs.reset(seed=5)[0]
    found["step"], found["reward"] = envs.step(np.array([5, 5]))[:2]
    for machine in (ImpactBeam(), SliderCrank()):
        answer = classifier_for(machine).classify(machine, budget_us=0.0, types=False)
        found[f"{machine.name}, by parameters"] = np.array([*answer.centre.probabilities.values()])
    found["a record"] = record_features(found["impact-beam: periodic, peak_force"].repeat(16)[None], sensor_error=[1.0])
    return found


if __name__ == "__main__":
    install()
    np.savez(sys.argv[1], **results())
