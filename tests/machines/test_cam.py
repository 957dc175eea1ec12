"""A cam and its follower, from a CSV file of the lift: the force, the jump, and what a file of a cycle has to be."""

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar

import chaosgym
from chaosgym.errors import ParameterError
from chaosgym.machines.modal_machine.cycle_file import files_of, with_samples

FILE = Path(__file__).parents[2] / "docs" / "machines" / "cam-follower.toml"
MASS, SPRING, PRELOAD, LIFT, CAM, DAMPER = 0.6, 2e4, 120.0, 8e-3, 3e6, 400.0
RISE = 2.0 * math.pi / 3.0


def lift(angle):
    """Lift [m] of the cycloid, and its first and second derivative by the angle."""
    angle = angle % (2.0 * math.pi)
    turned = angle if angle < RISE else 2.0 * math.pi - RISE / 2.0 - angle if angle > 1.5 * RISE else RISE
    if not 0.0 < turned < RISE:
        return (LIFT if turned >= RISE else 0.0), 0.0, 0.0
    share, way = 2.0 * math.pi * turned / RISE, 1.0 if angle < RISE else -1.0
    height = LIFT * (turned / RISE - math.sin(share) / (2.0 * math.pi))
    bent = 2.0 * math.pi * LIFT / RISE**2 * math.sin(share)
    return height, way * LIFT / RISE * (1.0 - math.cos(share)), bent


def peaks_of_scipy(speed, cycles, least=False):
    """Largest or least force [N] on the cam in each cycle from rest, by DOP853: one mass, the ground and the cam."""
    omega = 2.0 * math.pi * speed

    def force(t, state):
        height, slope, _ = lift(omega * t)
        depth = height - state[0]
        return max(0.0, CAM * depth + DAMPER * (slope * omega - state[1])) if depth > 0.0 else 0.0

    def motion(t, state):
        return [state[1], (force(t, state) - PRELOAD - SPRING * state[0]) / MASS]

    state, found = np.zeros(2), []
    for cycle in range(cycles):
        span = cycle / speed, (cycle + 1) / speed
        run = solve_ivp(motion, span, state, method="DOP853", rtol=1e-9, atol=1e-14, max_step=5e-5, dense_output=True)
        state = run.y[:, -1]
        found.append((min if least else max)(force(t, run.sol(t)) for t in np.linspace(*span, 5_001)))
    return np.array(found)


@pytest.mark.parametrize("rpm", [1200, 2100])
def test_the_cam_in_scipy(rpm):
    """Pressed on its cam, and thrown off it: the largest forces are those of DOP853 with the lift in closed form."""
    machine = chaosgym.read_machine(FILE).at(rpm / 60.0)
    found = chaosgym.simulate(machine, 3).peak_force[:, 0]
    np.testing.assert_allclose(found, peaks_of_scipy(rpm / 60.0, 3), rtol=5e-3)


def test_the_follower_jumps_where_its_inertia_exceeds_the_spring():
    """Rigid, it leaves at m w^2 lift'' = -(F + k lift) at the worst angle; on its roller it leaves 4 % earlier."""

    def lifts_off(angle):
        height, _, bent = lift(angle)
        return math.sqrt((PRELOAD + SPRING * height) / (MASS * -bent)) / (2.0 * math.pi) if bent < 0.0 else 1e3

    onset = minimize_scalar(lifts_off, bounds=(RISE / 2.0, RISE), method="bounded").fun
    assert 60.0 * onset == pytest.approx(1860.0, rel=0.01)
    machine = chaosgym.read_machine(FILE)
    shares = [
        chaosgym.simulate(machine.at(share * onset), 60, transient=100).contact_fraction[:, 0].min()
        for share in (0.94, 0.98)
    ]
    assert shares[0] == 1.0
    assert shares[1] < 0.97


@pytest.mark.slow
@pytest.mark.parametrize(("share", "pressed"), [(0.94, True), (0.98, False)])
def test_the_jump_in_scipy(share, pressed):
    """In the twelfth cycle from rest DOP853 has the follower on its cam below that speed, and off it above."""
    least = peaks_of_scipy(share * 1860.0 / 60.0, 12, least=True)[-1]
    assert (least > 0.0) == pressed


def test_what_a_lift_leaves_out_is_said():
    """Its mean, and its samples where the harmonics miss them."""
    assert chaosgym.read_machine(FILE).notes == (
        "the base's mean displacement, 0.004 in SI, takes the stops along: it is left out",
    )


@pytest.fixture
def cam(tmp_path):
    """Writes the file and its CSV with some changes; returns its path."""

    def write(*changes, table=None):
        text = FILE.read_text()
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        (tmp_path / "cam-follower.csv").write_text(table or FILE.with_suffix(".csv").read_text())
        (tmp_path / "cam.toml").write_text(text)
        return tmp_path / "cam.toml"

    return write


def _cycle(count, unit="deg", turn=360.0, close=False):
    rows = [f"{turn * i / count:.9g},{math.sin(2 * math.pi * i / count):.9g},0" for i in range(count + close)]
    return "\n".join([f"angle [{unit}],lift [mm],pull of the spring [N]", *rows])


def test_a_cycle_may_close_and_be_in_any_angle(cam):
    """Degrees, radians and cycles, with or without the row that repeats the first: one and the same drive."""
    few = ("harmonics = 48", "harmonics = 8")
    drives = [
        chaosgym.read_machine(cam(few, table=_cycle(32, *unit, close))).drives[0].harmonics
        for unit in (("deg", 360.0), ("rad", 2.0 * math.pi), ("cycle", 1.0))
        for close in (False, True)
    ]
    assert drives[0][0][2] == pytest.approx(1e-3)
    for other in drives[1:]:
        np.testing.assert_allclose(other, drives[0], atol=1e-12)


REFUSED = {
    "no file": ((('displacement = "cam-follower.csv"', 'displacement = "gone.csv"'),), None, "gone.csv can't be read"),
    "no column": ((('column = "lift"', 'column = "lif"'),), None, "has no column 'lif'; did you mean lift?"),
    "several columns": ((('column = "lift"\n', ""),), None, "has several columns; say column = "),
    "no units": ((), "angle,lift\n0,1\n1,2\n", "does not begin with names of columns and their units"),
    "a wrong unit": ((), _cycle(200).replace("lift [mm]", "lift [N]"), "unknown unit 'N'"),
    "a short row": ((), _cycle(200) + "\n1,2", "has rows of other lengths"),
    "a word": ((), _cycle(200) + "\n1,x,2", "could not convert"),
    "half a cycle": ((), _cycle(200, "deg", 180.0), "is no cycle at equal steps from 0 to 360"),
    "a cycle that does not close": ((), _cycle(200) + "\n360,5,0", "allowed: a cycle that closes"),
    "nothing": ((), "\n", "does not begin with names"),
    "no number": ((), _cycle(200).replace("0.0314107591", "nan"), "is no finite number"),
    "a column without a file": (
        (('displacement = "cam-follower.csv"', 'displacement = "1 mm"'), ("harmonics = 48\n\n", "\n")),
        None,
        "drive.column has no meaning without a CSV file",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_files_that_are_no_cycle_end_in_one_line(cam, case):
    """The line names the file and what it should hold."""
    changes, table, message = REFUSED[case]
    with pytest.raises(ParameterError) as told:
        chaosgym.read_machine(cam(*changes, table=table))
    assert message in str(told.value)
    assert "\n" not in str(told.value)


def samples(folder, *rows, head="angle [deg],lift [mm]", **row):
    """What a drive's displacement becomes, of a CSV file of these rows."""
    (folder / "lift.csv").write_text("\n".join([head, *rows]))
    return with_samples("drive", {"displacement": "lift.csv", "harmonic": 1} | row, folder)["displacement"]


def refused(folder, *rows, **keywords):
    """The line with which such a file is refused, after its name."""
    with pytest.raises(ParameterError) as told:
        samples(folder, *rows, **keywords)
    assert str(told.value).startswith(f"{folder / 'lift.csv'} ")
    return str(told.value).removeprefix(f"{folder / 'lift.csv'} ")


def test_three_rows_are_a_cycle(tmp_path):
    """With blank lines, a mark of byte order and letters of any size in the name; two rows are none."""
    assert samples(tmp_path, "0,1", "", "120,2", "240,-3.5") == ["1.0 mm", "2.0 mm", "-3.5 mm"]
    (tmp_path / "L.CSV").write_bytes("\ufeffangle [cycle] , lift [ mm ]\n0,1\n.25,2\n.5,3\n.75,4\n1,1".encode())
    with pytest.raises(ParameterError, match=r"^drive\.column has no meaning without a CSV file; leave it out$"):
        with_samples("drive", {"displacement": "1 mm", "column": "lift"}, tmp_path)
    drive = {"displacement": "L.CSV", "column": "lift"}
    assert with_samples("drive", drive, tmp_path) == {"displacement": ["1.0 mm", "2.0 mm", "3.0 mm", "4.0 mm"]}
    assert refused(tmp_path, "0,1", "180,2") == "is no cycle at equal steps from 0 to 360; allowed: 3 rows or more"


def test_a_step_may_err_by_a_ten_thousandth(tmp_path):
    """Of the step; that tells a table that was rounded from one that is uneven, or of another cycle."""
    assert len(samples(tmp_path, "0,1", "90,2", "180,3", "270.00899,4")) == 4
    assert "is no cycle" in refused(tmp_path, "0,1", "90,2", "180,3", "270.00901,4")
    assert len(samples(tmp_path, "0.005,1", "90,2", "180,3", "270,4", "360.0052,1")) == 4, "closed, within a millionth"
    assert "is no cycle" in refused(tmp_path, "0,1", "90,2", "180,3", "270,4", "360.0004,1")


def test_a_cycle_closes_within_a_millionth_of_its_largest_value(tmp_path):
    """The line says where it ends and begins."""
    assert len(samples(tmp_path, "0,1", "120,2", "240,-3", "360,1.0000029")) == 3
    line = refused(tmp_path, "0,1", "120,2", "240,-3", "360,1.5")
    assert line == "ends at 1.5 and begins at 1; allowed: a cycle that closes"
    assert "ends at 1 " in refused(tmp_path, "0,1", "120,2", "240,-3", "360,1.0000031")


def test_the_first_column_of_angles_counts(tmp_path):
    """Another one is not looked at, and none is a strength."""
    head = "angle [deg],phase [rad],lift [mm]"
    assert samples(tmp_path, "0,5,1", "120,5,2", "240,7,3", "360,7,1", head=head) == ["1.0 mm", "2.0 mm", "3.0 mm"]
    line = refused(tmp_path, "0,1,1", "120,2,2", "240,3,3", head="angle [deg],lift [mm],pull [N]")
    assert line == "has several columns; say column = ; known: lift, pull"


def test_what_a_file_of_a_cycle_begins_with(tmp_path):
    """The line shows it."""
    line = "does not begin with names of columns and their units, as in: angle [deg],lift [mm]"
    assert refused(tmp_path, "0,1", head="angle,lift") == line


def test_the_files_of_drives():
    """One drive, several, none; only what names a CSV file in the place of a strength."""
    named = {"force": "a.csv", "at": "b.csv", "unbalance": "1 g mm"}
    assert files_of({"drive": named}) == ["a.csv"]
    assert files_of({"drive": [named, 5, {"displacement": "C.CSV"}]}) == ["a.csv", "C.CSV"]
    assert files_of({}) == []


def test_another_lift_is_another_machine(cam):
    """The content of the CSV file is part of what the machine is."""
    one = chaosgym.read_machine(cam(("harmonics = 48", "harmonics = 8"), table=_cycle(32)))
    other = chaosgym.read_machine(cam(("harmonics = 48", "harmonics = 8"), table=_cycle(32).replace("0.195", "0.196")))
    assert one.definition != other.definition
    assert one != other
