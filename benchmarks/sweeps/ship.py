"""What the repository keeps of a dataset: a sample of its rows, its plan and its card.

The whole grows Git by its size with every regeneration, since computed numbers do not compress against their
predecessors.
"""

import shutil
from pathlib import Path

from benchmarks.sweeps.build import SAMPLE, WHOLE, drawn_digest, settings_digest, write_sample
from benchmarks.sweeps.card import CARD_FILE, dataset_card
from chaosgym.files import write_atomically
from chaosgym.sweeps.dataset import LabelledSweep, read_sweep
from chaosgym.sweeps.folder import PLAN_FILE

DATASETS = Path("datasets")


def ship_dataset(folder: Path) -> list[Path]:
    """Write sample, plan and card of the whole dataset in a folder into ``datasets``; return their files."""
    whole = read_sweep(folder)
    name = whole.plan.machine.name
    home = DATASETS / name
    sample = write_sample(whole, home / SAMPLE)
    shutil.copyfile(folder / PLAN_FILE, home / PLAN_FILE)
    text = dataset_card(whole, folder).replace(str(folder), str(home / WHOLE))
    title, _, rest = text.partition("\n\n")
    card = "\n\n".join([title, _about_sample(whole, sample), rest])
    write_atomically(home / CARD_FILE, lambda temporary: temporary.write_text(card))
    return [sample, home / PLAN_FILE, home / CARD_FILE]


def _about_sample(whole: LabelledSweep, file: Path) -> str:
    part, plan = read_sweep(file.parent).plan, whole.plan
    return (
        f"This card describes the whole. Git keeps the first {part.size:,} of its {plan.size:,} crosses, "
        f"`{SAMPLE}/{file.name}`, with the signals of {part.signals:.0%} of the rows. "
        f"`python -m benchmarks build-dataset {plan.machine.name}` makes the whole and compares it with the sample. "
        f"Digest of settings {settings_digest(plan)}, of drawn machines {drawn_digest(plan)}."
    )
