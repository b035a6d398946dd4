"""On what the figures were measured."""

from __future__ import annotations

import subprocess

from bseries.advice.timing import machine

from .timing import ROOT


def environment() -> dict[str, str]:
    """Date, commit, processor and versions."""
    found = machine()
    return {"date": found.pop("date"), "commit": _commit(), **found}


def _commit() -> str:
    command = ["git", "describe", "--always", "--dirty"]
    try:
        return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
