r"""Modal coordinates within a cycle, from the stroboscopic states and the sampled contact forces.

Between contacts a machine of modes is linear, and its contact forces are known at the samples of a record. So

    q'' + D q' + diag(w^2) q = f(t) - sum phi_j F_j(t)

is advanced from sample to sample by its exact propagator, with forces that are linear in between. Each cycle begins at
its recorded state, so errors do not add up; how far a cycle ends from the next recorded state is told as the miss.

References
----------
G. F. Franklin, J. D. Powell, M. L. Workman, Digital Control of Dynamic Systems, 3rd ed., 6.3.2 (triangle hold).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.errors import SimulationError
from chaosgym.simulation.record import CycleRecord

Array = NDArray[np.float64]


class ModalHistory(NamedTuple):
    """Modal coordinates (cycles, samples, n) [kg^1/2 m], and the largest miss of a cycle's end as a share of them."""

    coordinates: Array
    miss: float


def modal_history(record: CycleRecord) -> ModalHistory:
    """Modal coordinates at the samples of a record.

    Parameters
    ----------
    record
        Of a machine of a few modes at one speed, run with ``samples_per_cycle``.

    Raises
    ------
    SimulationError
        If the machine is none of modes, or the run kept no time history.
    """
    machine, every = record.machine, record.history if record.histories is None else record.histories
    parts = machine.flexible
    if parts is None:
        raise SimulationError(f"{machine.name} is no machine of a few modes; allowed: beams, and files of modes")
    if every is None:
        raise SimulationError("the run kept no time history; simulate with samples_per_cycle above 0")
    cycles, samples, _ = every.shape
    n = len(parts.stiffness)
    now, ahead, step = _propagators(parts.stiffness, parts.damping, machine.cycle_period / samples)
    ends = np.concatenate([record.section[1:], record.final_state.coordinates[None]])
    force = -every[:, :, 2::3] @ parts.joints  # (cycles, samples, n)
    phase = 2.0 * np.pi / samples * np.outer(np.arange(samples + 1), 1 + np.arange(len(parts.drive)))
    drive = np.cos(phase) @ parts.drive[:, 0] + np.sin(phase) @ parts.drive[:, 1] + parts.static
    after = np.concatenate([force[1:, 0], force[-1:, -1]])  # the force at the end of a cycle
    coordinates, state = np.empty((cycles, samples, n)), record.section.copy()
    for k in range(samples):
        coordinates[:, k] = state[:, :n]
        following = force[:, k + 1] if k + 1 < samples else after
        state = state @ step + (force[:, k] + drive[k]) @ now + (following + drive[k + 1]) @ ahead
    size = float(np.abs(coordinates).max())
    miss = float(np.abs(state[:, :n] - ends[:, :n]).max())
    return ModalHistory(coordinates, miss / size if size else 0.0)


def _propagators(stiffness: Array, damping: Array, interval: float) -> tuple[Array, Array, Array]:
    """Transposed matrices that take force at the beginning, force at the end, and state over an interval [s]."""
    from scipy.linalg import expm  # slow to import, and few questions need it

    n = len(stiffness)
    generator = np.block([[np.zeros((n, n)), np.eye(n)], [-np.diag(stiffness), -damping]])
    inputs = np.concatenate([np.zeros((n, n)), np.eye(n)])
    # state, force and what the force gains over the interval, all in units of the interval
    whole = np.zeros((4 * n, 4 * n))
    whole[: 2 * n, : 2 * n], whole[: 2 * n, 2 * n : 3 * n] = generator * interval, inputs * interval
    whole[2 * n : 3 * n, 3 * n :] = np.eye(n)
    found = expm(whole)
    step, held, ramp = found[: 2 * n, : 2 * n], found[: 2 * n, 2 * n : 3 * n], found[: 2 * n, 3 * n :]
    return (held - ramp).T, ramp.T, step.T
