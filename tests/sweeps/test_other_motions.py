"""What a sweep says of motions that rest does not lead to."""

import pytest

import chaosgym
from chaosgym.sweeps import Axis, SweepPlan, run_sweep
from chaosgym.sweeps.info import calm_region_of
from tests.diagnosis.machine_files import written
from tests.machines.test_initial_state import JUMP


@pytest.mark.parametrize("full_types", [0.0, 1.0])
def test_a_grid_beside_a_rattle_is_calm_from_rest_alone(full_types, tmp_path):
    """Its neighbours say Type I from rest; all tolerances and random starts say Type III at every point of the grid.

    Steps are 1.3 %, within the tolerance of 2 %. The column of the other motions has the rattle, its share and the fold
    at which a run-up falls out of it.
    """
    machine = chaosgym.read_machine(written(tmp_path, JUMP))
    plan = SweepPlan(machine, (Axis("speed", 1.5, 1.56, 4),), full_types=full_types)
    sweep = run_sweep(plan, tmp_path / "sweep")
    assert set(sweep.column("response_type")) == {"I"}
    calm = calm_region_of(sweep)
    if not full_types:
        assert calm.ranges
        assert all("Type I from rest" in line for line in calm.lines if "Type I" in line)
        return
    assert calm.ranges == ()
    assert "48 random starts" in calm.searched
    assert set(sweep.column("full_response_type")) == {"III"}
    assert set(sweep.column("motions")) == {2}
    for other in sweep.column("other_motions"):
        assert "of 48 random starts" in other
        assert "to 1.90683 Hz (fold)" in other
