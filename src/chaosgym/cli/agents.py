"""The commands ``compare`` and ``run-agent``: how controllers and trained agents do on machines."""

import json
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from chaosgym.cli.options import IntRange, Quantity
from chaosgym.cli.output import AS_JSON, DIAGNOSED, announce, emit, patience, picture_path, plot_option

if TYPE_CHECKING:
    from chaosgym.control.operator import Operator
    from chaosgym.control.plant import Interrupted, PlantError, Worked
    from chaosgym.control.rollout import Played
    from chaosgym.plants.fmu import FmuPlant
    from chaosgym.plants.plant import Plant


OBJECTIVES = ("irregular", "life", "both")
LEVELS, SPLITS = ("nominal", "clearance", "wear", "fleet"), ("train", "test", "outside", "corner", "other_machines")
"""Of a task; the names are repeated here so that help needs no environment."""

KRIGING = "kriging"

LIFE = "life of the joint"

NO_POLICY = "no policy is shipped for this machine, so kriging played for the joint's life"
"""What is said where no agent is given."""

OF_A_FILE = (
    "; returns are by reference_force, 100 N if [job] in the file says nothing; forces and the ratio of lives do not "
    "depend on it"
)
"""What is added of the file of a machine."""


@click.command()
@click.argument("env")
@click.option(
    "--out", type=click.Path(dir_okay=False, path_type=Path), required=True, help="Parquet file; goes on from there."
)
@click.option("--machines", type=IntRange(2, 512), default=None, help="Of those kept for this; all by default.")
@click.option(
    "--objective", type=click.Choice(OBJECTIVES), default=OBJECTIVES[0], show_default=True, help="What costs."
)
@click.option("--level", type=click.Choice(LEVELS), default=None, help="What differs from job to job.")
@click.option("--split", type=click.Choice(SPLITS), default=None, help="Part of the machines.")
@click.option("--sealed", is_flag=True, help="The 512 machines of this release; played once for each.")
@click.option("--only", multiple=True, help="Name of a controller to run; all by default; may be repeated.")
@click.option("--policy", "policies", multiple=True, help="NAME=FOLDER of a trained policy; one name, several seeds.")
@click.option("--guard", is_flag=True, help="Let each policy play behind a guard too.")
@click.option("--figure", type=click.Path(dir_okay=False, path_type=Path), default=None, help="Scores as a picture.")
@AS_JSON
def compare(
    env: str,
    out: Path,
    machines: int | None,
    objective: str,
    level: str | None,
    split: str | None,
    sealed: bool,
    only: tuple[str, ...],
    policies: tuple[str, ...],
    guard: bool,
    figure: Path | None,
    as_json: bool,
) -> None:
    """Let all controllers, and trained policies, run ENV on the same machines, and score them.

    ENV is an id such as chaosgym/ImpactBeamTolerance-v1, or the file of a machine.
    0 is following the demand, 1 is the machine's own map with the demands to come unknown.
    """
    from chaosgym.control.comparison import compare as run
    from chaosgym.control.comparison import most_cycles
    from chaosgym.control.guard import GuardedPolicy
    from chaosgym.control.policies import load_policy
    from chaosgym.control.rollout import Policy
    from chaosgym.control.scores import ONE, ZERO, Scores, table_lines
    from chaosgym.envs.vector_env import native_envs

    drawn = None if figure is None else picture_path(str(figure), "")
    trained: dict[str, list[Policy]] = {}
    for given in policies:
        name, separator, folder = given.partition("=")
        if not separator:
            raise click.UsageError(f"--policy {given}: allowed: NAME=FOLDER")
        trained.setdefault(name, []).append(load_policy(folder))
        if guard:
            trained.setdefault(f"{name}, guarded", []).append(GuardedPolicy(load_policy(folder)))
    chosen = [ZERO, ONE, *(name for name in only if name not in (ZERO, ONE))] if only else None
    asked = {"level": level, "split": split, "sealed": sealed or None}
    keywords: dict[str, Any] = {name: value for name, value in asked.items() if value is not None}
    keywords |= {} if objective == OBJECTIVES[0] else {"objective": objective}
    if not out.exists():
        cycles = most_cycles(env, machines=machines, only=chosen, **keywords)
        announce("compare", native_envs(env, **keywords).nominal, DIAGNOSED * cycles)
    scores = Scores(run(env, out, machines=machines, only=chosen, policies=trained, progress=True, **keywords))
    summary = scores.summary()
    if drawn is not None:
        from chaosgym.plotting.played_job import comparison_figure
        from chaosgym.plotting.style import save_picture

        save_picture(comparison_figure(summary, env), drawn)
    emit({"env": env, "contenders": summary}, as_json, lambda: table_lines(summary))


@click.command("run-agent")
@click.argument("env")
@click.option(
    "--policy",
    type=click.Path(file_okay=False, path_type=Path),
    default=None,
    help="Folder with policy.json and weights.npz; default: the shipped policy of ENV and level, or kriging.",
)
@click.option(
    "--machine",
    type=IntRange(0, 255),
    default=0,
    show_default=True,
    help="Of those kept for this; with --plant it draws the demands.",
)
@click.option("--level", type=click.Choice(LEVELS), default=None, help="What differs from job to job.")
@click.option("--load-rating", type=Quantity("N"), help="Of the joint, by which its life is told in hours.")
@click.option("--plant", default=None, metavar="MODULE:CLASS", help="Your machine instead; - for lines of text.")
@click.option(
    "--plant-arg", "arguments", multiple=True, metavar="NAME=VALUE", help="Argument of CLASS; may be repeated."
)
@click.option(
    "--memory",
    type=click.Path(dir_okay=False, path_type=Path),
    help="File in which a learned map keeps what it felt, for the next job of the same plant.",
)
@click.option("--fmu", type=click.Path(dir_okay=False, path_type=Path), help="FMU of another program instead.")
@click.option("--input", "driven", metavar="NAME", help="Variable of the FMU that is the speed.")
@click.option("--output", "felt", multiple=True, metavar="NAME", help="That is the force; twice for two stops.")
@plot_option("--out", formats="figure .png, .svg, .pdf or animation .gif, .mp4")
@AS_JSON
def run_agent(
    env: str,
    policy: Path | None,
    machine: int,
    level: str | None,
    load_rating: float | None,
    plant: str | None,
    arguments: tuple[str, ...],
    memory: Path | None,
    fmu: Path | None,
    driven: str | None,
    felt: tuple[str, ...],
    plot: str | None,
    as_json: bool,
) -> None:
    """Let an agent run one job beside following the demand.

    ENV is an id such as chaosgym/ImpactBeamTolerance-v1, or the file of a machine. Where no policy is shipped or given,
    kriging looks for the speed of least load within reach: it needs no model and no training. It plays at a --plant
    too if no policy is given: a class with reset() and run(speed, cycles), which returns the largest force of each
    cycle [N]. An --fmu for co-simulation is a plant too. It is a program of its author, and runs with your rights.
    """
    from chaosgym.envs import environment

    environment(env)
    foreign = "--plant" if plant is not None else "--fmu"
    if plant is not None or fmu is not None:
        if plant is not None and fmu is not None:
            raise click.UsageError("--plant and --fmu exclude each other")
        for name, given in (("--level", level), ("--load-rating", load_rating)):
            if given is not None:
                raise click.UsageError(f"{name} is of simulated machines; leave it out with {foreign}")
        if plot is not None:
            raise click.UsageError(f"--out draws what a simulation tells; leave it out with {foreign}")
    if fmu is None and (driven or felt):
        raise click.UsageError("--input and --output are of an FMU; give --fmu FILE too")
    if fmu is not None:
        if not driven or not felt:
            raise click.UsageError("--fmu needs --input NAME, its speed, and --output NAME, its force")
        _at_plant(env, policy, machine, str(fmu), arguments, memory, as_json, {"input": driven, "output": felt})
        return
    if plant is not None:
        _at_plant(env, policy, machine, plant, arguments, memory, as_json)
        return
    if memory is not None:
        raise click.UsageError("--memory is of one plant; give --plant MODULE:CLASS or --fmu FILE too")
    if arguments:
        raise click.UsageError("--plant-arg is an argument of a plant; give --plant MODULE:CLASS or --fmu FILE too")
    out = _picture(plot, env)
    from chaosgym.control.controllers import Follow, Kriging
    from chaosgym.control.guard import GuardedPolicy, guarded
    from chaosgym.control.policies import load_policy, shipped_policy
    from chaosgym.control.policies.shipped import shipped_folder
    from chaosgym.control.rollout import Policy, play
    from chaosgym.envs.vector_env import native_envs

    agent: Policy
    keywords: dict[str, Any] = {} if level is None else {"level": level}
    if policy is None and not shipped_folder(env, level).is_dir():
        name, agent, keywords = KRIGING, Kriging(), keywords | {"objective": "life"}
    else:
        name, agent = "agent", load_policy(policy) if policy else shipped_policy(env, level)
    player, envs = guarded(agent), native_envs(env, **keywords)
    announce("run-agent", envs.nominal, 2 * DIAGNOSED * envs.task.steps * envs.task.cycles_per_step)
    with patience("run-agent"):
        job, follow = (play(each, env, [machine], **keywords) for each in (player, Follow()))
    if out is not None:
        from chaosgym.plotting.played_job import save_job

        save_job({name: job, "follow the demand": follow}, out)
    life = float(follow.damage[0] / job.damage[0]) if job.damage[0] > 0.0 else None
    hours = [None if load_rating is None else float(one.life_hours(load_rating)[0]) for one in (job, follow)]
    result = {"agent": type(agent).__name__, **job.as_dict(), "life": life, "follow": follow.as_dict()}
    if load_rating is not None:
        result |= {"load_rating": load_rating, "life_h": [one if one != float("inf") else None for one in hours]}
    result |= {"foreign": not bool(player.trusted[0])} if isinstance(player, GuardedPolicy) else {}
    result |= {"plot": str(out)} if out else {}
    told = [player.statement()] if isinstance(player, GuardedPolicy) and result["foreign"] else []
    emit(result, as_json, lambda: [*_job_lines(name, job, follow, load_rating, out), *told])


def _at_plant(
    env: str,
    policy: Path | None,
    machine: int,
    name: str,
    arguments: tuple[str, ...],
    memory: Path | None,
    as_json: bool,
    variables: dict[str, Any] | None = None,
) -> None:
    """A job at a machine of the user's, beside following the demand there; what was played is told in any case."""
    from chaosgym.cli.interrupt import first_stopped
    from chaosgym.control.controllers import Follow, Kriging
    from chaosgym.control.operator import Operator
    from chaosgym.control.policies import load_policy
    from chaosgym.control.rollout import Policy
    from chaosgym.plants.lines import saying_done
    from chaosgym.plants.plant import plant_of

    with first_stopped(), saying_done() if name == "-" and variables is None else nullcontext():
        agent: Policy = Kriging() if policy is None else load_policy(policy)
        agent_name = type(agent).__name__
        operators = {agent_name: Operator(agent, env, memory=memory), "following the demand": Operator(Follow(), env)}
        values = _named_values(arguments)
        ports = None if variables is None else {"unit": operators[agent_name].unit, **variables}
        plant = plant_of(name, **values) if ports is None else _fmu(name, ports | values)
        played, failure = _worked(plant, operators, machine, name)
    if played:
        jobs = list(played.values())
        life = jobs[1].damage / jobs[0].damage if failure is None and jobs[0].damage > 0.0 else None
        result = {"agent": agent_name, "env": env, "plant": name, "job": machine, **jobs[0].as_dict()}
        result |= {"life": life, "follow": jobs[1].as_dict() if len(jobs) > 1 else None}
        result |= {} if failure is None else {"failure": str(failure)}
        told = [line for who, job in played.items() for line in job.lines(who)]
        told += [] if life is None else [f"{LIFE}: x{life:.2f} against following the demand"]
        emit(result, as_json, lambda: told)
    if isinstance(failure, KeyboardInterrupt):
        click.echo(failure, err=True)
    if failure is not None:
        raise failure


def _worked(
    plant: "Plant", operators: dict[str, "Operator"], machine: int, name: str
) -> tuple[dict[str, "Worked"], "PlantError | Interrupted | None"]:
    """Jobs of the operators in turn, by name, and what ended one of them too early: the steps before it are kept."""
    from chaosgym.control.plant import Interrupted, PlantError, work

    played: dict[str, Worked] = {}
    for who, operator in operators.items():
        try:
            played[who] = work(plant, operator, machine, name)
            operator.keep()
        except (PlantError, Interrupted) as error:
            played |= {} if error.worked is None else {who: error.worked}
            steps = 0 if error.worked is None else len(error.worked.speed)
            error.args = (f"{error}; {steps} steps of the job {who} were played",)
            return played, error
    return played, None


def _fmu(name: str, values: dict[str, Any]) -> "FmuPlant":
    """Plant in an FMU; what it is is said before it is loaded."""
    from chaosgym.plants.fmu import FmuPlant

    try:
        plant = FmuPlant(name, **values)
    except TypeError as error:
        raise click.UsageError(f"--plant-arg: {error}") from error
    click.echo(f"note: {plant.warning}", err=True)
    return plant


def _named_values(arguments: tuple[str, ...]) -> dict[str, Any]:
    """Arguments NAME=VALUE by name; a value is JSON, or else text."""
    values: dict[str, Any] = {}
    for given in arguments:
        name, separator, value = given.partition("=")
        if not separator or not name.isidentifier():
            raise click.UsageError(f"--plant-arg {given}: allowed: NAME=VALUE")
        try:
            values[name] = json.loads(value)
        except ValueError:
            values[name] = value
    return values


def _picture(plot: str | None, env: str) -> Path | None:
    """Path of the figure or animation, checked before a job is played."""
    if plot is None:
        return None
    from chaosgym.plotting.played_job import FORMATS, check_format

    out = picture_path(plot, f"run-agent-{env.rpartition('/')[2]}", FORMATS)
    if out is not None:
        check_format(out)
    return out


def _job_lines(name: str, job: "Played", follow: "Played", load_rating: float | None, out: Path | None) -> list[str]:
    from gymnasium.envs.registration import registry

    from chaosgym.design.texts import hours_text

    about = job.as_dict()
    felt, force = job.column("mean_peak_force")[:, 0], f"mean peak [{job.felt_unit}]".rjust(14)
    digits = 1 if job.felt_unit == "N" else 3
    lines = [f"{'step':>5s} {'demand':>8s} {'speed [' + job.unit + ']':>12s} {force}  Type III"]
    for step in range(0, len(about["speed"]), 10):
        demand, speed, irregular = about["demand"][step], about["speed"][step], about["type_iii"][step]
        lines.append(f"{step + 1:5d} {demand:8.2f} {speed:12.2f} {felt[step]:{len(force)}.{digits}f} {irregular:9.0%}")
    for who, played in ((name, about), ("following the demand", follow.as_dict())):
        lines.append(
            f"{who}: {played['status'].replace('_', ' ')}, return {played['return']:.2f}, Type III in "
            f"{played['type_iii_share']:.1%} of the cycles, {played['mean_deviation']:.2f} {job.unit} off the demand, "
            f"largest force {played['largest_force_N']:.1f} N"
        )
    if name == KRIGING:
        lines.append(NO_POLICY + OF_A_FILE * (job.env not in registry))
    if job.damage[0] > 0.0:
        forces = [float(one.equivalent_force[0]) for one in (job, follow)]
        lines.append(f"equivalent force: {forces[0]:.1f} N, {forces[1]:.1f} N under following the demand")
        lines.append(f"{LIFE}: x{follow.damage[0] / job.damage[0]:.2f} against following the demand")
        if load_rating is not None:
            told = [hours_text(float(one.life_hours(load_rating)[0])) for one in (job, follow)]
            lines.append(f"by --load-rating {load_rating:g} N: {told[0]}, {told[1]} under following the demand")
    return [*lines, *([f"picture: {out}"] if out else [])]
