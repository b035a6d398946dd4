"""`bseries completion`: the script by which a shell completes verbs, options and method names."""

from __future__ import annotations

import click

from bseries.cli.application import Refusal, application

SHELLS = ("bash", "zsh", "fish")


@click.command()
@click.argument("shell", metavar="SHELL")
def completion(shell: str) -> None:
    """Print the completion script of a shell: bash, zsh or fish.

    \b
    Examples:
      bseries completion bash >> ~/.bashrc
      bseries completion zsh >> ~/.zshrc
      bseries completion fish > ~/.config/fish/completions/bseries.fish
    """
    from click.shell_completion import get_completion_class

    source = get_completion_class(shell) if shell in SHELLS else None
    if source is None:
        raise Refusal(f"shell must be one of {', '.join(SHELLS)}, but was {shell!r:.60}")
    click.echo(source(application, {}, "bseries", "_BSERIES_COMPLETE").source())
