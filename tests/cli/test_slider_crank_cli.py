"""The slider crank on the command line: the same keys as the beam, its own options, clear errors."""

import pytest

from chaosgym.machines import SliderCrank
from chaosgym.simulation import simulate

from .run import run, run_json

CRANK = ("slider-crank", "--speed-rpm", "190", "--clearance-mm", "0.254")


def test_simulate_and_show_speak_of_the_same_machine():
    """Peaks are those of the library; the options set the fields."""
    result = run_json("simulate", *CRANK, "--contact-damping-ratio", "0.025", "--cycles", "20")
    crank = SliderCrank(crank_speed=190.0, slider_clearance=0.254e-3, contact_damping_ratio=0.025)
    record = simulate(crank, 20)
    assert result["peak_force_N"] == record.peak_force[:, record.worst_side].tolist()
    shown = run_json("show", "slider-crank", "--clearance-joint", "ball-instrumented", "--clearance-mm", "0.1")
    assert shown["parameters"]["ball_clearance"] == pytest.approx(1e-4)
    assert shown["parameters"]["ball_joint"] == "instrumented"
    assert shown["parameters"]["slider_joint"] == "ideal"
    assert shown["parameters"]["gravity"] == 9.81


def test_show_lists_only_the_degrees_of_freedom_of_the_scene():
    """A rigid rod with slider clearance is one coordinate, both joints in space with a flexible rod are fourteen."""
    rigid = run_json("show", "slider-crank", "--set", "rod=rigid")
    assert rigid["degrees_of_freedom"] == ["slider across the guide"]
    assert rigid["sensors"] == []
    both = run_json("show", "slider-crank", "--clearance-joint", "both", "--motor-angle-deg", "25")
    assert len(both["degrees_of_freedom"]) == 14
    assert len(both["natural_frequencies_hz"]) == 9
    assert "degrees_of_freedom" not in run_json("show", "impact-beam")


def test_the_models_of_both_joints_can_be_chosen():
    """``both`` takes a clearance and a model for the ball, and a model for the slider, each with its sensors."""
    shown = run_json(
        "show",
        "slider-crank",
        "--clearance-joint",
        "both",
        "--clearance-mm",
        "0.1",
        "--ball-clearance-mm",
        "0.05",
        "--ball-model",
        "instrumented",
        "--slider-model",
        "instrumented",
        "--motor-angle-deg",
        "20",
    )
    fields = shown["parameters"]
    assert (fields["slider_joint"], fields["ball_joint"]) == ("instrumented", "instrumented")
    assert (fields["slider_clearance"], fields["ball_clearance"]) == pytest.approx((1e-4, 5e-5))
    assert len(shown["sensors"]) == 12
    assert "slider roll" in shown["degrees_of_freedom"]
    result = run_json("simulate", *CRANK, "--slider-model", "instrumented", "--cycles", "5")
    sensors = result["largest_sensor_force_N"]
    assert len(sensors) == 8
    assert sensors["front upper"] > 1.0
    assert sensors["front left"] == 0.0


def test_diagnose_tells_the_printed_nature_and_runs_the_matrix_update_test():
    """190 rpm and +-0.254 mm are chaotic in the thesis (figure 4.14 b), by both tests."""
    result = run_json("diagnose", *CRANK, "--budget", "200")
    assert result["nature"] == "chaotic"
    assert result["largest_lyapunov_exponent_per_cycle"]["value"] > 0.0
    assert run_json("diagnose", *CRANK, "--test", "mut")["nature"] == "chaotic"


def test_classify_knows_the_crank():
    """190 rpm and +-0.254 mm are Type III in the thesis (figure 4.14 b)."""
    result = run_json("classify", *CRANK)
    assert result["response_type"] == "III"
    assert sum(result["type_probabilities"].values()) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--clearance-mm", "50"), "--clearance-mm = 50 is out of range; allowed: 0 to 20 mm"),
        (("--motor-angle-deg", "30"), "--motor-angle-deg = 30 is out of range; allowed: 0 to 25 deg"),
        (("--set", "rod_length=0.04"), "rod_length = 0.04 m is out of range; allowed: above the crank radius"),
        (("--frequency-hz", "3"), "--frequency-hz is no option of slider-crank"),
        (("--clearance-joint", "hinge"), "'hinge' is not one of"),
        (("--clearance-joint", "ball-spherical", "--clearance-mm", "0.1", "--ball-clearance-mm", "0.1"), "both set"),
        (("--ball-clearance-mm", "0.1"), "--ball-clearance-mm goes with --clearance-joint ball-spherical"),
        (("--clearance-joint", "slider", "--ball-model", "spherical"), "--ball-model goes with --clearance-joint both"),
        (
            ("--clearance-joint", "ball-spherical", "--slider-model", "plain"),
            "goes with --clearance-joint slider or both",
        ),
    ],
)
def test_bad_input_names_the_option(arguments, message):
    """One line, exit code 2."""
    code, out, err = run("simulate", "slider-crank", *arguments)
    assert (code, out) == (2, "")
    assert message in err
    assert len(err.strip().splitlines()) == 1
