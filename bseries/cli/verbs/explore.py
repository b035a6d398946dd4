"""`bseries explore` and `bseries report`: a method and its flows, from a server or as one HTML file."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

import click

from bseries.cli.application import Refusal
from bseries.cli.options.method_argument import takes_method
from bseries.cli.options.scene_argument import takes_scene, takes_start
from bseries.cli.options.values import WholeNumber
from bseries.cli.output import Progress, complete_file

if TYPE_CHECKING:
    from bseries.cli.options.method_argument import Method
    from integrators import Scene


PORT = 5006


@click.command()
@click.option("--port", type=WholeNumber(), default=PORT, help=f"The port; by default {PORT}, and 0 for any free one.")
@click.option("--open/--no-open", "opens", default=True, help="Open the page in the browser, which is the default.")
def explore(port: int, opens: bool) -> None:
    """Methods and their flows on scenes, in a browser.

    Pick a method of the catalogue or paste a tableau, and see it with its order and structure, its modified equation
    with pictures of trees, its stability region and order star. On a scene, or on equations of your own, sliders for
    the step size, the start and the number of terms move the numerical, the exact and the modified solution, the
    energies, a patch of initial values, and many orbits.

    The server answers this machine only, and stops with Ctrl-C. An address such as
    http://127.0.0.1:5006/?method=gauss2&scene=kepler can be kept. `bseries report` writes such a page to a file.

    \b
    Examples:
      bseries explore
      bseries explore --port 0 --no-open
    """
    from bseries.exceptions import SeriesError
    from bseries.explorer.server import serve

    if not 0 <= port <= 65535:
        raise SeriesError(f"port must be from 0 to 65535, but was {port}")

    def ready(address: str) -> None:
        click.echo(f"The explorer is at {address}; Ctrl-C stops it.")
        if opens:
            click.launch(address)

    with suppress(KeyboardInterrupt):
        serve(port, ready)


@click.command()
@takes_method()
@takes_scene(as_argument=True, required=False)
@click.option(
    "-o", "--output", "path", metavar="FILE", shell_complete=complete_file, help="The file, which ends in .html."
)
@click.option("--order", type=WholeNumber(), help="The largest number of nodes of trees; by default, about 100 trees.")
@click.option("--span", metavar="T", help="The length of time of solutions; by default, 20.")
@takes_start
def report(
    method: Method,
    scene: Scene | None,
    effects: object,
    path: str | None,
    order: int | None,
    span: str | None,
    start: dict[str, list[str]] | None,
) -> None:
    """A method, and its flows on a scene, as one HTML file for a browser.

    The file needs no network. It has the tableau, order and structure, the modified equation with pictures of trees
    (to sort, filter and copy as LaTeX or JSON), the stability region and the order star. On a scene it compares the
    numerical, the exact and the modified solution, the energies H and H~, a patch of initial values and many orbits,
    with sliders for the step size, the start and the number of terms.

    \b
    Examples:
      bseries report rk4 -o rk4.html
      bseries report symplectic-euler-p pendulum -o pendulum.html
      bseries report stormer-verlet --hamiltonian "p^2/2 + q^4/4" --start "p=0;q=1" --span 10 -o quartic.html
    """
    from bseries.explorer.flows import MOST_SPAN, SPAN
    from bseries.explorer.reading import read_positive
    from bseries.explorer.report import report_html
    from bseries.picture_files import check_place
    from integrators.core.text_files import atomic_write

    if path is None or not path.lower().endswith(".html"):
        raise Refusal(f"output must be given and end in .html, as in -o report.html, but was {path!r:.60}")
    if scene is None and (span is not None or start is not None):
        raise Refusal("span and start must come with a SCENE, but there was none")
    check_place(path, "output")
    length = read_positive(span or "", "span", SPAN, MOST_SPAN)
    if scene is not None and start is not None:
        scene = scene.with_start(**start)
    with Progress() as progress:
        text = report_html(method, scene, nodes=order, span=length, progress=progress.update)
    atomic_write(path, text)
