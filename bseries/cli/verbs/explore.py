"""`bseries explore`: methods and their flows in a browser, from a server on this machine."""

from __future__ import annotations

from contextlib import suppress

import click

from bseries.cli.output import WholeNumber

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
