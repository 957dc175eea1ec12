"""Integrators: exact propagation between contact events, or fixed steps."""

from dataclasses import dataclass, replace

from chaosgym.numbers import number, whole


@dataclass(frozen=True)
class ExactEvents:
    """Exact propagation between contact events; the default.

    Attributes
    ----------
    step_phase
        Angle [rad] by which the fastest mode turns in the shortest step. Accuracy hardly depends on it.
    event_tolerance
        Error of the instant of an event, as an angle [rad] of the fastest mode.
    event_budget
        Contact events that one cycle may have before the run is given up.

    Examples
    --------
    >>> chaosgym.ExactEvents().refined()
    ExactEvents(step_phase=0.25, event_tolerance=1e-10, event_budget=20000)
    """

    step_phase: float = 0.5
    event_tolerance: float = 1e-9
    event_budget: int = 20_000

    def __post_init__(self) -> None:
        number("step_phase", self.step_phase, 1e-6, 1.0, "rad")
        number("event_tolerance", self.event_tolerance, 1e-14, 1e-2)
        whole("event_budget", self.event_budget, 1)

    def refined(self) -> "ExactEvents":
        """Half the step and a tenth of the tolerance."""
        return replace(self, step_phase=self.step_phase / 2, event_tolerance=max(self.event_tolerance / 10, 1e-14))


@dataclass(frozen=True)
class RungeKutta4:
    """Fixed steps of the classical Runge-Kutta method, without event location; for comparison.

    Examples
    --------
    >>> beam, steps = chaosgym.ImpactBeam(excitation_frequency=12.0), chaosgym.RungeKutta4(steps_per_cycle=8000)
    >>> record = chaosgym.simulate(beam, cycles=10, transient=100, integrator=steps)
    >>> float(record.peak_force.max().round(1))
    32.3
    """

    steps_per_cycle: int = 4000

    def __post_init__(self) -> None:
        whole("steps_per_cycle", self.steps_per_cycle, 1)

    def refined(self) -> "RungeKutta4":
        """Half the step."""
        return replace(self, steps_per_cycle=2 * self.steps_per_cycle)


TIGHTEST_EVENTS = ExactEvents(step_phase=0.25, event_tolerance=1e-13)
"""Events placed as closely as rounding allows."""

Integrator = ExactEvents | RungeKutta4
