"""Results of ensembles: statistics of blocks of members, results in memory and in files, the folder of finished blocks.

Floating-point sums depend on their order, so the order is fixed: members are the leaves of a binary tree, in the order
of their numbers, and the statistics of two neighbours are merged into their parent. Members 2^k·j … 2^k·(j + 1) − 1
form one subtree, so blocks of 2^k members can be computed anywhere.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import chain
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from bseries_base.diagrams import axis_label, draw_band, draw_legend, of_line
from bseries_base.errors import shorten
from bseries_base.extras import optional_module
from bseries_base.numbers import finite_or_none
from bseries_base.plotting import BLUE, GREY, drawing
from bseries_base.table import Column, Document, LazyRows, Table, Tabular, number_column
from integrators.core.errors import IntegratorError
from integrators.core.stored_arrays import TEXT, Form, StoredArrays, read_json, reading, write_arrays
from integrators.core.text_files import atomic_write, check_path, read_text
from integrators.runs.storage import check_identity
from integrators.runs.titles import write_title

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame
    from xarray import Dataset


class Statistics(NamedTuple):
    """Statistics over some members: their number, (times,), and for each quantity, (times, quantities), the mean, the
    sum of squared deviations from it, and the extremes."""

    count: np.ndarray  # type: ignore[assignment]  # not the method of tuples
    mean: np.ndarray
    squares: np.ndarray
    minimum: np.ndarray
    maximum: np.ndarray


def member_statistics(values: np.ndarray, rows: int) -> Statistics:
    """The statistics of one member with quantities `values`, of which the first `rows` times were reached."""
    there = np.arange(len(values)) < rows
    known = there[:, None]
    mean = np.where(known, values, 0.0)
    least, largest = np.where(known, values, np.inf), np.where(known, values, -np.inf)
    return Statistics(there.astype(np.int64), mean, np.zeros_like(mean), least, largest)


def merged(a: Statistics, b: Statistics) -> Statistics:
    """The statistics over both sets of members.

    References:
        T. F. Chan, G. H. Golub, R. J. LeVeque, Amer. Statist. 37 (1983) 242–247, doi:10.1080/00031305.1983.10483115.
    """
    count = a.count + b.count
    weight = (b.count / np.maximum(count, 1))[:, None]
    with np.errstate(invalid="ignore", over="ignore"):  # quantities may be infinite
        gap = b.mean - a.mean
        mean = a.mean + gap * weight
        squares = a.squares + b.squares + gap * (a.count[:, None] * weight) * gap
    return Statistics(count, mean, squares, np.minimum(a.minimum, b.minimum), np.maximum(a.maximum, b.maximum))


def merged_pairwise(leaves: Iterable[Statistics]) -> Statistics:
    """The statistics of all leaves, members or blocks, merged along the tree; few are kept at any time."""
    subtrees: list[Statistics] = []
    for number, leaf in enumerate(leaves, 1):
        subtrees.append(leaf)
        while number % 2 == 0:  # both halves of a subtree are there
            right = subtrees.pop()
            subtrees[-1] = merged(subtrees[-1], right)
            number //= 2
    whole = subtrees.pop()
    while subtrees:
        whole = merged(subtrees.pop(), whole)
    return whole


class Failure(NamedTuple):
    """A member that did not reach the end."""

    member: int  # its number, from 0
    step: int  # the step that failed, from 1; 0 if there was no start
    t: float  # the time before that step
    y: tuple[float, ...] | None  # the state before that step, if there was one
    reason: str


class Block(NamedTuple):
    """The results of a block of members.

    `series` are observations of the members to be kept, (members, times, quantities); `ends` the last states, (members,
    variables), nan for failed members, without rows if they are not saved.
    """

    statistics: Statistics
    series: np.ndarray
    ends: np.ndarray
    failures: tuple[Failure, ...]


def merged_blocks(blocks: Iterable[Block]) -> Block:
    """The results of all blocks, which come in the order of their members; their statistics are merged pairwise."""
    rests: list[tuple[object, ...]] = []

    def leaves() -> Iterator[Statistics]:
        for block in blocks:
            rests.append(block[1:])
            yield block.statistics

    statistics = merged_pairwise(leaves())
    series, ends, failures = zip(*rests, strict=True)
    return Block(statistics, np.concatenate(series), np.concatenate(ends), tuple(chain.from_iterable(failures)))


KIND = "ensemble"
NUMBER = int, float
NAMED = {"name": str}
META = {"method": NAMED, "scene": NAMED, "members": int, "steps": int, "h": NUMBER, "change": [(None, str)]}
HEAD = {"kind": str, "names": [str], "meta": META}
BLOCK = {
    "count": Form("i", ("times",)),
    **dict.fromkeys(Statistics._fields[1:], Form("f", ("times", "quantities"))),
    "series": Form("f", ("kept", "times", "quantities")),
    "ends": Form("f", ("ends", "variables")),
    "failures": TEXT,
}
FAILURE = {"member": int, "step": int, "t": NUMBER, "y": (None, [NUMBER]), "reason": str}
"""The content of the files."""

STATISTICS = ("mean", "std", "minimum", "maximum")
LIGHT = "#e8f0f8"
"""Of the band of extremes, lighter than that of deviations."""
MOST_FAILURES = 5
"""The most failures that are listed."""


MEANS = (
    Column("what", get=lambda record: record["what"]),
    number_column("mean_at_start", ".6g", "mean at start"), number_column("mean_at_end", ".6g", "mean at end"),
    number_column("std_at_end", ".6g", "std at end"), number_column("minimum", ".6g"),
    number_column("maximum", ".6g"),
)  # fmt: skip


class EnsembleResult(Tabular):
    """Statistics of an ensemble; made by `ensemble`, and by `load_ensemble`.

    A member that failed counts up to its failure. Mappings are from the names of quantities to arrays (times,), with
    nan where there are too few members.

    Attributes:
        t: The times, (times,).
        names: The quantities.
        meta: The scene, the method and the options.
        failures: The members that did not reach the end.
        count: The number of members that reached each time, (times,).
        mean, variance, std: Means, unbiased variances, and standard deviations.
        minimum, maximum: Smallest and largest values.
        series: The quantities of the first `keep` members, (members, times); nan after a failure.
        final: The last states, (members, variables), nan for failed members; no rows if they were not saved.

    Example:
        >>> import bseries as bs
        >>> starts = [[-1], [-2], [9]]
        >>> result = bs.ensemble("rk4", "riccati", h=0.1, steps=20, y0=starts, observe=None, final=True)
        >>> result
        <EnsembleResult rk4 on riccati: 3 members, 1 failed, 21 times>
        >>> [(failure.member, failure.step) for failure in result.failures]
        [(2, 4)]
        >>> print(result.final.T.round(4), result.count[-1])
        [[-0.3333 -0.4  nan]] 2
    """

    def __init__(self, t: np.ndarray, names: Sequence[str], whole: Block, meta: Document):
        def tables(array: np.ndarray, least: int) -> dict[str, np.ndarray]:
            """By name, where there are at least this many members."""
            return dict(zip(self.names, np.where(self.count[:, None] >= least, array, np.nan).T, strict=True))

        self.t, self.names, self.meta, self._whole = t, tuple(names), dict(meta), whole
        self.failures: tuple[Failure, ...] = whole.failures
        statistics = whole.statistics
        self.count: np.ndarray = statistics.count
        self.mean = tables(statistics.mean, 1)
        self.variance = tables(statistics.squares / np.maximum(self.count - 1.0, 1.0)[:, None], 2)
        self.std = {name: np.sqrt(variance) for name, variance in self.variance.items()}
        self.minimum, self.maximum = tables(statistics.minimum, 1), tables(statistics.maximum, 1)
        self.series = {name: whole.series[:, :, k] for k, name in enumerate(self.names)}
        self.final: np.ndarray = whole.ends

        self._about = f"{self.meta['method']['name']} on {self.meta['scene']['name']}"

    def __repr__(self) -> str:
        failed = f", {len(self.failures)} failed" if self.failures else ""
        return f"<EnsembleResult {self._about}: {self.meta['members']} members{failed}, {len(self.t)} times>"

    def to_table(self) -> Table:
        """Statistics of each quantity; CSV has them at all times."""
        h, steps, times = self.meta["h"], self.meta["steps"], [float(self.t[0]), float(self.t[-1])]
        records = list(_records(self))
        facts = {"schema": 1, "kind": "ensemble", "h": h, "steps": steps, "t": times, "members": self.meta["members"]}
        facts["failures"] = [{"member": f.member, "step": f.step, "t": f.t, "reason": f.reason} for f in self.failures]
        return Table(
            f"{self._about}: {self.meta['members']:,} runs of {steps:,} steps of {h:g}, to t = {times[1]:g}",
            MEANS,
            records,
            list(_notes(self)),
            data=lambda: {**facts, "rows": records},
            items="rows",
            records=_statistics(self),
        )

    def plot(self, ax: Axes | None = None, *, name: str | None = None, **style: Any) -> Axes:
        """A quantity over time: mean, standard deviation, extremes, and the members that were kept.

        Args:
            name: The quantity; by default the first one.
            **style: Properties of the line of the mean, such as ``color`` and ``lw``.

        Raises:
            IntegratorError: The name is unknown, or `ax` is no axes.

        Example:
            >>> import bseries as bs
            >>> starts = [[0, 1], [0, 1.1], [0, 1.2]]
            >>> axes = bs.ensemble("rk4", bs.scene("pendulum"), h=0.1, steps=20, y0=starts, keep=2).plot()
            >>> axes.get_ylabel(), len(axes.lines)
            ('energy', 3)
        """
        name = self.names[0] if name is None else name
        if name not in self.names:
            raise IntegratorError(f"name must be one of {', '.join(self.names)}, but was {name!r:.60}")
        mean, std = self.mean[name], self.std[name]
        with drawing(ax, IntegratorError) as axes:
            draw_band(axes, self.t, self.minimum[name], self.maximum[name], "minimum to maximum", LIGHT)
            draw_band(axes, self.t, mean - std, mean + std, "mean ± std")
            for k, member in enumerate(self.series[name]):
                label = "a member" if k == 0 else "_"
                axes.plot(self.t, member, color=GREY, linewidth=0.4, label=label)
            axes.plot(self.t, mean, **of_line(style, color=BLUE, label="mean"))
            draw_legend(axes)
            write_title(axes, f"{self._about}: {self.meta['members']:,} members")
            kind = self.meta["change"][self.names.index(name)]
            axes.set(xlabel=axis_label("t"), ylabel=f"{kind} change of {name}" if kind else name)
        return axes

    def to_pandas(self) -> DataFrame:
        """A ``pandas.DataFrame`` by time, with columns (quantity, statistic).

        Raises:
            IntegratorError: pandas is not installed.
        """
        pandas = optional_module("pandas", "to_pandas")
        columns = {(name, key): getattr(self, key)[name] for name in self.names for key in STATISTICS}
        columns[("count", "")] = self.count
        return pandas.DataFrame(columns, index=pandas.Index(self.t, name="t"))

    def to_xarray(self) -> Dataset:
        """An ``xarray.Dataset`` of mean, std, minimum, maximum, (quantity, time), and count, (time).

        Raises:
            IntegratorError: xarray is not installed.
        """
        xarray = optional_module("xarray", "to_xarray")
        data: Document = {key: (("quantity", "time"), list(getattr(self, key).values())) for key in STATISTICS}
        data["count"] = ("time", self.count)
        attributes = {"meta": json.dumps(self.meta, ensure_ascii=False)}
        return xarray.Dataset(data, coords={"time": self.t, "quantity": list(self.names)}, attrs=attributes)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write an NPZ file, which replaces an old one only when it is complete.

        Raises:
            IntegratorError: The file cannot be written.
        """
        head = {"kind": KIND, "names": list(self.names), "meta": self.meta}
        write_arrays(path, {"t": self.t, "head": json.dumps(head), **_arrays(self._whole)})


def load_ensemble(path: str | os.PathLike[str]) -> EnsembleResult:
    """Read a file of `EnsembleResult.save`.

    Raises:
        IntegratorError: The file is not that of an ensemble.

    Example:
        >>> import bseries as bs
        >>> import tempfile
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     bs.ensemble("rk4", bs.scene("pendulum"), h=0.1, steps=10, y0=[[0, 1], [0, 2]]).save(f"{folder}/out.npz")
        ...     bs.runs.load_ensemble(f"{folder}/out.npz")
        <EnsembleResult rk4 on pendulum: 2 members, 11 times>
    """
    sentence = f"{shorten(check_path(path, 'path'), 200)} must be the file of an ensemble, but was not"
    with reading(sentence):
        arrays = StoredArrays(os.fspath(path), sentence)
        head = read_json(arrays.read({"head": TEXT})["head"], HEAD, "head")
        if head["kind"] != KIND:
            raise ValueError("it holds something else")
        names, t = head["names"], arrays.read({"t": Form("f", ("times",))})["t"]
        if not len(t) or not np.isfinite(t).all():
            raise ValueError("t must be finite times, but was not")
        if len(head["meta"]["change"]) != len(names):
            raise ValueError(f"meta.change must have an entry for each of {len(names)} quantities, but had not")
        return EnsembleResult(t, names, _block(arrays, {"times": len(t), "quantities": len(names)}), head["meta"])


def _records(result: EnsembleResult) -> Iterator[Document]:
    """Statistics of each quantity; None for numbers that are not finite."""
    for name in result.names:
        mean, std = result.mean[name], result.std[name]
        known = result.count > 0
        yield {
            "what": name,
            "mean_at_start": finite_or_none(mean[0]),
            "mean_at_end": finite_or_none(mean[-1]),
            "std_at_end": finite_or_none(std[-1]),
            "minimum": finite_or_none(result.minimum[name][known].min(initial=np.inf)),
            "maximum": finite_or_none(result.maximum[name][known].max(initial=-np.inf)),
        }


def _notes(result: EnsembleResult) -> Iterator[str]:
    kinds = dict.fromkeys(kind for kind in result.meta["change"] if kind)
    what = f" of {' or '.join(kinds)} changes from each start" if kinds else ""
    yield f"Statistics{what} at {len(result.t):,} times; minimum and maximum are over all of these."
    for failure in result.failures[:MOST_FAILURES]:
        yield f"Run {failure.member} failed: {failure.reason}."
    if len(result.failures) > MOST_FAILURES:
        yield f"{len(result.failures) - MOST_FAILURES:,} more runs failed."


def _statistics(result: EnsembleResult) -> Table:
    """A row for each time."""
    names = [f"{name}_{key}" for name in result.names for key in STATISTICS]
    columns = [getattr(result, key)[name] for name in result.names for key in STATISTICS]

    def rows() -> Iterator[list[float]]:
        for k, (t, count) in enumerate(zip(result.t, result.count, strict=True)):
            yield [float(t), int(count), *(float(column[k]) for column in columns)]

    return Table("", list(map(Column, ["t", "count", *names])), LazyRows(rows, len(result.t)))


def _arrays(block: Block) -> Document:
    failures = json.dumps([failure._asdict() for failure in block.failures])
    return {**block.statistics._asdict(), "series": block.series, "ends": block.ends, "failures": failures}


def _block(arrays: StoredArrays, sizes: Mapping[str, int]) -> Block:
    """Read a block whose arrays have the given lengths."""
    found = arrays.read(BLOCK, sizes)
    if (found["count"] < 0).any():
        raise ValueError("count must be 0 or more, but was not")
    records = read_json(found["failures"], [FAILURE], "failures")
    failures = (
        Failure(r["member"], r["step"], r["t"], None if r.get("y") is None else tuple(r["y"]), r["reason"])
        for r in records
    )
    statistics = Statistics(*(found[name] for name in Statistics._fields))
    return Block(statistics, found["series"], found["ends"], tuple(failures))


def block_folder(path: str | os.PathLike[str], identity: Document) -> str:
    """The folder of finished blocks, created if missing, from which an ensemble with this identity resumes."""
    folder = check_path(path, "checkpoint")
    label = os.path.join(folder, "ensemble.json")
    try:
        os.makedirs(folder, exist_ok=True)
    except OSError as error:
        what = f"checkpoint must be a folder that can be made, but was {shorten(folder, 200)!r}"
        raise IntegratorError(f"{what}: {error.strerror}") from None
    if not os.path.exists(label):
        atomic_write(label, json.dumps(identity, indent=1) + "\n")
    with reading(f"checkpoint must be the folder of an ensemble, but {shorten(label, 200)} is damaged"):
        found = read_json(read_text(label)[0], dict, "content")
    check_identity(found, identity, "the folder of the same ensemble")
    return folder


def load_block(folder: str | None, number: int, sizes: Mapping[str, int]) -> Block | None:
    """A block whose arrays have these lengths; None if it is missing or damaged."""
    with suppress(IntegratorError), reading("a block must be whole"):
        return None if folder is None else _block(StoredArrays(_file(folder, number), ""), sizes)


def save_block(folder: str | None, number: int, block: Block) -> None:
    """Write a block, if there is a folder."""
    if folder is not None:
        write_arrays(_file(folder, number), _arrays(block))


def _file(folder: str, number: int) -> str:
    return os.path.join(folder, f"block-{number:06d}.npz")
