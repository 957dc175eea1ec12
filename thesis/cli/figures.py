"""The command ``figures``: what the thesis shows, and what is found here."""

import click

from chaosgym.cli.output import AS_JSON, WORKERS, emit


@click.command()
@click.argument("ids", nargs=-1, metavar="[IDS]...")
@click.option("--out", type=click.Path(file_okay=False), help="Folder for the pictures.")
@click.option("--list", "only_list", is_flag=True, help="Name all figures and stop.")
@click.option("--resolution", type=float, default=1.0, show_default=True, help="2: twice as many points along an axis.")
@click.option("--results", type=click.Path(file_okay=False), help="Folder that keeps results; default: OUT/results.")
@click.option("--gallery", type=click.Path(dir_okay=False), help="Markdown page to write: what agrees, what does not.")
@click.option("--overwrite", is_flag=True, help="Replace pictures and page that exist.")
@WORKERS
@AS_JSON
def figures(
    ids: tuple[str, ...],
    out: str | None,
    only_list: bool,
    resolution: float,
    results: str | None,
    gallery: str | None,
    overwrite: bool,
    workers: int | None,
    as_json: bool,
) -> None:
    """Draw the simulated figures of the thesis (IDS such as 3.8, or all) and compare them with the print."""
    from pathlib import Path

    from thesis.figures import chosen, draw_figures, listing
    from thesis.figures.gallery import totals, write_gallery

    asked = chosen(ids)
    if only_list:
        titles = {figure.id: figure.title for figure in asked}
        return emit({"figures": titles}, as_json, lambda: listing(asked))
    if out is None:
        raise click.UsageError("give a folder with --out, or --list")
    if gallery is not None and Path(gallery).exists() and not overwrite:
        raise click.UsageError(f"{gallery} exists; replace it with --overwrite")
    drawn = draw_figures(
        asked, out, resolution=resolution, results=results, overwrite=overwrite, workers=workers, progress=True
    )
    if gallery is not None:
        write_gallery(drawn, Path(gallery))
    count = totals(drawn)
    lines = [line for one in drawn for line in one.lines()]
    lines.append(f"{out}: of the printed statements {count['agree']} agree, {count['differ']} differ")
    emit({"folder": out, "figures": [one.as_dict() for one in drawn], "totals": count}, as_json, lambda: lines)
    if any(one.error for one in drawn):
        raise click.exceptions.Exit(1)
