"""Every number that a public function takes is checked where it comes in, once: NaN, infinity, texts and truth values.

The arguments are those that the signatures annotate as numbers, so one that is added is tried here without a line.
"""

import inspect
import math
import subprocess
import sys
import typing

import numpy as np
import pytest

import chaosgym
from chaosgym.control.policies import load_policy
from chaosgym.control.policies.shipped import shipped_folder
from chaosgym.diagnosis import attractors
from chaosgym.errors import ChaosgymError
from chaosgym.numbers import MOST, number, whole
from chaosgym.units import check_share, parse_quantity

BEAM = chaosgym.ImpactBeam(excitation_frequency=12.0)
SERIES = 10.0 + np.arange(200) % 3
AXIS = chaosgym.Axis("excitation_frequency", 10.0, 20.0, 3)


def plan(**numbers):
    """A sweep of a few points, on a grid, or drawn where a size is stated."""
    drawn = {"sampling": "sobol", "axes": (chaosgym.Axis("excitation_frequency", 10.0, 20.0),)}
    return chaosgym.SweepPlan(BEAM, **({"axes": (AXIS,)} if "size" not in numbers else drawn), **numbers)


CALLS = {
    "Axis": lambda **numbers: chaosgym.Axis("clearance", **({"low": 1e-4, "high": 2e-4} | numbers)),
    "ExactEvents": chaosgym.ExactEvents,
    "FmuPlant": lambda **numbers: chaosgym.FmuPlant("missing.fmu", input="speed", output="force", **numbers),
    "ImpactBeam": chaosgym.ImpactBeam,
    "Monitor": chaosgym.Monitor,
    "RungeKutta4": chaosgym.RungeKutta4,
    "SliderCrank": chaosgym.SliderCrank,
    "SweepPlan": plan,
    "attractors": lambda **numbers: attractors(BEAM, **numbers),
    "diagnose": lambda **numbers: chaosgym.diagnose(BEAM, **numbers),
    "evaluate": lambda **numbers: chaosgym.evaluate(
        lambda seen: np.zeros(1), "chaosgym/ImpactBeamTolerance-v1", **numbers
    ),
    "follow": lambda **numbers: chaosgym.follow(BEAM, "excitation_frequency", (11.9, 12.1), **({"sweep": 2} | numbers)),
    "judge_peaks": lambda **numbers: chaosgym.judge_peaks(SERIES, **numbers),
    "response_map": lambda **numbers: chaosgym.response_map(BEAM, [12.0], [1e-4], **numbers),
    "response_type": lambda **numbers: chaosgym.response_type(BEAM, **({"initial_states": 1} | numbers)),
    "run_sweep": lambda **numbers: chaosgym.run_sweep(plan(), "never-made", **numbers),
    "simulate": lambda **numbers: chaosgym.simulate(BEAM, **({"cycles": 1} | numbers)),
    "simulate_many": lambda **numbers: chaosgym.simulate_many([BEAM], **({"cycles": 1} | numbers)),
    "step_check": lambda **numbers: chaosgym.step_check(BEAM, **numbers),
    "two_step_test": lambda **numbers: chaosgym.two_step_test(SERIES, **numbers),
}
"""Public functions that take numbers, with what else they need."""

RECORDS = {"CycleRecord", "Diagnosis", "Drive", "Joint", "MachineClassifier", "ModalMachine", "ResponseClassifier"}
"""What functions return, parts of machines that the machine checks, and machines and estimators of further modules."""


def numeric(annotation):
    """Kind of a number, or None."""
    kinds = [one for one in (annotation, *typing.get_args(annotation)) if one in (int, float)]
    return kinds[0] if kinds and typing.get_origin(annotation) not in (tuple, dict) else None


def arguments(function):
    """Arguments that are numbers, and their kind."""
    hints = {name: one.annotation for name, one in inspect.signature(function, eval_str=True).parameters.items()}
    return {name: kind for name, hint in hints.items() if (kind := numeric(hint))}


FUNCTIONS = {**{name: getattr(chaosgym, name) for name in chaosgym.__all__}, "attractors": attractors}
TAKEN = [(name, argument, kind) for name in CALLS for argument, kind in arguments(FUNCTIONS[name]).items()]
BAD = {
    float: (math.nan, math.inf, -math.inf, "3", True, 1j, 10**400, [1.0, 2.0]),
    int: (math.nan, math.inf, -1, 1.5, "3", True, 1j, 10**30, [1, 2]),
}


def test_every_public_function_that_takes_numbers_is_tried():
    """Those of ``chaosgym.__all__``, but for the records that they return."""
    taking = {
        name
        for name in chaosgym.__all__
        if callable(one := getattr(chaosgym, name))
        and not (isinstance(one, type) and issubclass(one, Exception))
        and arguments(one)
    }
    assert taking - RECORDS == set(CALLS) - {"attractors"}


@pytest.mark.parametrize(("name", "argument", "kind"), TAKEN)
def test_what_is_no_number_in_range_is_refused_where_it_comes_in(name, argument, kind, tmp_path, monkeypatch):
    """One line that names the argument, whatever else is asked; at once, before anything is computed."""
    monkeypatch.chdir(tmp_path)
    for bad in BAD[kind]:
        with pytest.raises(ChaosgymError) as error:
            CALLS[name](**{argument: bad})
        said = str(error.value)
        assert argument in said or argument.replace("sensor_", "sensor ") in said, (bad, said)
        assert "\n" not in said
        assert len(said) < 300
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("low", "high", "inside", "good", "bad"),
    [
        (0.0, math.inf, False, (0, 1e300, np.float32(2)), (-1e-300, math.inf)),
        (0.0, math.inf, True, (1e-300,), (0.0, -0.0)),
        (0.0, 1.0, True, (0.5, np.array(0.5)), (0, 1)),
        (1.0, 2.0, False, (1, 2), (np.nextafter(1.0, 0.0), np.nextafter(2.0, 3.0))),
    ],
)
def test_the_check_of_a_number_holds_at_the_ends_of_its_range(low, high, inside, good, bad):
    """Ends are in or out as stated, to the last bit."""
    assert [number("x", one, low, high, inside=inside) for one in good] == [float(one) for one in good]
    for one in bad:
        with pytest.raises(chaosgym.ParameterError, match=r"x = .* is out of range; allowed: "):
            number("x", one, low, high, inside=inside)


def test_the_check_of_a_whole_number_keeps_every_digit():
    """Sixty-four bits are more than a float holds."""
    assert whole("seed", 2**63 - 1, 0, 2**63 - 1) == 2**63 - 1
    assert whole("cycles", np.int32(7), 1) == 7
    assert whole("cycles", MOST, 1) == MOST
    with pytest.raises(chaosgym.ParameterError, match="allowed: whole numbers from 1 to 1,000,000,000"):
        whole("cycles", MOST + 1, 1)


@pytest.mark.parametrize("text", ["0_1 mm", "1_000 mm", "_1 mm", "１ mm", "0.1_5mm"])
def test_no_number_has_an_underscore(text):
    """``0_1 mm`` is a slip for 0.1 mm, not 1 mm."""
    with pytest.raises(chaosgym.ParameterError, match="does not begin with a number"):
        parse_quantity("clearance", text, "m")


def test_a_bare_damping_ratio_above_one_is_refused():
    """The sign % was forgotten; with it, 400 % is what it says, and shares below 1 need none."""
    for given, values in (("4, 4, 6", [4.0, 4.0, 6.0]), (1.01, [1.01]), ([0.5, "3"], [0.5, 3.0])):
        with pytest.raises(chaosgym.ParameterError, match=r"damping_ratios = .* is above 1 and has no unit"):
            check_share("damping_ratios", given, values)
    for given, values in (("400 %", [4.0]), ("1, 0.5", [1.0, 0.5]), (["4 %", "400 %"], [0.04, 4.0])):
        check_share("damping_ratios", given, values)


def test_a_policy_that_knows_no_task_says_what_to_call():
    """A shipped policy is loaded without its environment."""
    policy = load_policy(shipped_folder("chaosgym/ImpactBeamTolerance-v1"))
    with pytest.raises(ChaosgymError, match=r"call start\(envs\)"):
        policy(np.zeros((1, 14), np.float32))


@pytest.mark.parametrize("words", [["judge", "-"], ["monitor"], ["run-agent", "--plant", "-"]])
def test_standard_input_that_is_closed_is_one_line(words):
    """As of a service that starts programs without one."""
    program = "from chaosgym.cli import main; main()"
    line = f"exec '{sys.executable}' -c '{program}' {' '.join(words)} <&-"
    run = subprocess.run(["bash", "-c", line], capture_output=True, text=True)
    assert run.returncode == 2, run.stderr[-1000:]
    assert "Traceback" not in run.stderr
    assert run.stderr.startswith("Error: ")
    assert run.stderr.count("\n") == 1
