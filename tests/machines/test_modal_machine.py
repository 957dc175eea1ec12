"""A machine of one's own: the same motion as the machines that come along, whichever way its modes are given."""

import json
import math
from pathlib import Path

import gymnasium as gym
import jsonschema
import numpy as np
import pytest
from click.testing import CliRunner
from matplotlib.figure import Figure
from scipy.io import mmwrite
from scipy.sparse import csc_matrix

import chaosgym
from benchmarks.fidelity.bounds import bounded_share
from chaosgym import Drive, ImpactBeam, ModalMachine, Structure, simulate
from chaosgym.branches.family_along import continuous_field
from chaosgym.cli import app
from chaosgym.design import variation_region
from chaosgym.design.brief import brief_from
from chaosgym.diagnosis import Tolerance
from chaosgym.envs.variants import Variants
from chaosgym.errors import ChaosgymError, ParameterError
from chaosgym.fit.model_draws import fields_to_estimate
from chaosgym.machines.beam_element import bending_matrices
from chaosgym.machines.impact_beam.modes import modal_analysis
from chaosgym.machines.machine_file import schema_text, template
from chaosgym.machines.modal_machine.structure import _with_residual
from chaosgym.machines.parameters import with_settings
from chaosgym.plotting import response
from chaosgym.sweeps import read_sweep

FIELDS = ("section", "peak_force", "impacts", "contact_fraction", "bounce_duration")


def same(first, second):
    """Assert that two records are equal to the last bit."""
    for name in FIELDS:
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))


def one_mode(**fields):
    """One mode of 5 Hz and 1 kg between two stops."""
    given = dict(speed=8.0, clearance=1e-3, contact_stiffness=1e6, contact_damping=50.0) | fields
    given.setdefault("drives", (Drive.sine("force", "x", 5.0),))
    return ModalMachine(modes=Structure.of_modes([5.0], 0.02, {"x": [1.0]}), joint="x", **given)


@pytest.fixture
def machine_file(tmp_path):
    """Writer of a file: the template with some of its text replaced."""

    def write(*changes, text=None):
        content = template() if text is None else text
        for old, new in changes:
            assert old in content
            content = content.replace(old, new, 1)
        path = tmp_path / "my-machine.toml"
        path.write_text(content)
        return path

    return write


@pytest.mark.parametrize("speed", [11.0, 30.0])
def test_the_impact_beam_as_a_modal_machine(speed):
    """The thesis' beam, given by its modes, gives the same records bit for bit."""
    beam = ImpactBeam(excitation_frequency=speed)
    modes = modal_analysis(beam)
    shapes = {"tip": modes.tip_shape, "shaker": modes.force_shape}
    own = ModalMachine(
        modes=Structure(modes.angular_frequency, modes.damping, shapes),
        joint="tip",
        drives=(Drive.sine("force", "shaker", beam.force_amplitude),),
        speed=speed,
        clearance=beam.clearance,
        contact_stiffness=beam.contact_stiffness,
        contact_damping=beam.contact_damping,
    )
    given = {"integrator": beam.default_integrator}
    same(simulate(own, 40, transient=10, **given), simulate(beam, 40, transient=10, **given))


def test_matrices_and_modes_are_one_machine():
    """Masses, springs and dampers as matrices, dense or sparse, move as the modes computed from them by hand."""
    mass, stiffness = np.diag([1.0, 2.0]), np.array([[3e3, -1e3], [-1e3, 1e3]])
    damping = np.array([[3.0, -1.0], [-1.0, 1.0]])
    squares, vectors = np.linalg.eigh(np.diag([1.0, 2.0**-0.5]) @ stiffness @ np.diag([1.0, 2.0**-0.5]))
    vectors = np.diag([1.0, 2.0**-0.5]) @ vectors
    by_hand = Structure.of_modes(
        np.sqrt(squares) / (2 * np.pi), vectors.T @ damping @ vectors, {"a": vectors[0], "b": vectors[1]}
    )
    joint = dict(joint="b", drives=(Drive.sine("force", "a", 9.0),), speed=5.0, clearance=1e-3, contact_stiffness=1e6)
    expected = simulate(ModalMachine(modes=by_hand, **joint), 8)
    assert expected.impacts.sum() > 0
    for form in (np.asarray, csc_matrix):
        found = Structure.of_matrices(form(mass), form(stiffness), form(damping), {"a": 0, "b": 1}, modes=2)
        np.testing.assert_allclose(
            simulate(ModalMachine(modes=found, **joint), 8).peak_force, expected.peak_force, rtol=1e-6
        )


def test_kept_modes_and_the_residual_one_have_the_static_compliance():
    """A cantilever of three modes and the residual one deflects under a tip force as Euler's formula says."""
    stiffness, length = 50.0, 0.4
    mass, bending = bending_matrices(np.full(12, length / 12), stiffness, 0.8)
    mass, bending = mass[2:, 2:], bending[2:, 2:]
    exact = length**3 / (3.0 * stiffness)
    compliance = {}
    for at in (None, "tip"):
        found = Structure.of_matrices(mass, bending, 0.01, {"tip": 22}, modes=3, residual_at=at)
        compliance[at] = float(np.sum((found.shape("tip") / found.angular_frequency) ** 2))
    assert compliance["tip"] == pytest.approx(exact, rel=1e-9)
    assert compliance[None] < 0.999 * exact
    first = found.angular_frequency[0] * length**2 * math.sqrt(0.8 / stiffness)
    assert first == pytest.approx(1.8751040687**2, rel=1e-5)


@pytest.mark.parametrize("frequency", [1e-4, np.inf])
def test_a_residual_frequency_out_of_range_is_told_in_hertz(frequency):
    """Its range has the unit in which it is given."""
    with pytest.raises(ParameterError, match=r"residual frequency = .* Hz is out of range"):
        _with_residual(np.ones(1), np.eye(1), {"tip": np.ones(1)}, "tip", 1e-6, frequency)


def test_a_large_sparse_model_is_the_dense_one():
    """Beyond 600 degrees of freedom, Lanczos finds the frequencies and tip shapes of the dense solution."""
    mass, bending = (matrix[2:, 2:] for matrix in bending_matrices(np.full(320, 0.4 / 320), 50.0, 0.8))
    sparse = Structure.of_matrices(csc_matrix(mass), csc_matrix(bending), 0.01, {"tip": 638}, modes=4)
    closed = np.array([1.8751040687, 4.6940911330, 7.8547574382, 10.9955407349]) ** 2 / 0.4**2 * math.sqrt(50.0 / 0.8)
    np.testing.assert_allclose(sparse.angular_frequency, closed, rtol=1e-5)
    np.testing.assert_allclose(np.abs(sparse.shape("tip")), 2.0 / math.sqrt(0.8 * 0.4), rtol=1e-4)


def test_units_of_millimetres_and_tonnes():
    """A model in mm, t and N is the one in SI: the same frequencies, shapes of the same machine."""
    mass, stiffness = np.diag([1.0, 2.0]), np.array([[3e3, -1e3], [-1e3, 1e3]])
    metres = Structure.of_matrices(mass, stiffness, 0.01, {"a": 0}, modes=2, base=[1, 1])
    tonnes = Structure.of_matrices(mass / 1e3, stiffness / 1e3, 0.01, {"a": 0}, modes=2, base=[1, 1], scale=1e3)
    for name in ("a", "base"):
        np.testing.assert_allclose(tonnes.shape(name), metres.shape(name), rtol=1e-12)


def test_a_free_body_has_a_rigid_mode():
    """Two masses on a spring without a support keep a mode of 0 Hz, exactly."""
    stiffness = 1e4 * np.array([[1.0, -1.0], [-1.0, 1.0]])
    found = Structure.of_matrices(np.diag([1.0, 3.0]), stiffness, 0.0, {"a": 0, "b": 1}, modes=2)
    assert found.angular_frequency[0] == 0.0
    assert found.angular_frequency[1] == pytest.approx(math.sqrt(1e4 * 4.0 / 3.0))
    np.testing.assert_allclose(found.shape("a - b")[0], 0.0, atol=1e-12)


def test_base_motion_is_a_force_of_inertia():
    """A base that moves by 1 mm acts as the force m w^2 1 mm, and as its acceleration with the sign turned."""
    modes = Structure.of_modes([5.0], 0.02, {"x": [0.5], "base": [2.0]})
    given = dict(modes=modes, joint="x", speed=8.0, clearance=5e-4, contact_stiffness=1e6)
    omega = 2.0 * math.pi * 8.0
    displaced = simulate(ModalMachine(drives=(Drive.sine("displacement", "base", 1e-3),), **given), 20)
    accelerated = ModalMachine(drives=(Drive.sine("acceleration", "base", -(omega**2) * 1e-3),), **given)
    forced = ModalMachine(drives=(Drive.sine("force", "x", 4.0 * omega**2 * 1e-3),), **given)
    for other in (accelerated, forced):
        np.testing.assert_allclose(displaced.peak_force, simulate(other, 20).peak_force, rtol=1e-7)
    assert displaced.impacts.sum() > 0


def test_samples_of_a_cycle_are_its_harmonics():
    """A cycle of samples with a mean drives as its sines and a preload of the same size."""
    phase = 2.0 * np.pi * np.arange(64) / 64
    force = 1.5 + 4.0 * np.sin(phase) + 2.0 * np.cos(3.0 * phase)
    sampled = one_mode(drives=(Drive.sampled("force", "x", force, 5),))
    sines = (Drive.sine("force", "x", 4.0), Drive.sine("force", "x", 2.0, 3, math.pi / 2))
    np.testing.assert_allclose(
        simulate(sampled, 20).peak_force, simulate(one_mode(drives=sines, preload=1.5), 20).peak_force, rtol=1e-7
    )


def test_one_stop_is_one_sided():
    """With one stop the other side is never touched; turned round, the joint hits it on the same side."""
    record = simulate(one_mode(stops="one"), 50)
    assert record.impacts[:, 0].sum() > 0
    assert record.impacts[:, 1].sum() == 0
    turned = one_mode(stops="one", drives=(Drive.sine("force", "x", 5.0, angle=math.pi),))
    mirrored = ModalMachine(**{**vars(turned), "joint": "-x"})
    np.testing.assert_allclose(simulate(mirrored, 20).peak_force, record.peak_force[:20], rtol=1e-6)


def test_pictures_show_the_stops_that_there_are():
    """One stop is one shaded ground, from the stop on; an offset moves both of two."""
    lower, upper = one_mode(stops="one").room_of()
    assert lower == -math.inf
    assert upper == one_mode().clearance
    moved = one_mode(offset=1e-4)
    assert moved.room_of() == (1e-4 - moved.clearance, 1e-4 + moved.clearance)
    for machine, number in ((one_mode(stops="one"), 1), (moved, 2)):
        assert len(response.stops(machine.room_of(), Figure().subplots()).patches) == number


def test_an_offset_gap_with_different_stops_agrees_with_fixed_steps():
    """Exact propagation with offset, preload and two different stops follows Runge-Kutta's small steps."""
    machine = one_mode(offset=2e-4, preload=0.3, lower_stiffness_factor=0.2, lower_damping_factor=2.0)
    exact = simulate(machine, 2)
    fixed = simulate(machine, 2, integrator=chaosgym.RungeKutta4(200_000))
    np.testing.assert_allclose(exact.section, fixed.section, atol=1e-4 * np.abs(exact.section).max())
    assert (exact.impacts.sum(axis=0) > 0).all()


def test_every_run_stays_within_the_bound_of_passivity():
    """No record has more energy than its drive can have given."""
    for machine in (one_mode(), one_mode(preload=3.0), one_mode(offset=-2e-3), one_mode(drive_level=0.0)):
        record = simulate(machine, 60)
        states = np.vstack([record.section, record.final_state.coordinates])
        assert bounded_share(machine, states, record.peak_force) <= 1.0 + 1e-9


def test_the_template_is_a_machine(machine_file):
    """The template reads; every line that it comments out is a key that the reader knows."""
    machine = chaosgym.read_machine(machine_file())
    assert machine.natural_frequencies == pytest.approx([8.7, 54.6, 153.0])
    assert machine.at(10.0).speed == 10.0
    one = machine_file(("# [structure.residual]", "[structure.residual]"), ('# at = "tip"\n# comp', 'at = "tip"\ncomp'))
    assert len(chaosgym.read_machine(one).natural_frequencies) == 4
    lower = machine_file(("# [joint.lower]", "[joint.lower]"), ("# stiffness", "stiffness"))
    assert chaosgym.read_machine(lower).lower_stiffness_factor == pytest.approx(1.5)


@pytest.mark.parametrize("form", ["npz", "mtx"])
def test_files_of_matrices(machine_file, tmp_path, form):
    """Matrices from .npz and from Matrix Market give the machine that they describe."""
    mass, stiffness = np.diag([1.0, 2.0]), np.array([[3e3, -1e3], [-1e3, 1e3]])
    if form == "npz":
        np.savez(tmp_path / "model.npz", M=mass, K=stiffness, names=["motor", "tip"])
        lines = 'matrices = "model.npz"'
    else:
        for name, matrix in (("M", mass), ("K", stiffness)):
            mmwrite(tmp_path / f"{name}.mtx", csc_matrix(matrix))
        lines = 'mass = "M.mtx"\nstiffness = "K.mtx"\ndegrees_of_freedom = { tip = 1, motor = 0 }'
    start, end = template().index("frequencies ="), template().index("[joint]")
    text = template()[:start] + lines + '\nmodes = 2\ndamping_ratios = "1 %"\n' + template()[end:]
    machine = chaosgym.read_machine(machine_file(text=text))
    squares = np.linalg.eigvals(np.linalg.solve(mass, stiffness))
    np.testing.assert_allclose(machine.natural_frequencies, np.sqrt(np.sort(squares)) / (2 * np.pi))


def test_modes_of_a_universal_file(machine_file, tmp_path):
    """Data sets 55 give frequencies, dampings and, by their modal masses, mass-normalised shapes."""
    pyuff = pytest.importorskip("pyuff")
    nodes, shapes = np.array([3, 7]), ([0.9, 0.3], [-1.0, 0.8])
    sets = [
        pyuff.prepare_55(
            model_type=1, analysis_type=2, data_ch=2, spec_data_type=8, data_type=2,
            load_case=0, mode_n=k + 1, freq=freq, modal_m=0.25, modal_damp_vis=0.02, modal_damp_his=0.0,
            node_nums=nodes, r1=np.zeros(2), r2=np.array(shape), r3=np.zeros(2), id1="modes", id2="NONE",
            id3="NONE", id4="NONE", id5="NONE",
        )
        for k, (freq, shape) in enumerate(zip((12.5, 80.0), shapes, strict=True))
    ]  # fmt: skip
    pyuff.UFF(str(tmp_path / "test.uff")).write_sets(sets, mode="overwrite")
    start, end = template().index("frequencies ="), template().index("[joint]")
    lines = 'universal_file = "test.uff"\npoints = { tip = "3 +y", motor = "7 -y" }\n\n'
    machine = chaosgym.read_machine(machine_file(text=template()[:start] + lines + template()[end:]))
    np.testing.assert_allclose(machine.natural_frequencies, [12.5, 80.0], rtol=1e-5)
    np.testing.assert_allclose(machine.modes.shape("tip"), [1.8, -2.0], rtol=1e-5)
    np.testing.assert_allclose(machine.modes.shape("motor"), [-0.6, -1.6], rtol=1e-5)


BAD = {
    "an unknown key": ([("clearance = \"0.15", "clearence = \"0.15")], "did you mean clearance"),
    "an unknown table": ([("[joint]", "[joints]")], "no table 'joints'; did you mean [joint], or [[joint]]"),
    "another unknown table": ([("[[drive]]\nat", "[[drives]]\nat")], "no key 'drives'; did you mean [[drive]]?"),
    "no damper": ([("damping = \"60", "# damping = \"60")], "lacks damping; in place of damping, restitution"),
    "no unit": ([('"0.15 mm"', "0.15")], "joint.clearance = 0.15 has no unit"),
    "a wrong unit": ([('"0.15 mm"', '"0.15 kg"')], "unknown unit 'kg'"),
    "a negative gap": ([('"0.15 mm"', '"-0.15 mm"')], "gap of negative width"),
    "a short shape": ([('"2.83, -2.79, 2.71', '"2.83, -2.79')], "shapes.tip has 2 entries; allowed: 3"),
    "a drive nowhere": ([('at = "motor"', 'at = "moter"')], "no point 'moter'; did you mean motor"),
    "a drive at rest": ([('"0.96, 2.02, -0.05', '"0, 0, 0')], "moves no mode"),
    "a drive of two kinds": ([('# unbalance = "20', 'unbalance = "20')], "force and unbalance"),
    "frequencies of 1e6 Hz": ([('"8.7, 54.6, 153 Hz"', '"8.7, 54.6, 1e6 Hz"')], 'units = "t mm N"'),
    "a reversed range": ([('"6 to 24 Hz"', '"24 to 6 Hz"')], "speed_range is no range"),
    "a wrong tolerance": ([("damping_factor =", "dampening =")], "no key 'dampening'"),
    "a damper that varies": ([('"60 N s/m"', '"1, 2, 3 N s/m"')], "is several numbers; allowed: one, which holds at"),
    "two sources": ([('# matrices = "model.npz"', 'matrices = "my-machine.toml"')], "frequencies and matrices"),
    "no such file": (
        [("frequencies = ", "# frequencies = "), ('# matrices = "model.npz"', 'matrices = "gone.npz"')], "gone.npz"),
    "no TOML": ([("[joint]", "[joint")], "is not valid TOML"),
    "two tables": ([("[joint]", "[joint]\n[[joint]]")], "; allowed: each key once, and [[NAME]]"),
    "a number of no task": ([("# [job]", "[job]"), ("# reference_force", "referense_force")], None),
}  # fmt: skip


def test_a_field_that_is_none_is_told_by_the_name_of_the_file(machine_file):
    """A person knows the machine by its file, not by its class."""
    path = machine_file()
    with pytest.raises(ParameterError, match=rf"{path} has no field 'clearence'; did you mean clearance\?"):
        with_settings(chaosgym.read_machine(path), {"clearence": 1e-4})


def test_shapes_whose_largest_entry_is_one_are_told(machine_file):
    """They are those of modal masses of 1 kg, or not mass-normalised: a note asks, and the machine runs."""
    unit = [('"2.83, -2.79, 2.71', '"1, -1, 1'), ('"0.96, 2.02, -0.05', '"0.3, 0.7, 0')]
    machine = chaosgym.read_machine(machine_file(*unit))
    assert any("right only if each modal mass is 1 kg" in note for note in machine.notes)
    assert chaosgym.simulate(machine, 1).peak_force.shape == (1, 2)


@pytest.mark.parametrize("case", BAD)
def test_bad_files_end_in_one_line(machine_file, case):
    """What is wrong with a file is said in one line that names it and says what is allowed."""
    changes, message = BAD[case]
    path = machine_file(*changes)
    if message is None:
        with pytest.raises(ParameterError, match="no number 'referense_force'; did you mean reference_force"):
            gym.make("chaosgym/Machine-v0", machine=str(path))
        return
    result = CliRunner().invoke(app, ["show", str(path)])
    assert isinstance(result.exception, ChaosgymError), result.output
    assert message in str(result.exception)
    assert "\n" not in str(result.exception)


@pytest.mark.parametrize(
    ("mass", "stiffness", "message"),
    [
        ([[1, 0], [0, 1]], [[2, -1], [0, 1]], "stiffness is not symmetric"),
        ([[1, 0], [0, 0]], [[2, -1], [-1, 1]], "mass is not positive definite"),
        ([[1, 0], [0, 1]], [[-2, 0], [0, 1]], "stiffness is not positive semidefinite"),
        ([[1, 0], [0, 1]], [[2, -1]], "square"),
        ([[1, 0], [0, 1]], [[np.nan, 0], [0, 1]], "stiffness = nan is out of range"),
        ([[1]], [[2, -1], [-1, 1]], "stiffness has 2 rows and mass 1"),
        ([[1e-9, 0], [0, 1e-9]], [[2e6, 0], [0, 1e6]], "a unit is likely wrong"),
    ],
)
def test_bad_matrices(mass, stiffness, message):
    """Matrices that no structure has are refused, and the reason is named."""
    with pytest.raises(ParameterError, match=message):
        Structure.of_matrices(np.array(mass, float), np.array(stiffness, float), 0.01, {"a": 0}, modes=2)


def test_the_published_schema():
    """docs/machine.schema.json is made from the keys of the reader, takes the template, and refuses a wrong key."""
    published = Path(__file__).parents[2] / "docs" / "machine.schema.json"
    assert published.read_text() == schema_text(), "chaosgym new-machine --schema > docs/machine.schema.json"
    import tomllib

    validator = jsonschema.Draft202012Validator(json.loads(schema_text()))
    values = tomllib.loads(template())
    validator.validate(values)
    values["joint"]["clearence"] = values["joint"].pop("clearance")
    assert not validator.is_valid(values)


def test_commands_and_environments_take_the_file(machine_file, tmp_path):
    """A sweep is kept and read again, and refuses to go on with a changed file; environments and a brief work too."""
    path = machine_file()

    def run(*arguments):
        result = CliRunner().invoke(app, [*map(str, arguments)])
        return result, None if result.exception is None else str(result.exception)

    axes = ("--axis", "speed=8:12:2", "--axis", "clearance=1e-4:2e-4:2", "--budget", 100, "--out", tmp_path / "s")
    result, error = run("sweep", path, *axes, "--json")
    assert error is None, result.output
    assert json.loads(result.stdout)["points"] == 4
    assert json.loads(run("dataset", "info", tmp_path / "s", "--json")[0].stdout)["machine"] == str(path)
    env = gym.make("chaosgym/MachineTolerance-v0", machine=str(path))
    envs = gym.make_vec("chaosgym/MachineTolerance-v0", num_envs=2, machine=str(path))
    np.testing.assert_array_equal(envs.reset(seed=3)[0][0], env.reset(seed=3)[0])
    assert set(env.unwrapped.settings.variants.tolerances) == {"clearance", "damping_factor"}
    brief = tmp_path / "brief.toml"
    brief.write_text(run("design", "--template", path)[0].stdout.replace(str(path), path.name))
    from chaosgym.design.brief import read_brief

    assert read_brief(brief).machine == chaosgym.read_machine(path)
    path.write_text(path.read_text().replace("4 N", "5 N"))
    assert "holds another sweep" in run("sweep", path, *axes)[1]


def test_new_machine_writes_the_template_once(tmp_path):
    """The command prints the template or the schema, and never writes over a file."""
    run = CliRunner().invoke
    assert run(app, ["new-machine"]).stdout == template("mass")
    assert run(app, ["new-machine", "--schema"]).stdout == schema_text()
    path = tmp_path / "mine.toml"
    assert str(path) in run(app, ["new-machine", "--out", str(path)]).stdout
    assert path.read_text() == template("mass")
    assert "exists already" in run(app, ["new-machine", "--out", str(path)]).output


def test_stability_tradeoff_and_pictures_take_the_file(machine_file):
    """Every extreme ends in an answer or a named error, and a job is drawn."""
    from benchmarks.fidelity.stability import stability_map

    machine = chaosgym.read_machine(machine_file())
    assert {cell.outcome for cell in stability_map(machine).cells} <= {"answer", "named error"}
    env = gym.make("chaosgym/MachineWear-v0", machine=machine.name, render_mode="rgb_array")
    env.reset(seed=0)
    env.step(env.action_space.sample())
    assert env.render().ndim == 3


def test_wear_of_variants_keeps_each_offset():
    """Clearances of a batch move about the middle of each machine's own gap."""
    machines = [one_mode(offset=offset) for offset in (1e-4, -2e-4)]
    batch = machines[0].batch(2)
    for i, machine in enumerate(machines):
        batch.start(i, machine)
    batch.set_clearances(np.arange(2), np.full(2, 5e-4))
    peaks = batch.run(np.arange(2), 12).peak_force
    for found, machine in zip(peaks, machines, strict=True):
        np.testing.assert_array_equal(found, simulate(machine.at(clearance=5e-4), 12).peak_force)


def test_a_base_that_is_moved_for_good_changes_nothing(machine_file):
    """Samples with a mean: of a displacement it is left out, of an acceleration it is a weight on every mode."""
    modes = Structure.of_modes([5.0], 0.02, {"x": [0.5], "base": [2.0]})
    given = dict(modes=modes, joint="x", speed=8.0, clearance=5e-4, contact_stiffness=1e6)
    wave = 1e-3 * np.sin(2.0 * np.pi * np.arange(16) / 16)
    moved, still = (
        ModalMachine(drives=(Drive.sampled("displacement", "base", wave + m, 1),), **given) for m in (7e-3, 0.0)
    )
    np.testing.assert_allclose(simulate(moved, 20).peak_force, simulate(still, 20).peak_force, rtol=1e-6)
    shaken = ModalMachine(drives=(Drive.sampled("acceleration", "base", 1e3 * wave - 3.0, 1),), **given)
    loaded = ModalMachine(
        drives=(Drive.sampled("acceleration", "base", 1e3 * wave, 1), Drive("force", "x", (), 3.0 * 2.0 / 0.5)), **given
    )
    np.testing.assert_allclose(simulate(shaken, 20).peak_force, simulate(loaded, 20).peak_force, rtol=1e-7)


WORDS = {
    "friction": ([("preload = ", "mu = ")], "tangent the point that sticks and slides"),
    "torque": ([("force = ", "torque = ")], "forces in N m, springs in N m/rad"),
    "a random drive": ([("force = ", "psd = ")], "repeats with every cycle"),
    "backlash": ([('clearance = "0.15', 'backlash = "0.15')], "clearance is half the gap"),
    "flow": ([("preload = ", "flow_velocity = ")], "forces that depend on the motion"),
}


@pytest.mark.parametrize("case", WORDS)
def test_what_does_not_fit_is_said_where_it_is_met(machine_file, case):
    """A word that people try is answered with the limit, or the way, and the page."""
    changes, message = WORDS[case]
    with pytest.raises(ParameterError, match=message) as told:
        chaosgym.read_machine(machine_file(*changes))
    assert "docs/own-machine.md" in str(told.value)


def test_fields_of_the_only_joint_have_its_name(machine_file, tmp_path):
    """Axes, settings, tolerances, estimates and briefs know joint.stiffness, or pin.stiffness, as its field."""
    file = machine_file(("[joint]", '[joint]\nname = "pin"'), ("[tolerances]", '[tolerances]\npin.damping = "7 %"'))
    machine = chaosgym.read_machine(file)
    assert machine.tolerances["contact_damping"] == (0.07, True)
    for name in ("joint.stiffness", "pin.stiffness", "contact_stiffness"):
        assert with_settings(machine, {name: 2e6}).contact_stiffness == 2e6
    with pytest.raises(ParameterError, match=r"pin\.clearance: given twice"):
        with_settings(machine, {"clearance": 1e-4, "pin.clearance": 1e-4})
    with pytest.raises(ParameterError, match=r"no field 'joint\.speed'"):
        with_settings(machine, {"joint.speed": 9.0})
    assert fields_to_estimate(machine, ["pin.damping"]) == ("contact_damping",)
    assert continuous_field(machine, "pin.clearance") == "clearance"
    assert list(variation_region(machine, {"pin.clearance": Tolerance(0.1)})) == ["clearance"]
    assert list(Variants(machine, {"joint.clearance": 0.1}).tolerances) == ["clearance"]
    criteria = {"load_rating": "500 N", "life": "2000 h", "reliability": "90 %"}
    given = {"machine": str(file), "criteria": criteria, "tolerances": {"pin": {"clearance": "3 %"}}}
    brief = brief_from(given)
    assert brief.region == {"clearance": Tolerance(0.03)}
    words = ["--axis", "joint.clearance=0.1mm:0.2mm:2", "--set", "pin.damping=30", "--budget", "100", "--json"]
    done = CliRunner().invoke(app, ["sweep", str(file), *words, "--out", str(tmp_path / "out")], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    assert read_sweep(tmp_path / "out").column("clearance").tolist() == [1e-4, 2e-4]
