"""Bending fatigue: published examples, stresses against a full finite element model and an independent integrator."""

import math
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import chaosgym
from chaosgym.design.bending import bending_life, stressed
from chaosgym.design.bent_section import Bending, Section, fibres
from chaosgym.design.brief import brief_from, template
from chaosgym.design.collective import assess_duty
from chaosgym.design.fatigue import rainflow_means
from chaosgym.design.methodology import assess
from chaosgym.design.runs import settled_run
from chaosgym.diagnosis import Tolerance
from chaosgym.errors import DesignError, ParameterError, SimulationError
from chaosgym.machines import MACHINES, ImpactBeam
from chaosgym.machines.impact_beam.modes import _assembled, _mesh, modal_curvatures
from chaosgym.simulation import simulate
from chaosgym.simulation.modal_history import modal_history

KSI = 6894757.293168
CALM = ImpactBeam(excitation_frequency=8.0)
PIPE = "docs/machines/pipe-in-two-supports.toml"
STEEL = Bending(section=Section(at=0.15), amplitude=2.5e8, cycles=1.0, slope=5.0, ultimate=6e8)


def test_a_published_history_takes_its_published_number_of_repetitions():
    """Shigley's Mechanical Engineering Design, 9th ed., example 6-15, p. 322 to 324: 619,000 blocks.

    By Gerber and Miner; S_ut = 151 kpsi and S_e = 67.5 kpsi; f = 0.795 by its figure 6-18.
    """
    history = np.array([80.0, 40.0, 60.0, -40.0, -20.0, -60.0])
    ranges, means, counts = rainflow_means(history)
    found = {(0.5 * span, mean): counts[ranges == span].sum() for span, mean in zip(ranges, means, strict=True)}
    assert found.keys() == {(70.0, 10.0), (10.0, 50.0), (10.0, -30.0)}, "the book's table of cycles"
    line = {"amplitude": 67.5 * KSI, "cycles": 1.0, "slope": 3.0 / math.log10(0.795 * 151.0 / 67.5)}
    part = Bending(section=Section(at=0.1), ultimate=151.0 * KSI, mean_stress="gerber", **line)
    assert part.reversed_amplitudes(70.0 * KSI, 10.0 * KSI) / KSI == pytest.approx(70.3, abs=0.05)
    assert 1e6 * stressed(history * KSI, 1, part).life == pytest.approx(619e3, rel=0.02)


def test_a_published_line_gives_its_published_life():
    """The same, p. 324: S_ut = 80 kpsi, S_e = 40 kpsi, f = 0.9; 60 kpsi are borne for 8520 cycles."""
    slope = 3.0 / math.log10(0.9 * 80.0 / 40.0)
    assert 1.0 / slope == pytest.approx(0.085091, rel=1e-4)
    part = Bending(section=Section(at=0.1), amplitude=40.0 * KSI, cycles=1.0, slope=slope, ultimate=80.0 * KSI)
    assert part.cycles_at(60.0 * KSI) == pytest.approx(8520.0, rel=1e-3)
    assert 1e6 * stressed(60.0 * KSI * np.array([1.0, -1.0, 1.0]), 1, part).life == pytest.approx(8520.0, rel=1e-3)


def test_the_notch_factor_of_a_published_shaft_multiplies_its_stress():
    """The same, example 6-7, p. 297: K_f = 1.55 on 260 MPa, with S_e = 280 MPa, S_ut = 690 MPa and f = 0.845."""
    line = {"amplitude": 2.8e8, "cycles": 1.0, "slope": 3.0 / math.log10(0.845 * 690.0 / 280.0)}
    part = Bending(section=Section(at=0.1), ultimate=6.9e8, notch_factor=1.55, **line)
    plain, notched = (
        1e6 * stressed(factor * 2.6e8 * np.array([1.0, -1.0, 1.0]), 1, part).life for factor in (1.0, 1.55)
    )
    assert notched == pytest.approx(1e6 * (280.0 / 403.0) ** part.slope, rel=1e-9)
    assert plain / notched == pytest.approx(1.55**part.slope)


def test_means_count_as_the_rules_say():
    """By hand: a mean of half the strength doubles the amplitude by Goodman, and adds a third by Gerber."""
    goodman = replace(STEEL, ultimate=4e8)
    assert goodman.reversed_amplitudes(1e8, 2e8) == pytest.approx(2e8)
    assert replace(goodman, mean_stress="gerber").reversed_amplitudes(1e8, 2e8) == pytest.approx(4e8 / 3.0)
    assert replace(goodman, mean_stress="none").reversed_amplitudes(1e8, 2e8) == 1e8
    assert goodman.reversed_amplitudes(1e8, -2e8) == 1e8
    assert math.isinf(goodman.reversed_amplitudes(1e8, 4e8))
    assert stressed(np.array([4.1e8, 0.0, 4.1e8]), 1, goodman).life < 1e-100, "it breaks at once"
    assert stressed(np.array([4.1e8, 4.0e8, 4.1e8]), 1, goodman).life < 1e-100
    still = stressed(np.full(4, 1e8), 1, goodman)
    assert (still.life, still.equivalent) == (math.inf, 0.0)


def test_curvatures_are_those_of_a_mesh_four_times_as_fine():
    """The curvature of every kept mode, fitted ones included, at sections on and between nodes."""
    for position in (0.02, 0.1, 0.15, 0.2345):
        coarse, fine = modal_curvatures(CALM, position), modal_curvatures(CALM, position, 4 * 24)
        assert np.abs(coarse - fine).max() < 0.03 * np.abs(fine).max(), position
    kept = slice(CALM.n_modes)
    free, bent = modal_curvatures(CALM, CALM.length)[kept], modal_curvatures(CALM, 0.15)[kept]
    assert np.abs(free).max() < 0.05 * np.abs(bent).max(), "no moment bends a free end"


def test_stress_without_contact_is_that_of_the_full_finite_element_model():
    """Amplitude under the drive alone, from a dense solution of all degrees of freedom at 8 Hz."""
    beam = ImpactBeam(excitation_frequency=8.0, clearance=5e-3, damping_family="uniform")
    mass, stiffness, at_force, _ = _assembled(beam, 96)
    omega = 2.0 * math.pi * 8.0
    damping = np.zeros_like(mass)
    damping[at_force, at_force] = beam.shaker_damping
    load = np.zeros(len(mass))
    load[at_force] = beam.force_amplitude
    answer = np.linalg.solve(stiffness - omega**2 * mass + 1j * omega * damping, load)
    # curvature at the middle of an element is the difference of its slopes over its length
    lengths = _mesh(beam, 96)
    element = 40
    position = float(lengths[:element].sum() + 0.5 * lengths[element])
    bent = (answer[2 * element + 3] - answer[2 * element + 1]) / lengths[element]
    expected = 0.5 * beam.height * beam.youngs_modulus * abs(bent)
    found = bending_life([settled_run(beam)], replace(STEEL, section=Section(at=position)))
    assert found.nominal.highest == pytest.approx(expected, rel=0.03)
    assert found.nominal.lowest == pytest.approx(-found.nominal.highest, rel=1e-6)


def test_modal_motion_is_that_of_an_independent_integrator():
    """One cycle of the two-support pipe from its recorded state, by DOP853 with contacts written out here."""
    pipe = chaosgym.read_machine(PIPE)
    record = simulate(pipe, 3, transient=100, samples_per_cycle=5760)
    found = modal_history(record)
    assert found.miss < 0.01
    parts, stops, omega = pipe.flexible, pipe.stops, 2.0 * math.pi * pipe.speed
    springs = np.stack(
        [pipe.of_joints("stiffness"), pipe.of_joints("stiffness") * pipe.of_joints("lower_stiffness_factor")]
    )
    dampers = np.stack([pipe.of_joints("damping"), pipe.of_joints("damping") * pipe.of_joints("lower_damping_factor")])
    n = len(parts.stiffness)

    def slope(t, state):
        q, v = state[:n], state[n:]
        x, xdot = parts.joints @ q, parts.joints @ v
        upper = np.where(x > stops[:, 0], np.maximum(springs[0] * (x - stops[:, 0]) + dampers[0] * xdot, 0.0), 0.0)
        lower = np.where(x < stops[:, 1], np.maximum(springs[1] * (stops[:, 1] - x) - dampers[1] * xdot, 0.0), 0.0)
        drive = parts.static + sum(
            math.cos((h + 1) * omega * t) * pair[0] + math.sin((h + 1) * omega * t) * pair[1]
            for h, pair in enumerate(parts.drive)
        )
        force = drive - (upper - lower) @ parts.joints - parts.stiffness * q - parts.damping @ v
        return np.concatenate([v, force])

    times = np.linspace(0.0, pipe.cycle_period, 96, endpoint=False)
    own = solve_ivp(slope, (0.0, pipe.cycle_period), record.section[0], "DOP853", times, rtol=1e-9, atol=1e-12)
    other = found.shown[0, ::60]
    assert np.abs(own.y[:n].T - other).max() < 0.01 * np.abs(other).max()


def test_the_joint_moves_as_it_was_recorded():
    """Displacement of the tip from the modal coordinates beside the kernel's own."""
    record = simulate(ImpactBeam(), 20, transient=200, samples_per_cycle=2880)
    tip = modal_history(record).shown @ record.machine.flexible.joints[0]
    assert np.abs(tip - record.history[:, :, 0]).max() < 0.02 * np.abs(tip).max()
    shown = modal_history(record, record.machine.flexible.joints).shown[:, :, 0]
    assert np.abs(shown - tip).max() < 1e-9 * np.abs(tip).max()


def test_turn_over_a_distance_is_a_curvature(tmp_path):
    """A section of a file by the turn of two points, or by its curvatures, gives one stress."""
    path = tmp_path / "machine.toml"
    text = Path(PIPE).read_text(encoding="utf-8")
    turns = 'a = "0.1, 0.2, 0.3, 0.4 kg^-1/2 m^-1"\nb = "0.3, 0.1, 0.9, 0.2 kg^-1/2 m^-1"\n'
    path.write_text(text.replace("[structure.shapes]", "[structure.shapes]\n" + turns))
    pipe = chaosgym.read_machine(path)
    material = {"fibre": 0.01, "modulus": 2.1e11}
    by_turn = Bending(section=Section(turn="b - a", span=0.05), **material)
    stated = Bending(section=Section(curvatures=(4.0, -2.0, 12.0, -4.0)), **material)
    assert fibres(pipe, by_turn)[0] == pytest.approx(fibres(pipe, stated)[0])
    assert fibres(pipe, stated)[0] == pytest.approx(-2.1e9 * np.array([4.0, -2.0, 12.0, -4.0]))
    assert bending_life([settled_run(pipe)], stated).nominal.highest > 0.0


def test_bending_is_a_criterion():
    """A slender S-N line fails a machine that its surface would let pass; without the section nothing changes."""
    region = {"clearance": Tolerance(0.05)}
    criteria = chaosgym.design.Criteria(load_rating=500.0, life=1000.0)
    weak = replace(STEEL, amplitude=5e6)
    plain, bent = (assess(CALM, region, criteria, series_size=4, bending=one) for one in (None, weak))
    assert plain.verdict == "meets"
    assert bent.verdict == "fails"
    assert bent.checks[:-1] == plain.checks
    assert bent.bending is not None
    assert bent.checks[-1].reached == pytest.approx(min(bent.bending.lives) / 3.0)
    assert len(bent.bending.lives) == 5
    assert bent.as_dict()["bending"]["assured"] == bent.checks[-1].reached
    duty = assess_duty(CALM, region, criteria, {1.0: 0.5, 0.5: 0.5}, series_size=4, bending=weak)
    slow = duty.collective[1].assessment.bending
    cycles = np.array([1.0, 0.5]) / 1.5
    expected = 1.0 / (cycles[0] / bent.bending.lives[0] + cycles[1] / slow.lives[0])
    assert duty.bending.lives[0] == pytest.approx(expected)
    assert duty.checks[-1].name == "bending life"


def test_machines_that_are_none_of_modes_say_so():
    """No modal motion of a crank, and none without a history."""
    crank = MACHINES["slider-crank"]()
    with pytest.raises(SimulationError, match="no machine of a few modes"):
        modal_history(simulate(crank, 1, samples_per_cycle=8))
    with pytest.raises(SimulationError, match="no time history"):
        modal_history(simulate(CALM, 1))


LINE = 'amplitude = "250 MPa"\ncycles = "1 Mcycles"\nslope = 5\nultimate = "600 MPa"\n'


@pytest.mark.parametrize(
    ("machine", "text", "message"),
    [
        ("impact-beam", 'at = "0.1 m"\namplitude = "250 MPa"\ncycles = "1 Mcycles"\nultimate = "1 GPa"', "lacks slope"),
        ("impact-beam", 'at = "0.5 m"\n' + LINE, "section at 0.5 m is outside the structure; allowed: 0 to"),
        ("impact-beam", 'at = "-1 mm"\n' + LINE, "outside the structure"),
        ("impact-beam", LINE, "no section; allowed: one of at"),
        ("impact-beam", 'at = "0.1 m"\nturn = "a"\n' + LINE, "has at and turn; allowed: one"),
        ("impact-beam", 'at = "0.1 m"\nfibre = "1 mm"\n' + LINE, "has fibre, which goes with turn, curvatures or link"),
        ("impact-beam", 'at = "0.1 m"\n' + LINE.replace('ultimate = "600 MPa"\n', ""), "lacks ultimate"),
        ("impact-beam", 'at = "0.1 m"\n' + LINE.replace("slope = 5", "slope = -5"), "slope = -5 is out of range"),
        ("impact-beam", 'at = "0.1 m"\nslop = 5\n' + LINE, "did you mean slope"),
        ("impact-beam", 'at = "0.1 m"\nmean_stress = "soderberg"\n' + LINE, "is not one of goodman, gerber, none"),
        ("impact-beam", 'at = "0.1 m"\nmean_stress = 3\n' + LINE, "allowed: a text"),
        ("impact-beam", 'turn = "tip"\nspan = "1 mm"\nfibre = "1 mm"\nmodulus = "1 GPa"\n' + LINE, "no named points"),
        ("slider-crank", 'at = "0.1 m"\n' + LINE, "no beam of its own"),
        ("slider-crank", 'curvatures = "1 kg^-1/2 m^-2"\nfibre = "1 mm"\nmodulus = "1 GPa"\n' + LINE, "is none"),
        (PIPE, 'turn = "tip"\nspan = "1 mm"\nfibre = "1 mm"\nmodulus = "1 GPa"\n' + LINE, "no point 'tip'"),
        (PIPE, 'turn = "end"\nfibre = "1 mm"\nmodulus = "1 GPa"\n' + LINE, "lacks span"),
        (PIPE, 'turn = "end"\nspan = "0 mm"\nfibre = "1 mm"\nmodulus = "1 GPa"\n' + LINE, "span = 0 is out of range"),
        (
            PIPE,
            'curvatures = "1, 2 kg^-1/2 m^-2"\nfibre = "1 mm"\nmodulus = "1 GPa"\n' + LINE,
            "allowed: 4, one a mode",
        ),
        (PIPE, 'curvatures = "0, 0, 0, 0 kg^-1/2 m^-2"\nfibre = "1 mm"\nmodulus = "1 GPa"\n' + LINE, "no mode bends"),
        (PIPE, 'curvatures = "1, 2, 3, 4"\nfibre = "1 mm"\nmodulus = "1 GPa"\n' + LINE, "has no unit"),
    ],
)
def test_impossible_sections_are_one_line(machine, text, message):
    """S-N data without a slope, sections outside the structure, and whatever else does not fit."""
    head = f'machine = "{machine}"\n[criteria]\nload_rating = "500 N"\nlife = "10 years"\nreliability = 0.99\n'
    with pytest.raises((DesignError, ParameterError), match=message) as caught:
        brief_from(tomllib.loads(f"{head}[bending]\n{text}"))
    assert "\n" not in str(caught.value)


def test_a_section_stays_within_every_machine_of_the_tolerances():
    """At the end of a beam whose length may be a thousandth less there is none."""
    text = (
        f'machine = "impact-beam"\n[criteria]\nload_rating = "5 N"\nlife = "1 h"\nreliability = 0.9\n[bending]\n{LINE}'
    )
    end = ImpactBeam().length
    with pytest.raises(ParameterError, match="outside the structure"):
        brief_from(tomllib.loads(text + f'at = "{end} m"'))
    alone = f'[tolerances]\nclearance = "5 %"\n{text}at = "{end} m"'
    assert brief_from(
        tomllib.loads('machine = "impact-beam"\n' + alone.replace('machine = "impact-beam"\n', ""))
    ).bending


@pytest.mark.parametrize("name", ["impact-beam", PIPE])
def test_the_section_of_a_template_is_read_once_its_comment_signs_are_away(name):
    """What the template shows of bending may be asked; points of the file take the place of its examples."""
    head, _, tail = template(name).partition("# [bending]")
    section = "[bending]" + "".join(line.removeprefix("# ") + "\n" for line in tail.splitlines())
    text = head + section.replace("or the modal", "# or the modal").replace("turn2 - turn1", "end - middle")
    found = brief_from(tomllib.loads(text)).bending
    assert found is not None
    assert (found.slope, found.notch_factor, found.uncertainty) == (5.0, 1.5, 3.0)
