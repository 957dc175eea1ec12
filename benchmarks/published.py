"""Machines that other people published, each a file in docs/machines: orbit diagrams, and one of them in SciPy.

    python -m benchmarks.published docs/machines

writes orbits.png and prints the rates and the orbit of the impact oscillator here and in SciPy, as JSON.
"""

import json
import math
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

import chaosgym
from chaosgym.arrays import Array
from chaosgym.machines import Machine

PANELS = {
    "shaw-holmes-1983": "closed form: period 1 up to 2.653, where it doubles; chaos beyond",
    "kahraman-singh-1990": "circles: closed form where no tooth separates; jump at resonance",
    "moon-shaw-1983": "subharmonic and chaotic bands between periodic ones",
    "heat-exchanger-tube": "chaotic rattling; the published onset by flow speed can't be asked",
}
"""File, and the published statement."""

SHOWN, SETTLING = 40, 160
"""Cycles of a speed that are drawn, and those before."""


def orbit_diagram(machine: Machine, speeds: Array) -> list[Array]:
    """Peak forces [N] (cycles,) at each speed, the motion going on from one to the next."""
    state, peaks = None, []
    for speed in speeds:
        record = chaosgym.simulate(machine.at(float(speed)), SHOWN, state, transient=SETTLING)
        state = record.final_state
        peaks.append(record.peak_force[:, 0])
    return peaks


def no_separation(machine: Any, speeds: Array) -> Array:
    """Peak force [N] of the gear pair in mesh throughout, by the linear oscillator; NaN where its teeth separate."""
    mass = 1.0 / float(machine.modes.shape("mesh")[0]) ** 2
    omega, natural = 2.0 * math.pi * speeds, math.sqrt(machine.contact_stiffness / mass)
    damping = float(machine.modes.damping[0, 0])
    amplitude = machine.drives[0].harmonics[0][2] * omega**2 * machine.contact_stiffness / mass
    amplitude = amplitude / np.hypot(natural**2 - omega**2, damping * omega)
    return np.where(amplitude < machine.preload, machine.preload + amplitude, np.nan)


def orbits_figure(folder: Path) -> Figure:
    """Orbit diagrams of all machines, speed going up and, grey, down."""
    figure = Figure(figsize=(11.0, 7.5), layout="constrained")
    for panel, (name, statement) in zip(figure.subplots(2, 2).flat, PANELS.items(), strict=True):
        machine = chaosgym.read_machine(folder / f"{name}.toml")
        speeds = np.linspace(*machine.usual_ranges["speed"], 241)
        for order, colour in ((slice(None, None, -1), "0.6"), (slice(None), "tab:blue")):
            for speed, peaks in zip(speeds[order], orbit_diagram(machine, speeds[order]), strict=True):
                panel.plot(np.full(len(peaks), speed), peaks, ".", ms=0.8, color=colour)
        if name == "kahraman-singh-1990":
            panel.plot(speeds[::4], no_separation(machine, speeds)[::4], "o", mfc="none", ms=4, color="tab:red")
        if name == "shaw-holmes-1983":
            panel.axvline(2.65335, color="tab:red", linewidth=0.8)
        panel.set(xlabel="speed [Hz]", ylabel="peak force [N]")
        panel.set_title(f"{name}\n{statement}", fontsize=9)
    return figure


def in_scipy(machine: Any, cycles: int) -> tuple[Array, float]:
    """Peak forces (cycles,) [N] from rest, and processor seconds, of a one-mode machine by DOP853 with events."""
    from scipy.integrate import solve_ivp

    (rate,), (shape,) = machine.modes.angular_frequency, machine.modes.shape(machine.joint)
    (_, cosine, sine), omega = machine.drives[0].harmonics[0], 2.0 * math.pi * machine.speed
    stiffness, damping, gap = machine.contact_stiffness, machine.contact_damping, machine.clearance

    def push(state: Any) -> Any:
        return stiffness * (state[0] * shape - gap) + damping * state[1] * shape

    def slope(t: float, state: Array, pressed: bool) -> list[float]:
        force = cosine * math.cos(omega * t) + sine * math.sin(omega * t) - (push(state) if pressed else 0.0)
        return [state[1], shape * force - rate**2 * state[0]]

    def touch(t: float, state: Array, pressed: bool) -> Any:
        return push(state) if pressed else state[0] * shape - gap

    began, time_now, end, state, pressed = time.process_time(), 0.0, cycles / machine.speed, np.zeros(2), False
    peaks = np.zeros(cycles)
    setting: Any = {"method": "DOP853", "rtol": 1e-9, "atol": 1e-12, "events": touch, "dense_output": True}
    touch.terminal = True  # type: ignore[attr-defined]
    while time_now < end * (1.0 - 1e-12):
        touch.direction = -1.0 if pressed else 1.0  # type: ignore[attr-defined]
        done = solve_ivp(slope, (time_now, end), state, args=(pressed,), **setting)
        if pressed:
            instants = np.linspace(done.t[0], done.t[-1], 400)
            cycle = min(int(instants[-1] * machine.speed), cycles - 1)
            peaks[cycle] = max(peaks[cycle], float(np.max(push(done.sol(instants)))))
        time_now, state = float(done.t[-1]), done.y[:, -1]
        pressed = not pressed if done.status == 1 else pressed
    return peaks, time.process_time() - began


def against_scipy(folder: Path, cycles: int = 300) -> dict[str, Any]:
    """Rates of the impact oscillator, and its settled peak force, here and in SciPy."""
    machine = chaosgym.read_machine(folder / "shaw-holmes-1983.toml").at(2.4)
    peaks, seconds = in_scipy(machine, cycles)
    chaosgym.simulate(machine, 10)
    began = time.process_time()
    record = chaosgym.simulate(machine, 100 * cycles)
    own = time.process_time() - began
    return {
        "cycles_per_second": 100 * cycles / own,
        "cycles_per_second_scipy": cycles / seconds,
        "settled_peak_force_N": float(record.peak_force[-1, 0]),
        "settled_peak_force_N_scipy": float(peaks[-1]),
    }


def main() -> None:
    """Write the picture and print the comparison."""
    folder = Path(sys.argv[1])
    orbits_figure(folder).savefig(folder / "orbits.png", dpi=110)
    print(json.dumps(against_scipy(folder), indent=1))


if __name__ == "__main__":
    main()
