"""Every file that is computed and committed: what it is computed from, and the command that makes it.

`doit list --all --status` shows what is stale (R), `doit NAME` makes it anew. What depends on the kernels depends on
the golden set, which holds what their results mean. Long computations go on where they were stopped (``runs/``).
"""

import ast
import hashlib
import io
import tokenize
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from doit.dependency import FileChangedChecker


def meaning(file: str) -> str:
    """What counts of a file: its bytes; of a source all but comments, blank lines and docstrings.

    Docstrings of commands are their help, and count.
    """
    if not file.endswith(".py"):
        return hashlib.sha256(Path(file).read_bytes()).hexdigest()[:16]
    text = Path(file).read_text()
    lines = text.splitlines()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            lines[token.start[0] - 1] = lines[token.start[0] - 1][: token.start[1]]
    for node in ast.walk(ast.parse(text)):
        documents = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        if documents and "/cli/" not in file:
            lines[node.lineno - 1 : node.end_lineno] = [""] * (node.end_lineno - node.lineno + 1)
    return hashlib.sha256("\n".join(line.rstrip() for line in lines if line.strip()).encode()).hexdigest()[:16]


class Meaning(FileChangedChecker):
    """A file is another when its ``meaning`` is."""

    def check_modified(self, file_path, file_stat, state):
        """Whether a file means something else than its digest."""
        return meaning(file_path) != state

    def get_state(self, dep, current_state):
        """Digest of a file."""
        return meaning(dep)


class Lines:
    """What doit keeps, as sorted lines of text: artefact, file that it rests on, digest of that."""

    def encode(self, data):
        """Text of the digests by artefact."""
        kept = ((name, file, known[file]) for name, known in data.items() for file in known.get("deps:", ()))
        return "".join(sorted(f"{name}  {file}  {digest}\n" for name, file, digest in kept))

    def decode(self, text):
        """Digests by artefact, of a text."""
        data: dict[str, dict[str, Any]] = {}
        for line in text.splitlines():
            name, file, digest = line.split("  ")
            known = data.setdefault(name, {"deps:": []})
            known["deps:"].append(file)
            known[file] = digest
        return data


DOIT_CONFIG = {
    "backend": "json",
    "dep_file": "artefacts.txt",
    "codec_cls": Lines,
    "check_file_uptodate": Meaning,
    "default_tasks": [],
    "verbosity": 2,
}

GOLDEN = "tests/golden/golden.json"
RUNS = "runs/" + hashlib.sha256(Path(GOLDEN).read_bytes()).hexdigest()[:8]
"""Folder of unfinished work; another one when the kernels' results mean something else."""

SHIPPED = Path("src/chaosgym/control/policies/shipped")

TASKS = ["src/chaosgym/envs/levels.py", "src/chaosgym/envs/judge.py"]
TASKS += sorted(map(str, Path("src/chaosgym/machines").glob("*/task_defaults.py")))
"""What says how machines are used in the environments, and when they cost."""

RECIPES = "datasets/datasets.toml"
DATASETS = tuple(tomllib.loads(Path(RECIPES).read_text()))
"""Machines whose datasets are made; the options stand in ``RECIPES``."""

LARGE = "--memory --units 128 --envs 64 --batch 1920 --rollout 120 --epochs 6"
FLEET = """--keywords '{"level": "fleet", "split": "train"}'"""


def of_five_runs(env: str, steps: int, options: str, fit: str) -> list[str]:
    """Commands of a learned map of a fleet: the jobs of five seeds, and one fit to all of them."""
    play = f"python agents/learn_map.py {FLEET} {options}"
    runs = [f"{RUNS}/{env}-fleet-{seed}" for seed in range(5)]
    jobs = [f"{play} --env chaosgym/{env} --seed {k} --steps {steps} --out {run}" for k, run in enumerate(runs)]
    return [*jobs, f"{play} --steps 0 --jobs {' '.join(runs)} {fit}"]


POLICIES = {
    "ImpactBeamTolerance-v1": ["python agents/learn_map.py --seed 0 --steps 600000"],
    "ImpactBeamWear-v1": ["python agents/learn_map.py --seed 0 --steps 600000"],
    "SliderCrankTolerance-v1": [f"python agents/ppo.py --fidelity draft --seed 0 --steps 240000 {LARGE}"],
    "ImpactBeamTolerance-v1-fleet": of_five_runs(
        "ImpactBeamTolerance-v1", 368_640, "", "--units 512 --dropout 0.3 --least-gain 0.05 --wary"
    ),
    "SliderCrankTolerance-v1-fleet": of_five_runs(
        "SliderCrankTolerance-v1", 230_400, "--fidelity draft", "--units 512 --dropout 0.4 --epochs 12"
    ),
}
"""Commands of the shipped policies, by id and level; the last of each writes the policy."""

ON_FLEET = "--level fleet --split test " + " ".join(f"--only '{name}'" for name in ("back off, with memory", "belief"))
SCORES = {
    "ImpactBeamTolerance-v1": "--machines 256",
    "ImpactBeamWear-v1": "--machines 96",
    "ImpactBeam-v1": "--machines 64",
    "SliderCrankTolerance-v1": "--machines 128",
    "SliderCrankWear-v1": "--machines 16",
    "SliderCrank-v1": "--machines 16",
    "ImpactBeamTolerance-v1-fleet": f"--machines 64 {ON_FLEET} --only table",
    "SliderCrankTolerance-v1-fleet": f"--machines 16 {ON_FLEET}",
}
"""How many of the machines kept for evaluation the shipped comparisons have."""

LEARNED = [f"src/chaosgym/weights/{machine}.npz" for machine in DATASETS]
LEARNED += [f"{SHIPPED}/{name}/weights.npz" for name in POLICIES]
"""What answers and plays in commands and tutorials."""

PLAYED = [
    f"src/chaosgym/control/controllers/{name}.py" for name in ("controller", "feedback", "kriging", "planned", "table")
]
"""Files of the contenders of the shipped comparisons; another contender's is none of them until it has played."""

LADDER_OPTIONS = {
    "impact-beam": "--points 60 --cycles 200 --transient 100 --budget 4 --workers 1",
    "slider-crank": "--points 60 --cycles 50 --transient 30 --budget 4 --workers 1",
}


def sources(*folders: str) -> list[str]:
    """Python files in some folders and below."""
    return [str(path) for folder in folders for path in sorted(Path(folder).rglob("*.py"))]


def id_of(name: str) -> str:
    """Id of what is named by it and a level."""
    return f"chaosgym/{name.removesuffix('-fleet')}"


def task(name: str, uses: Iterable[str], makes: Iterable[str], *commands: str) -> dict[str, Any]:
    """A subtask of doit."""
    return {"name": name, "file_dep": [GOLDEN, *uses], "targets": [*makes], "actions": [*commands]}


def whole(machine: str) -> str:
    """Folder of the whole dataset: where it is finished, or else where it is made."""
    places = [f"{RUNS}/{machine}", f"datasets/{machine}/whole"]
    return next((place for place in places if Path(place, "sweep.parquet").is_file()), places[0])


def kept(machine: str) -> list[str]:
    """What Git keeps of a dataset; what is trained on the whole rests on these, so that a clone needs no more.

    They are rows of the whole and the plan of all others, so that no other whole has the same.
    """
    return [f"datasets/{machine}/sample/sweep.parquet", f"datasets/{machine}/plan.json"]


def task_dataset():
    """Labelled crosses of independent machines; a sample of them is kept."""
    for machine in DATASETS:
        run = f"{RUNS}/{machine}"
        build = f"python -m benchmarks build-dataset {machine} --no-check --out {run}"
        made = [*kept(machine), f"datasets/{machine}/CARD.md"]
        yield task(machine, [RECIPES], made, build, f"python -m benchmarks ship-dataset {run}")


def task_classifier():
    """The classifier of each machine, from its whole dataset."""
    for machine in DATASETS:
        used = [*kept(machine), *sources("src/chaosgym/classifier")]
        made, run, data = f"src/chaosgym/weights/{machine}.npz", f"{RUNS}/classifier-{machine}", whole(machine)
        build = f"python -m benchmarks build-dataset {machine} --out {data}"
        train = f"chaosgym train-classifier --data {data} --out {run}"
        yield task(machine, used, [made], build, f"rm -rf {run}", train, f"cp {run}/*.npz {made}")


def task_signs():
    """How often the signs of chaos of thesis 5.3 were right on the whole datasets."""
    used = [file for machine in DATASETS for file in kept(machine)]
    used += ["src/chaosgym/diagnosis/precursors.py", "benchmarks/sweeps/signs.py"]
    builds = [f"python -m benchmarks build-dataset {machine} --out {whole(machine)}" for machine in DATASETS]
    count = "python -m benchmarks.sweeps.signs " + " ".join(map(whole, DATASETS))
    yield task("rates", used, ["src/chaosgym/diagnosis/signs.json"], *builds, count)


def task_policy():
    """Shipped policies; each command goes on where it was stopped."""
    for name, (*before, command) in POLICIES.items():
        folder, run = SHIPPED / name, f"{RUNS}/{name}"
        made = [f"{folder}/{file}" for file in ("policy.json", "weights.npz", "progress.csv")]
        copies = [f"cp {run}/{Path(file).name} {file}" for file in made]
        full = f"{command} --env {id_of(name)} --out {run}"
        yield task(name, TASKS, made, *before, full, *copies)


def task_sense():
    """The sense of irregular motion behind ``classifier="on"``; the command goes on where it was stopped."""
    run, made = f"{RUNS}/sense", "src/chaosgym/weights/impact-beam-sense.npz"
    used = [*TASKS, "agents/learn_sense.py", "src/chaosgym/envs/classified.py", "src/chaosgym/envs/sense.py"]
    train = f"python agents/learn_sense.py {FLEET} --seed 0 --out {run}"
    yield task("impact-beam", used, [made], train, f"cp {run}/sense.npz {made}")


def task_pool():
    """Machines of chaosgym/AnyMachine-v0, drawn and filtered."""
    used = ["src/chaosgym/machines/family.py", "src/chaosgym/envs/pool.py", "benchmarks/envs/pool.py"]
    yield task("machines", used, ["src/chaosgym/envs/pool.csv"], "python -m benchmarks pool")


def task_scores():
    """Jobs of controllers and policies on the machines kept for evaluation."""
    for name, options in SCORES.items():
        made, run = f"src/chaosgym/control/results/{name}.parquet", f"{RUNS}/{name}.parquet"
        used = TASKS + PLAYED
        if name in POLICIES:
            used.append(f"{SHIPPED}/{name}/weights.npz")
            kind = "map" if "learn_map" in POLICIES[name][-1] else "ppo"
            options += f" --policy {kind}={SHIPPED}/{name}"
        compare = f"chaosgym compare {id_of(name)} {options} --out {run}"
        yield task(name, used, [made], f"mkdir -p {RUNS}", compare, f"cp {run} {made}")


def task_jobs():
    """Jobs of the fleet's beams in Exudyn; the same command without ``rm`` goes on with a file of fewer."""
    made = "docs/data/other-simulator.jsonl"
    used = TASKS + PLAYED + [f"{SHIPPED}/ImpactBeamTolerance-v1-fleet/weights.npz"]
    used += ["benchmarks/envs/other_simulator.py", "src/chaosgym/envs/exudyn_beam.py"]
    yield task("other-simulator", used, [made], f"rm -f {made}", "python -m benchmarks other-simulator")


def task_page():
    """Pages of the documentation that a command writes."""
    pages = [str(path) for path in Path("docs/environments").glob("*.md")]
    made = "python -m benchmarks.envs.documentation docs"
    texts = ["benchmarks/envs/documentation.py", "benchmarks/envs/page.md", "benchmarks/envs/task.md"]
    yield task("environments", TASKS + sources("src/chaosgym/envs") + texts, pages, made)
    statements = [str(path) for path in Path("thesis/statements").iterdir() if path.suffix in (".csv", ".toml")]
    statements.append("thesis/scorecard/firmness.json")
    write = "python -m thesis scorecard --markdown > docs/development/scorecard.md"
    yield task("scorecard", [*statements, *sources("thesis/scorecard")], ["docs/development/scorecard.md"], write)
    write = "python -m thesis numerics --markdown > docs/development/numerics.md"
    yield task("numerics", [*statements, *sources("thesis/scorecard")], ["docs/development/numerics.md"], write)
    options = f"--gallery docs/development/figures.md --overwrite --results {RUNS}/figures"
    draw = f"python -m thesis figures all --out docs/development/figures {options}"
    examples = "benchmarks/documentation/examples.toml"
    pages = [str(path) for path in Path("docs/commands").glob("*.md")]
    write = "python -m benchmarks.documentation.commands docs/commands"
    yield task("commands", [examples, *TASKS, *LEARNED, *sources("src/chaosgym/cli")], pages, write)
    briefs = sorted(map(str, Path("docs/examples").glob("*.toml")))
    machines = [f"docs/machines/{name}.toml" for name in ("compressor", "pipe-in-two-supports")]
    made = ["docs/worked-examples.md", *(brief.replace(".toml", ".png") for brief in briefs)]
    yield task("worked", [*briefs, *machines], made, f"python -m benchmarks.documentation.worked {made[0]}")
    for script in sorted(Path("docs/tutorials").glob("*.py")):
        run = f"python -m benchmarks.documentation.tutorials docs/tutorials {script.name}"
        yield task(script.stem, [str(script), *TASKS, *LEARNED], [str(script.with_suffix(".ipynb"))], run)
    yield task("figures", sources("thesis/figures"), ["docs/development/figures.md"], draw)


def task_picture():
    """Pictures of the rattling beam, of an agent at work, of the trade-off and of the extremes."""
    rattle = "benchmarks/documentation/rattle.py"
    yield task("rattle", [rattle], ["docs/rattle.gif"], "python -m benchmarks.documentation.rattle docs/rattle.gif")
    used = ["thesis/figures/type_two.py", "thesis/scorecard/candidates.json"]
    yield task("type-two", used, ["docs/type-two.png"], "python -m thesis.figures.type_two docs/type-two.png")
    for name, machine in (("agent", "ImpactBeam"), ("crank", "SliderCrank")):
        play = f"chaosgym run-agent chaosgym/{machine}Tolerance-v1 --machine 13 --out docs/{name}.gif"
        yield task(name, [*TASKS, *LEARNED], [f"docs/{name}.gif"], play)
    curves, drawn = "docs/data/training.csv", "docs/training.png"
    draw = f"python -m benchmarks curves --table {curves} --figure {drawn}"
    yield task("training", [curves, "benchmarks/envs/curves.py"], [drawn], draw)
    for machine in DATASETS:
        for kind, program, options, folder, own in (
            ("tradeoff", "chaosgym", LADDER_OPTIONS[machine], "docs", "src/chaosgym/fidelity"),
            ("stability", "python -m benchmarks", "", "docs/development", "benchmarks/fidelity"),
        ):
            made, run = f"{folder}/{kind}-{machine}.png", f"{RUNS}/{kind}-{machine}"
            measure = f"{program} {kind} {machine} {options} --out {run}"
            copy = f"cp {run}/{kind}.png {made}"
            rungs = f"src/chaosgym/machines/{machine.replace('-', '_')}/parameters.py"
            used = [rungs, *sources(own)]
            yield task(f"{kind}-{machine}", used, [made], f"mkdir -p {run}", measure, copy)


def task_sample():
    """The recordings and the measured sweep that the documentation judges."""
    swept = "docs/data/sweep.csv"
    used = ["benchmarks/documentation/swept_peaks.py", "thesis/scorecard/candidates.json"]
    yield task("sweep", used, [swept], f"python -m benchmarks.documentation.swept_peaks {swept}")
    point = "--frequency-hz '30 Hz' --clearance-mm '0.127 mm' --cycles 1000 --transient 200"
    decided = ["docs/data/periodic.csv", "docs/data/chaotic.csv"]
    used = ["benchmarks/documentation/sample_recordings.py", "docs/machines/shaw-holmes-1983.toml"]
    yield task("decided", used, decided, "python -m benchmarks.documentation.sample_recordings docs/data")
    made = "docs/data/peaks.csv"
    run = f"chaosgym simulate impact-beam {point} --fidelity standard --out {made}"
    yield task("peaks", [], [made], f"rm -f {made}", run)


def task_mutate():
    """Share of changes of chosen modules that their tests notice, or of ``doit mutate 'chaosgym.design.*'`` alone."""
    show = "mutmut results | grep -v 'not checked' || true"
    return {"actions": ["rm -rf mutants", "mutmut run %(names)s", show], "pos_arg": "names", "uptodate": [False]}
