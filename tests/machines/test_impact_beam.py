"""The beam of the thesis: printed numbers, finite elements, validation."""

import math
from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest

from chaosgym.errors import ParameterError
from chaosgym.machines.impact_beam import ImpactBeam
from chaosgym.machines.impact_beam.modes import modal_analysis, pinned_pinned_frequency, static_tip_deflection
from chaosgym.machines.machine import Machine
from chaosgym.machines.parameters import parameters_of, with_settings
from tests.plain_modes import PLAIN_BEAM

FREE = replace(PLAIN_BEAM, reduction="free")


def test_pinned_pinned_frequency_is_that_of_table_3_1():
    """288.2 Hz at 284.0 mm, the surviving row of table 3.1; the other lengths follow as 1 / length squared."""
    assert pinned_pinned_frequency(PLAIN_BEAM, 0.284) == pytest.approx(288.2, abs=0.3)
    ratio = pinned_pinned_frequency(PLAIN_BEAM, 0.279) / pinned_pinned_frequency(PLAIN_BEAM, 0.284)
    assert ratio == pytest.approx((0.284 / 0.279) ** 2, rel=1e-9)


def test_pinned_pinned_frequency_has_the_closed_form():
    """The finite elements give (pi / 2 L^2) sqrt(E I / rho A)."""
    beam = PLAIN_BEAM
    wave = math.sqrt(beam.youngs_modulus / beam.density)
    expected = math.pi / 2 * beam.height / math.sqrt(12) * wave / 0.284**2
    assert pinned_pinned_frequency(beam, 0.284) == pytest.approx(expected, rel=1e-6)


def test_static_tip_deflection_is_the_unit_of_clearance():
    """8.9 N deflect the free tip by 3.175 mm, so that +-0.127 mm is the dimensionless clearance 0.04."""
    assert static_tip_deflection(PLAIN_BEAM) == pytest.approx(3.175e-3, rel=0.005)


def test_a_beam_on_a_hard_pivot_has_pinned_free_modes():
    """Without springs and shaker the bending modes are pinned-free: beta L = 3.9266, 7.0686, 10.2102."""
    beam = replace(
        FREE,
        pivot_translational_stiffness=1e13,
        pivot_rotational_stiffness=1e-6,
        shaker_stiffness=0.0,
        shaker_mass=0.0,
    )
    radius = beam.height / math.sqrt(12)
    wave = math.sqrt(beam.youngs_modulus / beam.density)
    expected = np.array([3.92660231, 7.06858275, 10.21017612]) ** 2 * radius * wave / beam.length**2
    np.testing.assert_allclose(modal_analysis(beam).angular_frequency[1:4], expected, rtol=2e-4)


def test_modes_converge_with_the_mesh():
    """A finer mesh lowers every kept frequency, and four times the default mesh by less than 1e-4."""
    coarse = modal_analysis(PLAIN_BEAM, elements=12).angular_frequency
    default = modal_analysis(PLAIN_BEAM).angular_frequency
    fine = modal_analysis(PLAIN_BEAM, elements=96).angular_frequency
    assert np.all(coarse >= default * (1 - 1e-6))
    assert np.all(default >= fine * (1 - 1e-6))
    np.testing.assert_allclose(default, fine, rtol=1e-4)


def test_default_model_has_five_degrees_of_freedom():
    """One rocking mode inside the speed range and four bending modes (thesis 5.2.3)."""
    model = PLAIN_BEAM.reduce()
    hertz = np.sqrt(model.stiffness) / (2 * np.pi)
    assert len(hertz) == 5
    assert 10.0 < hertz[0] < 28.0
    assert hertz[1] > 400.0


def test_damping_families():
    """The ratio of the first bending mode is the given one; "stiffness" grows with frequency, "uniform" does not."""
    beam = replace(FREE, shaker_damping=0.0, damping_family="stiffness")
    proportional, uniform = modal_analysis(beam), modal_analysis(replace(beam, damping_family="uniform"))
    frequency = proportional.angular_frequency
    np.testing.assert_allclose(np.diag(proportional.damping), 2.0 * 0.01 * frequency**2 / frequency[1], rtol=1e-9)
    np.testing.assert_allclose(np.diag(uniform.damping), 2.0 * 0.01 * frequency, rtol=1e-9)


def test_damping_of_the_beam_alone_leaves_its_springs_undamped():
    """1 % of critical at the pinned-pinned frequency for a shape that bends, nothing for the rocking of a stiff beam.

    With all modes the damping is the bending stiffness times 2 zeta / w: of a free reduction and of one that keeps the
    interfaces alike.
    """
    beam = replace(FREE, shaker_damping=0.0, damping_family="beam")
    stiff = replace(beam, youngs_modulus=1e13, density=beam.density)
    assert abs(modal_analysis(stiff).damping[0, 0]) < 1e-3 * modal_analysis(beam).angular_frequency[0]
    rate = 2.0 * 0.01 / (2.0 * math.pi * pinned_pinned_frequency(beam, beam.length))
    full = modal_analysis(replace(beam, n_modes=20))
    springs = np.diag(full.angular_frequency**2) - full.damping / rate
    values = np.linalg.eigvalsh(springs)
    assert np.all(values > -1e-9 * values[-1])
    assert np.sum(values > 1e-9 * values[-1]) <= 3


def test_the_reduction_by_interfaces_keeps_the_static_deflection():
    """Unit deflections at pivot, shaker and tip carry static loads exactly, whatever the number of modes.

    Five degrees of freedom give the tip the compliance of forty free modes, which five free modes do not; the rocking
    and the first bending frequency agree.
    """
    kept = modal_analysis(replace(FREE, reduction="interfaces"))
    free, all_modes = modal_analysis(FREE), modal_analysis(replace(FREE, n_modes=40))
    kept_at, free_at, all_at = (
        float(np.sum(one.tip_shape**2 / one.angular_frequency**2)) for one in (kept, free, all_modes)
    )
    assert abs(kept_at / all_at - 1.0) < 0.2 * abs(free_at / all_at - 1.0)
    np.testing.assert_allclose(kept.angular_frequency[:2], all_modes.angular_frequency[:2], rtol=2e-3)


def test_a_shaker_at_the_tip_is_one_interface_with_it():
    """The force point and the tip are then the same place, and one more mode takes the freedom left."""
    model = modal_analysis(replace(PLAIN_BEAM, reduction="interfaces", force_position=0.279))
    assert len(model.tip_shape) == 5
    np.testing.assert_allclose(model.tip_shape, model.force_shape, rtol=1e-12)


def test_beam_is_a_frozen_machine_with_described_parameters():
    """Every field carries unit, range, provenance and source."""
    assert isinstance(PLAIN_BEAM, Machine)
    with pytest.raises(FrozenInstanceError):
        PLAIN_BEAM.length = 1.0  # type: ignore[misc]
    for described in parameters_of(ImpactBeam).values():
        assert described.provenance in ("printed", "derived", "calibrated", "assumed")
        assert described.source


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"clearance": -1e-4}, r"clearance = -0\.0001 m is out of range; allowed: 0 to 1 m"),
        ({"excitation_frequency": 0.0}, r"excitation_frequency = 0 Hz is out of range"),
        ({"length": math.nan}, r"length = nan m is out of range"),
        ({"length": "long"}, r"length = 'long' is out of range"),
        ({"n_modes": 2.5}, r"n_modes = 2\.5 is out of range; allowed: whole numbers from 1"),
        ({"n_modes": True}, r"n_modes = True is out of range"),
        ({"damping_family": "viscous"}, r"damping_family = 'viscous' is not one of uniform, stiffness"),
        ({"reduction": "interfaces", "n_modes": 3}, r"n_modes = 3 .* allowed: 4 or more and 0"),
        ({"force_position": 0.3}, r"force_position = 0\.3 m lies beyond the tip"),
        ({"pivot_rotational_stiffness": 0, "shaker_stiffness": 0}, r"without a position of rest"),
        ({"clearence": 1e-4}, r"no field 'clearence'; did you mean clearance\?"),
    ],
)
def test_bad_parameters_name_field_value_and_range(settings, message):
    """Nothing out of range is constructed, and the message says what is allowed."""
    with pytest.raises(ParameterError, match=message):
        with_settings(PLAIN_BEAM, settings)
