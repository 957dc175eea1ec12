"""The base of machines whose matrices vary with the angle of a drive: from held matrices and contacts to runs."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from chaosgym.arrays import Array
from chaosgym.core.binned.model import LINEAR, BinnedModel, TaylorModel
from chaosgym.core.cycle import CycleArrays, cycle_arrays
from chaosgym.machines.abilities import Propagation
from chaosgym.machines.binned.equations import STEP_PHASE
from chaosgym.machines.binned.held_machine import HeldMachine
from chaosgym.machines.binned.model import exact_model
from chaosgym.machines.binned.stepped import fastest_rate, stepped_model
from chaosgym.machines.integrators import Integrator

if TYPE_CHECKING:
    from chaosgym.core.tangent import Tangents
    from chaosgym.machines.batch import CompiledBatch


@dataclass(frozen=True, kw_only=True)
class BinnedMachine(HeldMachine):
    """A mechanism that is driven at a constant speed [rpm], with contacts along rows of displacement."""

    @property
    def fastest_rate(self) -> float:
        """Largest modulus [1/s] of an eigenvalue, contacts closed."""
        return fastest_rate(self, stepped_model(self, STEP_PHASE))

    def reduce(self, step_phase: float = STEP_PHASE) -> BinnedModel | TaylorModel:
        """Return the model with exact propagators if contact is linear and does not turn with a ball.

        The fastest motion turns by ``step_phase`` [rad] in half an interval between two readings of the contacts. Any
        other machine has a model for Taylor series. Machines that differ in clearance alone share all of it; those
        that differ in speed share the assembly.
        """
        return exact_model(self, step_phase) if self.has_propagators else stepped_model(self, 2.0 * step_phase)

    @property
    def moving(self) -> Propagation:
        """By propagators, or by Taylor series, whose derivative costs some five runs; see ``Machine.moving``.

        Deviations take linear contacts, by the propagators of the motion or the derivative of its series.
        """
        how = "exact propagation between contacts" if self.has_propagators else "Taylor series with contact forces"
        deviations = self.has_propagators or all(each.exponent == LINEAR for each in self.contacts)
        return Propagation(f"{how}, matrices held over {360.0 / self.bins:g} deg", deviations, not self.has_propagators)

    def arrays(self, cycles: int, samples: int = 0) -> CycleArrays:
        """Return the arrays into which ``run`` writes what happens in some cycles, with samples of the history."""
        channels = len(self.gaps) if self.sensors else 0
        return cycle_arrays(cycles, self.n_states, samples, travels=True, channels=channels)

    def run(
        self,
        coordinates: Array,
        bouncing: Array,
        arrays: CycleArrays,
        integrator: Integrator,
        tangents: "Tangents | None" = None,
    ) -> tuple[int, int]:
        """Run as many cycles as ``arrays`` has rows; see ``Machine.run``."""
        from chaosgym.machines.binned.run import run

        return run(self, coordinates, bouncing, arrays, integrator, tangents)

    def further_results(self, arrays: CycleArrays) -> dict[str, Any]:
        """Phase and components of each peak force."""
        return {"peak_phase": arrays.peak_instant * self.crank_rate, "peak_vector": arrays.peak_vector}

    def batch(self, count: int) -> "CompiledBatch":
        """Return ``count`` variants that move in one compiled call."""
        from chaosgym.machines.binned.run import BinnedBatch, TaylorBatch

        return (BinnedBatch if self.has_propagators else TaylorBatch)(self, count)
