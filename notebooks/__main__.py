"""`python -m notebooks [NAME ...]`: execute notebooks from start to end, or all; results are in notebooks/executed/."""

import sys
from pathlib import Path

import jupytext
import nbformat
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError

HERE = Path(__file__).parent
SECONDS = 300


def execute(source: Path, target: Path) -> bool:
    """Run one notebook and keep it with its output, also if a cell fails."""
    notebook = jupytext.read(source)
    try:
        NotebookClient(notebook, timeout=SECONDS, kernel_name="python3").execute()
    except CellExecutionError as error:
        print(f"{source.name}: failed\n{error}", file=sys.stderr)
        return False
    finally:
        nbformat.write(notebook, target)
    print(f"{source.name}: {len(notebook.cells)} cells, kept as {target.relative_to(HERE.parent)}")
    return True


def main(names: list[str]) -> int:
    """Run those of these names, or all if there are none; 1 if one failed or is not there."""
    results = HERE / "executed"
    results.mkdir(exist_ok=True)
    known = {path.stem: path for path in sorted(HERE.glob("*.py")) if not path.name.startswith("_")}
    if unknown := [name for name in names if name not in known]:
        print(f"NAME must be of {', '.join(known)}, but was {', '.join(unknown)}", file=sys.stderr)
        return 1
    sources = [known[name] for name in names or known]
    done = [execute(source, results / f"{source.stem}.ipynb") for source in sources]
    return 0 if all(done) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
