"""The golden set: what the results mean, by public names alone. What is shipped rests on it.

    cycles    the first two cycles from rest of every scene
    steps     observations and rewards of the first steps of every task, on machines too damped for chaos
    labels    natures and periods at 200 points of each dataset's axes

Numbers hold to a millionth, but for those of scenes that magnify a rounding of the model beyond it: `conditions.json`
holds the condition number of every entry of the cycles, and `ROUNDING` times that is its tolerance where it is more. A
label that a billionth of the clearance changes hangs on rounding: it is null and not compared, and one that such a
change gives back is no other label.

`python -m tests.golden.golden` computes the set, says what is new in it, and writes the files where something is.
"""

import json
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

import chaosgym
from chaosgym import ImpactBeam, SliderCrank
from chaosgym.envs import ENVIRONMENTS
from chaosgym.errors import ParameterError
from chaosgym.machines import Machine
from chaosgym.sweeps import SweepPlan
from tests.golden.scenes import RECORDED, scenes

STORED = Path(__file__).with_name("golden.json")

CONDITIONS = STORED.with_name("conditions.json")

TOLERANCE = 1e-6
"""Share of the largest number of an entry by which each of its numbers may differ, if it is well conditioned."""

ROUNDING = 1e-10
"""Relative change of all parameters that stands for rounding of the model.

Under six of OpenBLAS' kernels entries differ as if each parameter did by at most 1.4e-11; this is seven times as much.
"""

CHANGE = 1e-8
"""Relative change of a parameter by which condition numbers are computed: some 1e6 roundings of a number."""

CYCLES = 2
"""Cycles of a record: chaos does not yet magnify what differs."""

POINTS, BUDGET = 200, 200
"""Points of each dataset's axes, and cycles of a diagnosis."""

NEAR = (1.0 - 1e-9, 1.0 + 1e-9, 1.0 - 1e-7, 1.0 + 1e-7)
"""Factors of the clearance that stand for rounding in a label."""

SHOWN = 20
"""New entries of a part that the command lists."""

Entries = dict[str, Any]


def plain(value: Any) -> Any:
    """Numbers of a record as JSON keeps them, with ten digits."""
    return np.vectorize(lambda number: float(f"{number:.9e}"), otypes=[float])(np.asarray(value, dtype=float)).tolist()


def record_of(name: str, machine: Machine) -> dict[str, np.ndarray]:
    """Entries of the first cycles of a machine, by exact events."""
    record = chaosgym.simulate(machine, CYCLES, samples_per_cycle=3)
    what = (*RECORDED, "history") if record.sensor_peak is None else (*RECORDED, "history", "sensor_peak")
    return {f"{name}: {field}": np.asarray(getattr(record, field), dtype=float) for field in what}


def cycles() -> Entries:
    """First cycles of all scenes."""
    return {entry: plain(value) for scene in scenes() for entry, value in record_of(*scene).items()}


def largest(value: Any) -> float:
    """Largest modulus of an entry's numbers."""
    return float(np.abs(value).max(initial=0.0))


def _changed(machine: Machine) -> Iterator[Machine]:
    """A machine with one of its parameters changed a little, for each of them."""
    for field in fields(machine):
        value = getattr(machine, field.name)
        if isinstance(value, float) and value != 0.0:
            with suppress(ParameterError):  # bins of the crank must divide a revolution
                yield replace(machine, **{field.name: value * (1.0 - CHANGE)})


def conditions() -> dict[str, float]:
    """Condition number of every entry of the cycles: how far a relative change of all parameters moves it, at most.

    It is the sum, over the parameters of the machine, of the share of the entry's largest number by which a change of
    one moves any number, per relative change. The model is smooth in the parameters, so rounding in it moves an entry
    as a change of them of about that size does. Every contact on the way is in it.
    """
    result = {}
    for name, machine in scenes():
        record = record_of(name, machine)
        total = dict.fromkeys(record, 0.0)
        for other in _changed(machine):
            for entry, numbers in record_of(name, other).items():
                total[entry] += largest(numbers - record[entry]) / CHANGE / (largest(record[entry]) or 1.0)
        result |= {entry: float(f"{number:.1e}") for entry, number in total.items()}
    return result


def steps() -> Entries:
    """Observations, rewards and ends of the first steps of damped machines under random actions."""
    result = {}
    for name in ENVIRONMENTS:
        damped = {"contact_damping_ratio": 0.3} if "Crank" in name else {"damping_ratio": 0.3}
        envs = gym.make_vec(name, num_envs=3, **damped)
        envs.action_space.seed(5)
        result[f"{name}: reset"] = plain(envs.reset(seed=5)[0])
        parts = ("observation", "reward", "ended")
        for step in range(4):
            for what, value in zip(parts, envs.step(envs.action_space.sample())[:3], strict=True):
                result[f"{name}: step {step}: {what}"] = plain(value)
    return result


def _points() -> Iterator[tuple[str, Machine]]:
    """Name and machine of every labelled point."""
    for kind in (ImpactBeam, SliderCrank):
        settings = json.loads(Path("datasets", kind.name, "plan.json").read_text())
        plan = replace(SweepPlan.from_settings(settings), sampling="sobol", size=POINTS, seed=0)
        columns = plan.points()
        for i in range(POINTS):
            yield f"{kind.name}: {i}", plan.machine_at({field: float(values[i]) for field, values in columns.items()})


def _label(machine: Machine) -> str:
    verdict = chaosgym.diagnose(machine, budget=BUDGET).labelled("thesis")
    return f"{verdict.nature} {verdict.period}" if verdict.period else verdict.nature


def _labels_near(machine: Machine) -> Iterator[str]:
    """Labels where the clearance differs by as little as rounding."""
    clearance = getattr(machine, machine.clearance_field)
    return (_label(machine.at(clearance=factor * clearance)) for factor in NEAR)


def labels(kept: Entries) -> Entries:
    """Nature and period of every point; those of ``kept`` where a machine as near as rounding has these."""
    result: Entries = {}
    for name, machine in _points():
        label, other = _label(machine), kept.get(name)
        hangs = other not in (None, label) and other in _labels_near(machine)
        result[name] = other if hangs else label
    return result


def firm_labels() -> Entries:
    """Nature and period of every point; None where a change of the clearance as small as rounding changes one."""
    result: Entries = {}
    for name, machine in _points():
        label = _label(machine)
        result[name] = label if all(near == label for near in _labels_near(machine)) else None
    return result


def differences(found: Entries, kept: Entries, condition: Mapping[str, float] | None = None) -> dict[str, str]:
    """What is new in entries: by name, how far from what is kept, beyond what rounding is magnified to."""
    condition = json.loads(CONDITIONS.read_text()) if condition is None else condition
    result = dict.fromkeys(set(found) ^ set(kept), "here or there only")
    for name in set(found) & set(kept):
        one, other = found[name], kept[name]
        if isinstance(one, list):
            new, old = np.array(one), np.array(other)
            if new.shape != old.shape:
                result[name] = f"shape {new.shape}, kept {old.shape}"
                continue
            tolerance = max(TOLERANCE, ROUNDING * condition.get(name, 0.0))
            if not (error := largest(new - old)) <= tolerance * largest(old):
                result[name] = f"differs by {error:.1e}, largest {largest(old):.1e}, tolerance {tolerance:.0e} of it"
        elif other is not None and one != other:
            result[name] = f"{one}, kept {other}"
    return dict(sorted(result.items()))


def main() -> None:
    """Write the set anew where its meaning is new."""
    kept = json.loads(STORED.read_text()) if STORED.exists() else {}
    found = {"cycles": cycles(), "steps": steps(), "labels": labels(kept.get("labels", {}))}
    new = {part: differences(entries, kept.get(part, {})) for part, entries in found.items()}
    for part, lines in new.items():
        print(f"{part}: {len(lines)} of {len(found[part])} entries are new")
        print(*(f"  {name}: {how}" for name, how in list(lines.items())[:SHOWN]), sep="\n", end="\n" if lines else "")
    if not any(new.values()):
        print("the golden set means what it did and is left as it is")
        return
    found["labels"] = firm_labels() if new["labels"] else kept["labels"]
    parts = (
        f'"{part}": {{\n' + ",\n".join(f"{json.dumps(name)}: {json.dumps(value)}" for name, value in entries.items())
        for part, entries in found.items()
    )
    STORED.write_text("{\n" + "\n},\n".join(parts) + "\n}\n}\n")
    if new["cycles"]:
        CONDITIONS.write_text(json.dumps(conditions(), indent=0) + "\n")
    print(f"{STORED.name} is written: what was computed before is stale")


if __name__ == "__main__":
    main()
