"""Machines' files as people write them, drawn at random: how many get an answer.

``python -m tests.diagnosis.ordinary COUNT`` prints natures by kind of machine, and which tests could not decide.
"""

import itertools
import sys
import tempfile
from collections import Counter
from pathlib import Path

import numpy as np

import chaosgym

KINDS = ("one stop", "two stops", "free body", "shaken base", "turning")


def file_of(seed):
    """(Kind, text) of a machine's file: one to five modes, damped, driven so that its gap closes in most of them."""
    rng = np.random.default_rng([20261127, seed])
    kind, count = KINDS[seed % len(KINDS)], int(rng.integers(1, 6))
    turning, free = kind == "turning", kind == "free body"
    hertz = np.sort(10.0 ** rng.uniform(0.7, 2.5, count))
    ratios = rng.uniform(0.005, 0.05, count)
    shapes = rng.uniform(0.5, 2.5, count) * rng.choice([-1.0, 1.0], count)
    if turning:
        shapes *= 20.0  # inertias of some kg cm^2
    speed = float(hertz[0] * rng.uniform(0.3, 2.5))
    rows = [f'frequencies = "{_row(hertz)} Hz"', f'damping_ratios = "{_row(100.0 * ratios)} %"']
    if free:
        hertz[0], speed = 0.0, float(10.0 ** rng.uniform(0.5, 1.7))
        rates = np.diag(4.0 * np.pi * ratios * np.maximum(hertz, speed))
        listed = ", ".join(f'"{_row(row)} 1/s"' for row in rates)
        rows = [f'frequencies = "{_row(hertz)} Hz"', f"modal_damping = [{listed}]"]
    gap = float(10.0 ** rng.uniform(-4.5, -3.0))
    # the amplitude without stops, of the slowest mode at its share of resonance
    square = 4.0 * np.pi**2 * (abs(hertz[0] ** 2 - speed**2) + ratios[0] * speed * max(hertz[0], speed))
    force = gap * square / shapes[0] ** 2 * float(rng.uniform(0.7, 5.0))
    fastest = 2.0 * np.pi * max(hertz.max(), speed) * float(10.0 ** rng.uniform(0.3, 1.3))
    spring = fastest**2 / float(shapes @ shapes)
    metre, newton, shape, per = ("rad", "N m", "kg^-1/2 m^-1", "N m/rad") if turning else ("m", "N", "kg^-1/2", "N/m")
    points = [f'tip = "{_row(shapes)} {shape}"', f'other = "{_row(shapes[0] * rng.uniform(0.2, 1.0, count))} {shape}"']
    drive = f'at = "{rng.choice(["tip", "other"])}"\nforce = "{force:.6g} {newton}"'
    if kind == "shaken base":
        base = rng.uniform(0.2, 1.0, count) / shapes
        points.append(f'base = "{_row(base)} kg^1/2"')
        drive = f'acceleration = "{force * abs(shapes[0] / base[0]):.6g} m/s^2"'
    gravity = f'preload = "{rng.uniform(0.1, 0.8) * force:.6g} {newton}"\n' if rng.random() < 0.4 else ""
    return kind, "\n".join(
        [
            "[structure]",
            *rows,
            "[structure.shapes]",
            *points,
            "[joint]",
            'at = "tip"',
            f'clearance = "{gap:.6g} {metre}"',
            f'stops = "{"one" if kind == "one stop" else "two"}"',
            f'stiffness = "{spring:.6g} {per}"',
            f"restitution = {rng.uniform(0.3, 0.95):.3g}",
            gravity + "[[drive]]",
            drive,
            "[operation]",
            f'speed = "{speed:.6g} Hz"',
            f'speed_range = "{0.5 * speed:.6g} to {2.0 * speed:.6g} Hz"',
            f'clearance_range = "{0.5 * gap:.6g} to {2.0 * gap:.6g} {metre}"',
        ]
    )


def _row(values):
    return ", ".join(f"{value:.6g}" for value in values)


def machine(seed):
    """(Kind, machine) of the file of a seed."""
    kind, text = file_of(seed)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"ordinary-{seed}.toml"
        path.write_text(text)
        return kind, chaosgym.read_machine(path)


def diagnosed(seeds):
    """(Natures by kind, what is said of each machine without an answer) of the files of some seeds."""
    natures, unresolved = Counter(), {}
    for seed in seeds:
        kind, made = machine(seed)
        verdict = chaosgym.diagnose(made)
        natures[kind, verdict.nature] += 1
        if verdict.nature == "undetermined":
            unresolved[seed] = f"{kind}: {verdict.reason}; votes {verdict.votes}"
    return natures, unresolved


if __name__ == "__main__":
    counts, told = diagnosed(range(int(sys.argv[1])))
    for kind, nature in itertools.product(KINDS, ("periodic", "quasiperiodic", "chaotic", "undetermined")):
        print(f"{kind:12s} {nature:14s} {counts[kind, nature]}")
    for seed, why in told.items():
        print(seed, why)
    print(f"undetermined: {len(told)} of {sys.argv[1]}")
