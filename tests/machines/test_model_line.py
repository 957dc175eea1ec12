import numpy as np
import pytest

from chaosgym.diagnosis.periodic_orbit import run_period
from chaosgym.machines import ImpactBeam
from chaosgym.machines.modal_machine import Drive, ModalMachine, Structure
from chaosgym.machines.parameters import with_settings
from chaosgym.simulation import simulate

BEAM = ImpactBeam(excitation_frequency=19.0)


def furthest(machine, field, share):
    """Largest difference of three cycles from an interpolated and from the exact model, at values of no node."""
    low, high = (getattr(machine, field) * factor for factor in (1.0 - share, 1.0 + share))
    machines, state = machine.along(field, low, high), simulate(machine, 1, transient=100).final_state.coordinates
    found = []
    for value in low + (high - low) * np.array([0.013, 0.31, 0.77]):
        other = machines(float(value))
        assert getattr(other, field) == value
        exact = run_period(with_settings(machine, {field: float(value)}), state, 3).end
        found.append(float(np.linalg.norm(run_period(other, state, 3).end - exact) / np.linalg.norm(exact)))
    return max(found), other.interpolated is not None


@pytest.mark.parametrize(
    ("field", "share"),
    [("shaker_damping", 0.1), ("damping_ratio", 0.1), ("contact_damping", 0.1), ("length", 0.001), ("height", 0.01)],
)
def test_interpolated_models_move_as_exact_ones_do(field, share):
    """Three cycles of the beam with contacts agree to 1e-7 of the state's size wherever a model is interpolated."""
    distance, interpolated = furthest(BEAM, field, share)
    assert interpolated
    assert distance < 1e-7


def test_where_modes_change_in_kind_each_model_is_exact():
    """Between under- and overdamped modes there is no polynomial; the machine at a value is the exact one."""
    structure = Structure.of_modes([5.0, 20.0], 0.9, {"tip": [1.1, 0.9]})
    machine = ModalMachine(modes=structure, joint="tip", drives=(Drive.sine("force", "tip", 5.0),), speed=4.0)
    distance, interpolated = furthest(machine, "damping_factor", 0.3)
    assert not interpolated
    assert distance == 0.0


@pytest.mark.parametrize("field", ["force_amplitude", "excitation_frequency", "clearance"])
def test_a_field_that_leaves_the_modes_alone_shares_them(field):
    """Speed, clearance and force reach the model without new modes, and give the exact machine."""
    low, high = 0.9 * getattr(BEAM, field), 1.1 * getattr(BEAM, field)
    value = 0.3 * low + 0.7 * high
    other = BEAM.along(field, low, high)(value)
    assert other == with_settings(BEAM, {field: value})
    assert other.structure is BEAM.structure


def test_a_value_out_of_range_is_refused():
    """What is returned refuses what the machine refuses."""
    from chaosgym.errors import ParameterError

    with pytest.raises(ParameterError, match=r"damping_ratio = -0.1 is out of range"):
        BEAM.along("damping_ratio", 0.009, 0.011)(-0.1)
