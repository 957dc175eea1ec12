"""The command ``exclusions``: which printed statements no beam of the searches hits together."""

from pathlib import Path

import click

from chaosgym.cli.output import AS_JSON, emit


@click.command()
@click.argument("journals", nargs=-1, type=click.Path(dir_okay=False, exists=True, path_type=Path))
@AS_JSON
def exclusions(journals: tuple[Path, ...], as_json: bool) -> None:
    """Tell pairs of statements that no beam hits together: of the kept search, and of JOURNALS (journal.jsonl)."""
    from thesis.scorecard.exclusions import known_exclusions

    found = known_exclusions(journals)
    emit(found.as_dict(), as_json, lambda: found.lines)
