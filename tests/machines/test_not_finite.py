"""What is no number never holds a process: kernels come back from it, and models of it are refused."""

import subprocess
import sys

import numpy as np
import pytest

from chaosgym import ModalMachine, SliderCrank, Structure, simulate
from chaosgym.errors import ParameterError, SimulationError
from chaosgym.machines.flexible_model import Modes, flexible_model
from chaosgym.machines.slider_crank import machine as crank_model

SECONDS = 300
"""Time that a kernel may take, its compilation included; without a bound it takes for ever."""

KERNEL = """
import numpy as np
from chaosgym import SliderCrank
from chaosgym.core import status
from chaosgym.core.tangent import no_tangents
from chaosgym.core.binned.cycle import advance

crank = SliderCrank(fidelity="draft")
model, state = crank.reduce(), np.zeros(crank.n_states)
{spoil}
arrays = crank.arrays(2)
outcome = advance(
    model, state, np.zeros(3), arrays, 1e-12, 20_000, no_tangents(crank.n_states, 2)
)
print(outcome, status.DIVERGED)
assert outcome[0] != status.OK
"""


@pytest.mark.parametrize("spoil", ["state[3] = np.nan", "state[0] = np.inf", "model.table[:] = np.nan"])
def test_the_exact_kernel_of_the_crank_comes_back(spoil):
    """A state or a table that is no number ends the first revolution, with a status that says so."""
    run = subprocess.run(
        [sys.executable, "-c", KERNEL.format(spoil=spoil)], timeout=SECONDS, capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stderr


def test_a_crank_whose_equations_are_no_numbers_is_refused(monkeypatch):
    """The builder of every crank's model refuses what its equations can't give, by both kernels."""
    usual = crank_model.equations

    def spoiled(machine, middles, nodes):
        found = usual(machine, middles, nodes)
        found.stiffness[0, 3] = np.nan
        return found

    monkeypatch.setattr(crank_model, "equations", spoiled)
    for law in ("linear", "hertz"):
        with pytest.raises(ParameterError, match="not finite"):
            simulate(SliderCrank(contact_law=law, matrix_update_interval=7.2, rod_length=0.2351), 1)


def test_a_model_of_modes_that_are_no_numbers_is_refused():
    """Frequencies, damping, shapes and static forces are finite before any kernel sees them."""
    modes = Modes(np.array([60.0, 900.0]), np.eye(2), np.ones(2), np.ones(2))
    for name, value in (("tip_shape", [np.nan, 1.0]), ("damping", np.full((2, 2), np.inf))):
        with pytest.raises(ParameterError, match="not finite"):
            flexible_model(modes._replace(**{name: np.array(value)}), 1e5, 1.0)
    with pytest.raises(ParameterError, match="not finite"):
        flexible_model(modes, 1e5, 1.0, static_force=np.array([np.nan, 0.0]))


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_state_that_is_no_number_is_refused(value):
    """``simulate`` takes finite states only, of any machine; a crank that is beyond every bound ends in an error."""
    body = ModalMachine(modes=Structure.of_modes([5.0], 0.01, {"tip": [1.0]}), joint="tip")
    for machine in (body, SliderCrank(fidelity="draft")):
        with pytest.raises(ParameterError, match="finite"):
            simulate(machine, 1, np.full(machine.n_states, value))
    with pytest.raises(SimulationError):
        simulate(machine, 1, np.full(machine.n_states, 1e300))
