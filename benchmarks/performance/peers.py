"""The beam of five plain modes in other programs: cycles per second of processor time, and the error that they reach.

Each starts from rest. The error is the difference of the peak force on the upper stop in the first cycle, some twenty
impacts, from that of refined exact events, as a share of it: a few cycles later chaos has magnified it to everything.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks.performance.exudyn_machines import ExudynSetting, run_in_exudyn
from benchmarks.performance.rates import BEAM
from benchmarks.performance.timing import processor_seconds
from chaosgym.arrays import Array
from chaosgym.machines import ImpactBeam
from chaosgym.machines.integrators import TIGHTEST_EVENTS
from chaosgym.simulation import RungeKutta4, simulate

SPEEDS = (30.0, 10.0)
"""Excitation frequencies [Hz]."""

SIDE_BY_SIDE = 1_000
"""Beams of a call of JAX."""

FIRST = 1
"""Cycles whose peaks are compared."""


class Peer(NamedTuple):
    """A program, how it is asked, at which frequency [Hz]: cycles per second of processor time, share of error."""

    name: str
    frequency: float
    cycles_per_second: float
    error: float


EQUAL_STEP = 5e-6
"""Step [s] by which fixed steps reach an error of about 1e-3 on the default beam."""

Run = tuple[float, Array]
"""Processor time [s] of a cycle of a beam, and peak force [N] of each cycle on the upper stop."""


def peers(speeds: tuple[float, ...] = SPEEDS, beams: int = SIDE_BY_SIDE) -> list[Peer]:
    """Run every program that is installed, and name those that are not, with nan.

    chaosgym, its Runge-Kutta method in numba, SciPy, JAX, diffrax, Exudyn and MuJoCo.
    """
    programs: dict[str, Callable[[Any], Run]] = {"chaosgym, exact events": partial(_simulated, cycles=1_000, step=None)}
    for step in (2e-5, 1e-5, 2e-6):
        programs[f"numba, RK4, {1e6 * step:g} us"] = partial(_simulated, cycles=100, step=step)
    programs["SciPy, DOP853, rtol 1e-6"] = lambda beam: _scipy(beam, "DOP853")
    programs["SciPy, LSODA, rtol 1e-6"] = lambda beam: _scipy(beam, "LSODA")
    programs[f"JAX, RK4, 10 us, vmap {beams:,}"] = lambda beam: _jax(beam, beams)
    programs[f"diffrax, Tsit5, rtol 1e-6, vmap {beams:,}"] = lambda beam: _diffrax(beam, beams)
    programs["Exudyn, RK44, 10 us"] = lambda beam: _exudyn(beam, 1e-5)
    programs["MuJoCo, RK4, 10 us, forces by a callback"] = lambda beam: _mujoco(beam, 1e-5)
    found = []
    for frequency in speeds:
        beam = replace(BEAM, excitation_frequency=frequency)
        exact = simulate(beam, FIRST, integrator=TIGHTEST_EVENTS).peak_force[:, 0]
        for name, run in programs.items():
            try:
                seconds, peaks = run(beam)
            except ImportError:
                found.append(Peer(f"{name}: not installed", frequency, math.nan, math.nan))
                continue
            error = float(np.max(np.abs(peaks[:FIRST] - exact) / exact))
            found.append(Peer(name, frequency, 1.0 / seconds, error))
    return found


def ratios(frequency: float) -> dict[str, tuple[float, float]]:
    """The default beam at a frequency [Hz]: by program, how many times the time of exact events, and its error."""
    beam = ImpactBeam(excitation_frequency=frequency)
    exact = simulate(beam, FIRST, integrator=TIGHTEST_EVENTS).peak_force[:, 0]
    own, _ = _simulated(beam, cycles=1_000, step=None)
    programs: dict[str, Callable[[Any], Run]] = {
        "Exudyn, RK44, 5 us": lambda beam: _exudyn(beam, EQUAL_STEP),
        "numba, RK4, 5 us": partial(_simulated, cycles=100, step=EQUAL_STEP),
        "SciPy, DOP853, rtol 1e-6": lambda beam: _scipy(beam, "DOP853"),
    }
    runs = {name: run(beam) for name, run in programs.items()}
    return {
        name: (seconds / own, float(np.max(np.abs(peaks[:FIRST] - exact) / exact)))
        for name, (seconds, peaks) in runs.items()
    }


def _simulated(beam: Any, cycles: int, step: float | None) -> Run:
    integrator = None if step is None else RungeKutta4(math.ceil(beam.cycle_period / step))
    peaks = simulate(beam, FIRST, integrator=integrator).peak_force[:, 0]
    return processor_seconds(lambda: simulate(beam, cycles, integrator=integrator)) / cycles, peaks


class Equations(NamedTuple):
    """The beam as first-order equations of its modes: y' = of(t, y), y (2n,); ``force`` on the upper stop [N].

    ``where`` and ``sine`` are those of numpy or of JAX.
    """

    of: Callable[[Any, Any], Any]
    force: Callable[[Any], Any]


def equations(beam: Any, library: Any = np) -> Equations:
    """Equations of a beam for numpy, or for ``jax.numpy``."""
    model = beam.reduce()
    n, omega = len(model.stiffness), 2.0 * math.pi * beam.excitation_frequency
    shape, damping, rates = (library.asarray(part) for part in (model.tip_shape, model.damping, model.stiffness))
    drive, gap = library.asarray(model.drive[0, 0, 1]), beam.clearance

    def pushes(depth: Any, rate: Any) -> Any:
        force = library.maximum(beam.contact_stiffness * depth + beam.contact_damping * rate, 0.0)
        return library.where(depth > 0.0, force, 0.0)

    def force(y: Any) -> Any:
        x, v = y[..., :n] @ shape, y[..., n:] @ shape
        return pushes(x - gap, v)

    def of(t: Any, y: Any) -> Any:
        q, v = y[:n], y[n:]
        x, rate = shape @ q, shape @ v
        contact = pushes(x - gap, rate) - pushes(-x - gap, -rate)
        return library.concatenate([v, drive * library.sin(omega * t) - rates * q - damping @ v - shape * contact])

    return Equations(of, force)


def _instants(beam: Any, samples: int) -> Array:
    return np.asarray(np.arange(1, FIRST * samples + 1) / samples * beam.cycle_period)


def _scipy(beam: Any, method: str, samples: int = 4_000) -> Run:
    own, instants = equations(beam), _instants(beam, samples)
    states: list[Array] = []

    def run() -> None:
        settings = {"method": method, "rtol": 1e-6, "atol": 1e-12, "max_step": beam.cycle_period / 20.0}
        states.append(solve_ivp(own.of, (0.0, instants[-1]), np.zeros(beam.n_states), t_eval=instants, **settings).y.T)

    seconds = processor_seconds(run) / FIRST
    forces: Array = own.force(states[0])
    peaks: Array = forces.reshape(FIRST, -1).max(axis=1)
    return seconds, peaks


def _jax(beam: Any, beams: int, step: float = 1e-5) -> Run:
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)
    steps = math.ceil(beam.cycle_period / step)
    own, h = equations(beam, jnp), beam.cycle_period / steps

    def advance(y: Any, k: Any) -> tuple[Any, Any]:
        t = k * h
        a = own.of(t, y)
        b = own.of(t + h / 2.0, y + h / 2.0 * a)
        c = own.of(t + h / 2.0, y + h / 2.0 * b)
        d = own.of(t + h, y + h * c)
        y = y + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
        return y, own.force(y)

    def cycle(y: Any) -> tuple[Any, Any]:
        y, forces = jax.lax.scan(advance, y, jnp.arange(steps))
        return y, forces.max()

    return _timed_batch(jax.jit(jax.vmap(cycle)), jnp.zeros((beams, beam.n_states)), beams)


def _diffrax(beam: Any, beams: int, samples: int = 4_000) -> Run:
    import diffrax
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)
    own, instants = equations(beam, jnp), jnp.arange(1, samples + 1) / samples * beam.cycle_period

    def cycle(y: Any) -> tuple[Any, Any]:
        found = diffrax.diffeqsolve(
            diffrax.ODETerm(lambda t, y, _: own.of(t, y)),
            diffrax.Tsit5(),
            0.0,
            beam.cycle_period,
            1e-6,
            y,
            saveat=diffrax.SaveAt(t1=True, ts=instants, fn=lambda t, y, _: y),
            stepsize_controller=diffrax.PIDController(rtol=1e-6, atol=1e-12),
            max_steps=1_000_000,
        )
        return found.ys[-1], own.force(found.ys).max()

    return _timed_batch(jax.jit(jax.vmap(cycle)), jnp.zeros((beams, beam.n_states)), beams)


def _timed_batch(cycle: Callable[[Any], Any], start: Any, beams: int) -> Run:
    """Time of the second cycle of many equal beams, and peaks of one; the first one compiles."""
    states, peaks = cycle(start)
    kept: list[Any] = []
    seconds = processor_seconds(lambda: kept.extend(one.block_until_ready() for one in cycle(states)))
    return seconds / beams, np.array([float(peaks[0])])


def _exudyn(beam: Any, step: float) -> Run:
    if find_spec("exudyn") is None:
        raise ImportError("exudyn")
    setting = ExudynSetting("RK44", "law", step)
    _, peaks = run_in_exudyn(beam, FIRST, setting, forces=True)
    assert peaks is not None
    return run_in_exudyn(beam, 20, setting, forces=False)[0] / 20, peaks


def _mujoco(beam: Any, step: float) -> Run:
    """A body on a slide for each mode, of unit mass; springs, dampers, drive and contact are forces of a callback."""
    import mujoco

    steps = math.ceil(beam.cycle_period / step)
    own, n = equations(beam), beam.n_states // 2
    body = '<body><joint type="slide" axis="1 0 0"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>'
    option = f'<option timestep="{beam.cycle_period / steps!r}" integrator="RK4" gravity="0 0 0"/>'
    model = mujoco.MjModel.from_xml_string(f"<mujoco>{option}<worldbody>{body * n}</worldbody></mujoco>")
    data, forces = mujoco.MjData(model), np.zeros(FIRST * steps)

    def push(_: Any, data: Any) -> None:
        data.qfrc_passive[:] = own.of(data.time, np.concatenate([data.qpos, data.qvel]))[n:]

    def run() -> None:
        for k in range(len(forces)):
            mujoco.mj_step(model, data)
            forces[k] = own.force(np.concatenate([data.qpos, data.qvel]))

    mujoco.set_mjcb_passive(push)
    try:
        seconds = processor_seconds(run) / FIRST
    finally:
        mujoco.set_mjcb_passive(None)
    peaks: Array = forces.reshape(FIRST, -1).max(axis=1)
    return seconds, peaks


if __name__ == "__main__":
    for speed in (30.0, 19.0, 10.0):
        for program, (ratio, error) in ratios(speed).items():
            print(f"{speed:g} Hz  {program:28s} {ratio:8.0f} times  error {error:.1e}")
