"""`python docs/draw_figures.py`: all figures with their captions, as a page of the site in docs/figures/."""

from pathlib import Path

from bseries.figures.registry import compute, drawn, figure_file, figure_names

FOLDER = Path(__file__).parent / "figures"
FEWER = {"lennard-jones-drift": {"members": 16}}
"""Options of figures that would take minutes."""


def section(name: str) -> str:
    """Draw a figure; the text about it."""
    file, options = figure_file(name), FEWER.get(name, {})
    figure = drawn(file, compute(file, options))
    figure.savefig(FOLDER / f"{name}.png", dpi=130)
    settings = "".join(f" --set {key}={value}" for key, value in options.items())
    return f"## {file.TITLE}\n\n![{file.TITLE}]({name}.png)\n\n{figure.caption}\n\n`bseries figure {name}{settings}`\n"


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    page = "\n".join(["# All figures\n", *map(section, figure_names())])
    (FOLDER / "index.md").write_text(page, encoding="utf-8")
