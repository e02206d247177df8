"""Reproduce a paper: python -m papers kim2001."""

from pathlib import Path
from typing import Annotated

import typer

from caster_gym.agents.commands.command_line import NOTHING_WRITTEN, PARTS_BAR, Overwrite, plain_errors, progress
from papers.reproduction import find_paper, reproduce

app = typer.Typer(
    rich_markup_mode=None,  # it takes a unit such as [s] for markup, and leaves it out
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 120},
)


@app.command()
def main(
    paper: Annotated[str, typer.Argument(help="chung2008 or kim2001.")],
    out: Annotated[Path, typer.Option(help="Folder for the page PAPER.md and its folder PAPER.")] = Path("runs/papers"),
    overwrite: Overwrite = False,
) -> None:
    """Compute everything that a paper computes: figures, tables, and a page with each printed number beside ours."""
    with plain_errors(NOTHING_WRITTEN):
        with progress(total=len(find_paper(paper).parts), desc=paper, bar_format=PARTS_BAR) as show:
            verdict = reproduce(paper, out, overwrite, lambda work, done: show(done, work))
        share = f"{verdict.agreeing} of {verdict.compared}"
        typer.echo(f"{share} printed numbers and statements agree; {out / paper}.md shows all.")
        if verdict.unexplained:
            raise ValueError(f"no reason is known why these differ: {'; '.join(verdict.unexplained)}")


if __name__ == "__main__":
    app(prog_name="python -m papers")
