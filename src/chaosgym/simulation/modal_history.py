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
from numpy.typing import ArrayLike

from chaosgym.arrays import Array
from chaosgym.core import matrices
from chaosgym.core.matrices import product
from chaosgym.errors import SimulationError
from chaosgym.simulation.record import CycleRecord


class ModalHistory(NamedTuple):
    """What modal coordinates show at the samples, (cycles, samples, k), and their largest miss at a cycle's end.

    The miss is a share of the largest modal coordinate.
    """

    shown: Array
    miss: float


def modal_history(record: CycleRecord, rows: ArrayLike | None = None) -> ModalHistory:
    """What modal coordinates show at the samples of a record.

    Parameters
    ----------
    record
        Of a machine of a few modes at one speed, run with ``samples_per_cycle``.
    rows : (k, n)
        What each mode contributes to each quantity that is shown; the modal coordinates [kg^1/2 m] themselves if None.

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
    seen = np.eye(n) if rows is None else np.array(rows, dtype=float, ndmin=2)
    now, ahead, step = _propagators(parts.stiffness, parts.damping, machine.cycle_period / samples)
    joints = every[:, :, 2::3]
    after = np.concatenate([joints[1:, 0], joints[-1:, -1]])  # the forces at the end of a cycle
    orders = 1 + np.arange(len(parts.drive))

    def load(k: int) -> Array:
        phase = 2.0 * np.pi * k / samples * orders
        drive = (
            product(matrices.cos(phase), parts.drive[:, 0])
            + product(matrices.sin(phase), parts.drive[:, 1])
            + parts.static
        )
        return np.asarray(drive - product(joints[:, k] if k < samples else after, parts.joints))

    shown, state, largest, ends = np.empty((cycles, samples, len(seen))), record.section.copy(), 0.0, record.section[1:]
    held = load(0)
    for k in range(samples):
        shown[:, k] = product(state[:, :n], seen.T)
        largest = max(largest, float(np.abs(state[:, :n]).max()))
        following = load(k + 1)
        state = product(state, step) + product(held, now) + product(following, ahead)
        held = following
    ends = np.concatenate([ends, record.final_state.coordinates[None]])
    miss = float(np.abs(state[:, :n] - ends[:, :n]).max())
    return ModalHistory(shown, miss / largest if largest else 0.0)


def _propagators(stiffness: Array, damping: Array, interval: float) -> tuple[Array, Array, Array]:
    """Transposed matrices that take force at the beginning, force at the end, and state over an interval [s]."""
    n = len(stiffness)
    generator = np.block([[np.zeros((n, n)), np.eye(n)], [-np.diag(stiffness), -damping]])
    inputs = np.concatenate([np.zeros((n, n)), np.eye(n)])
    # state, force and what the force gains over the interval, all in units of the interval
    whole = np.zeros((4 * n, 4 * n))
    whole[: 2 * n, : 2 * n], whole[: 2 * n, 2 * n : 3 * n] = generator * interval, inputs * interval
    whole[2 * n : 3 * n, 3 * n :] = np.eye(n)
    found = matrices.expm(whole)
    step, held, ramp = found[: 2 * n, : 2 * n], found[: 2 * n, 2 * n : 3 * n], found[: 2 * n, 3 * n :]
    return (held - ramp).T, ramp.T, step.T
