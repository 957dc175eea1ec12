"""The golden set: records, labels and observations of chosen scenes, by public names alone.

`python -m tests.golden.golden` writes it anew. Do so only with a change that is meant to move the last digit of a
result, and say in the commit by how much it moved.
"""

import json
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

import chaosgym
from chaosgym import ImpactBeam, SliderCrank
from chaosgym.envs import ENVIRONMENTS

STORED = Path(__file__).with_name("golden.json")
VERSIONS = Path(__file__).with_name("versions.json")
"""Versions of what compiles and computes, with which the set was written: others round otherwise."""

CYCLES, TRANSIENT = 6, 2
"""Cycles of a record, and before it: short, so that chaos does not magnify what differs."""

BEAMS: dict[str, dict[str, Any]] = {
    "chaotic": {"excitation_frequency": 30.0},
    "periodic": {"excitation_frequency": 19.0},
    "narrow": {"excitation_frequency": 7.0, "clearance": 0.03e-3},
    "wide": {"excitation_frequency": 24.0, "clearance": 0.254e-3},
    "uniform damping": {"damping_family": "uniform", "excitation_frequency": 13.0},
    "rigid": {"n_modes": 1, "fitted_modes": 0},
    "restitution": {"contact_law": "restitution", "n_modes": 1, "fitted_modes": 0},
    "many modes": {"n_modes": 12, "event_accuracy": "tightest"},
}

CRANKS: dict[str, dict[str, Any]] = {
    "slider joint": {"crank_speed": 190.0, "slider_clearance": 0.254e-3},
    "slider joint, fast": {"crank_speed": 270.0, "slider_clearance": 0.032e-3},
    "ball joint": {"crank_speed": 120.0, "slider_joint": "ideal", "ball_joint": "spherical"},
    "rigid rod": {"rod": "rigid"},
    "coarse bins": {"matrix_update_interval": 5.0},
    "motor at an angle": {"motor_angle": 25.0, "crank_speed": 200.0},
    "in space, ball": {"motor_angle": 25.0, "slider_joint": "ideal", "ball_joint": "spherical"},
    "instrumented": {"slider_joint": "instrumented", "crank_speed": 150.0},
    "both joints": {"ball_joint": "spherical", "crank_speed": 160.0},
    "hertz": {"contact_law": "hertz", "crank_speed": 180.0},
    "gravity": {"gravity": 9.81, "crank_speed": 210.0},
}

RECORDED = ("section", "peak_force", "impacts", "contact_fraction", "bounce_duration")


def scenes() -> Iterator[tuple[str, Any]]:
    """Name and machine of every scene."""
    for kind, cases in ((ImpactBeam, BEAMS), (SliderCrank, CRANKS)):
        for name, fields in cases.items():
            yield f"{kind.name}: {name}", kind(**fields)


def plain(value: Any) -> Any:
    """The value as JSON keeps it; floats as hexadecimal text, which loses no bit."""
    if isinstance(value, dict):
        return {str(key): plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple | set):
        return [plain(one) for one in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, np.generic):
        return plain(value.item())
    return value.hex() if isinstance(value, float) else value


def records() -> dict[str, Any]:
    """Records of all scenes, by exact events; of some by Runge-Kutta."""
    result = {}
    for name, machine in scenes():
        record = chaosgym.simulate(machine, CYCLES, transient=TRANSIENT, samples_per_cycle=3)
        result[name] = {field: getattr(record, field) for field in RECORDED} | {"history": record.history}
        if record.sensor_peak is not None:
            result[name]["sensor_peak"] = record.sensor_peak
    fixed = chaosgym.RungeKutta4(steps_per_cycle=2000)
    for name, machine in (("impact-beam", ImpactBeam()), ("slider-crank", SliderCrank())):
        record = chaosgym.simulate(machine, 3, integrator=fixed)
        result[f"{name}: Runge-Kutta"] = {field: getattr(record, field) for field in RECORDED}
    return result


def labels() -> dict[str, Any]:
    """Verdicts and types of points that are far from a boundary, with their figures."""
    result = {}
    for name, machine in {
        "beam, periodic": ImpactBeam(excitation_frequency=19.0),
        "beam, chaotic": ImpactBeam(),
        "crank, periodic": SliderCrank(crank_speed=270.0, slider_clearance=0.032e-3),
    }.items():
        verdict = chaosgym.diagnose(machine, budget=100 if "chaotic" in name else 400)
        result[name] = {
            "nature": verdict.nature,
            "period": verdict.period,
            "status": verdict.status,
            "votes": dict(verdict.votes),
            "largest peak": verdict.evidence["largest_peak"],
            "exponent": verdict.evidence["largest_lyapunov_exponent_per_cycle"]["value"],
        }
    judged = chaosgym.response_type(ImpactBeam(excitation_frequency=19.0), window="speed-clearance")
    result["beam, type"] = {"type": judged.type, "neighbours": [one._asdict() for one in judged.neighbours]}
    return result


def observations() -> dict[str, Any]:
    """Observations, rewards and what is said of the nominal and of drawn machines under random actions."""
    result = {}
    for name in ENVIRONMENTS:
        env = gym.make(name)
        env.action_space.seed(5)
        steps: list[Any] = [env.reset(seed=5)[0]]
        for _ in range(4):
            observation, reward, terminated, truncated, _ = env.step(env.action_space.sample())
            steps.append([observation, reward, terminated, truncated])
        result[name] = steps
        envs = gym.make_vec(name, num_envs=3)
        envs.action_space.seed(5)
        result[f"{name}, vector"] = [envs.reset(seed=5)[0], *(envs.step(envs.action_space.sample())[:2] for _ in "ab")]
    return result


def golden() -> dict[str, Any]:
    """Compute the whole set."""
    parts = {"records": records(), "labels": labels(), "observations": observations()}
    result: dict[str, Any] = plain(parts)
    return result


def versions() -> dict[str, str]:
    """Versions at hand."""
    return {name: version(name) for name in ("llvmlite", "numba", "numpy", "scipy")}


if __name__ == "__main__":
    STORED.write_text(json.dumps(golden(), indent=0) + "\n")
    VERSIONS.write_text(json.dumps(versions(), indent=0) + "\n")
