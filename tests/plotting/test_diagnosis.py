import numpy as np
import pytest

from chaosgym.diagnosis import geometric_grid, largest_lyapunov_exponent, response_map
from chaosgym.diagnosis.response_type import Tolerance
from chaosgym.errors import SimulationError
from chaosgym.machines import ImpactBeam
from chaosgym.plotting import diagnosis as plots
from chaosgym.simulation import simulate


@pytest.fixture(scope="module")
def record():
    """Chaos of the thesis beam with a time history."""
    return simulate(ImpactBeam(), 60, transient=100, samples_per_cycle=100)


def test_plots_of_a_record_show_its_values(record):
    """Each plot shows what the record holds, and its axes carry units."""
    portrait = plots.phase_portrait(record)
    assert len(portrait.lines[0].get_xdata()) == 60 * 100
    section = plots.poincare_section(record)
    assert np.array_equal(section.lines[0].get_ydata(), record.velocity)
    peaks = plots.peak_force_history(record)
    assert [np.array_equal(line.get_ydata(), record.peak_force[:, i]) for i, line in enumerate(peaks.lines)] == [
        True,
        True,
    ]
    history = plots.time_history(record, cycles=3)
    assert len(history.lines[0].get_xdata()) == 300
    lines = plots.spectrum(record).lines[0]
    assert lines.get_ydata().max() == 0.0
    for ax in (portrait, section, peaks, history):
        assert ax.get_xlabel()
        assert "[" in ax.get_ylabel()


def test_plots_draw_on_given_axes(record):
    """The axes that are passed in are the ones that come back."""
    ax = plots.poincare_section(record)
    assert plots.phase_portrait(record, ax) is ax
    assert len(ax.lines) == 2


def test_a_record_without_history_can_not_be_drawn_against_time():
    """The error says what to do."""
    with pytest.raises(SimulationError, match="samples_per_cycle"):
        plots.time_history(simulate(ImpactBeam(), 20))


def test_orbit_diagram_exponent_and_map():
    """One column a speed; the exponent's blocks; one cell a point with the type's colour."""
    records = [simulate(ImpactBeam(excitation_frequency=f), 20, transient=50) for f in (8.0, 9.0, 10.0)]
    diagram = plots.orbit_diagram(records)
    assert [line.get_xdata()[0] for line in diagram.lines] == [8.0, 9.0, 10.0]
    exponent = largest_lyapunov_exponent(ImpactBeam(), 100, transient=20)
    assert np.array_equal(plots.exponent_history(exponent).lines[0].get_ydata(), exponent.history)
    result = response_map(ImpactBeam(), geometric_grid(8.0, 8.2, Tolerance(0.02)), [0.1e-3], budget=200)
    ax = plots.response_map(result)
    assert "[Hz]" in ax.get_xlabel()
    assert ax.collections[0].get_array().size == result.type.size
