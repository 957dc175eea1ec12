"""What fixed steps and held matrices do to the statements of the thesis."""

from dataclasses import replace

import numpy as np

from thesis.scorecard.evaluation import THESIS_MACHINES
from thesis.scorecard.numerics import Numerics, page, settled_statements, ways
from thesis.scorecard.observation import QUICK, observe

BEAM = replace(THESIS_MACHINES["impact-beam"], excitation_frequency=12.0, clearance=0.064e-3)
EFFORT = QUICK["impact-beam"]


def test_short_steps_show_what_exact_contacts_show():
    """Steps of 10 us lengthen a contact by less than a dot of the figures."""
    exact, stepped = observe(BEAM, EFFORT), observe(BEAM, EFFORT._replace(step=10.0))
    assert (stepped.nature, stepped.period) == (exact.nature, exact.period) == ("periodic", 1)
    np.testing.assert_allclose(stepped.mean, exact.mean, rtol=0.01)
    assert stepped.mean != exact.mean


def test_long_steps_let_the_highest_mode_grow():
    """Runge-Kutta's method of order four is stable up to 2.8 over the largest angular frequency."""
    assert observe(BEAM, EFFORT._replace(step=100.0)).nature == "failed"


def test_each_way_differs_from_exact_contacts_in_one_setting():
    """The crank's matrices are held over 5 deg in the first."""
    for machine in THESIS_MACHINES.values():
        (_, first, effort), *others = ways(machine)
        assert first == machine
        assert effort.step == 0.0
        assert all((changed == machine) != (one.step == 0.0) for _, changed, one in others)


def test_statements_about_runs_of_another_kind_are_left_out():
    """Crank angles come from a sampled run, which has exact contacts always."""
    asked = {one.id for one in settled_statements(THESIS_MACHINES["slider-crank"])}
    assert "SSC-030" in asked
    assert not {"SSC-037", "SSC-111"} & asked


def test_the_page_names_what_changes_sides():
    """A row a way, beside the number of statements."""
    steps = Numerics("steps of 50 us", 2, "failed", ("IBS-067",), ("IBS-013",))
    found = {"impact-beam": (Numerics("exact contacts", 11, "periodic 1, 28 to 28 N"), steps)}
    assert "| exact contacts | 11 | periodic 1, 28 to 28 N | - | - |" in page(found)
    assert "| steps of 50 us | 2 | failed | IBS-067 | IBS-013 |" in page(found)
