"""The command ``new-machine``: the file of a machine of one's own, to be edited."""

from pathlib import Path

import click

from chaosgym.cli.output import emit


@click.command("new-machine")
@click.option("--out", type=click.Path(dir_okay=False, path_type=Path), help="New file; standard output by default.")
@click.option("--schema", is_flag=True, help="The JSON schema of such files instead, for editors.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def new_machine(out: Path | None, schema: bool, as_json: bool) -> None:
    """Print the commented file of a machine: modes or matrices, a joint with a gap, and what drives it."""
    from chaosgym.files import write_atomically
    from chaosgym.machines.modal_machine.file import schema_text, template

    text = schema_text() if schema else template()
    if out is not None:
        if out.exists():
            raise click.UsageError(f"--out {out} exists already; choose another name")
        write_atomically(out, lambda path: path.write_text(text, encoding="utf-8"))
    result = {"out": None if out is None else str(out), "text": text}
    told = (
        text.rstrip() if out is None else f"written to {out}" + ("" if schema else f"; next: chaosgym diagnose {out}")
    )
    emit(result, as_json, lambda: [told])
