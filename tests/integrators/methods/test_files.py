"""Tableau files: everything comes back equal, and bad files and failed writes do no harm."""

import io
import json
import math
import os
import signal
import stat
import subprocess
import sys
from contextlib import suppress
from fractions import Fraction
from pathlib import Path

import pytest
import sympy
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from integrators import IntegratorError, PartitionedRungeKutta, RungeKutta, StageAlgebra, TableauWarning, load_method
from integrators import method as catalogue_method
from integrators.core import text_files
from integrators.core.text_files import MAX_BYTES, atomic_write, replacing
from integrators.methods.kinds import files as module
from integrators.methods.kinds.files import dumps_method, loads_method, save_method

pytestmark = pytest.mark.minimum

HEUN = RungeKutta([[0, 0], [1, 0]], ["1/2", "1/2"], name="heun2", reference="Heun 1900")
GAUSS2 = RungeKutta([["1/4", "1/4 - sqrt(3)/6"], ["1/4 + sqrt(3)/6", "1/4"]], ["1/2", "1/2"])
ALGEBRA = StageAlgebra([Fraction(1, 6), -1, 1], [[0, Fraction(-1, 12)], [1, Fraction(1, 2)]], [1, Fraction(1, 2)])
METHODS = {
    "rational": HEUN,
    "embedded": RungeKutta([[0, 0], [1, 0]], ["1/2", "1/2"], embedded=[[1, 0], ["1/3", "2/3"]]),
    "algebraic": GAUSS2,
    "symbolic": RungeKutta([["g", 0], ["1-2*g", "g"]], ["c_2", "1-c_2"], parameters=["c_2", "g"], name="Ω ∂"),
    "float": RungeKutta([[0.1, -0.0], [1e-320, 1 / 3]], [0.5, 0.5], embedded=[1.0, 5e-324], warn=False),
    "decimal": RungeKutta([["0.333333"]], ["1.00000"], digits=6, embedded=["1/66"], warn=False),
    "rounded decimal": RungeKutta([["0.333333"]], ["1.00000"], digits=6).to_float(),
    "algebra": RungeKutta.from_algebra(ALGEBRA, name="gauss2", reference="Butcher 1964"),
    "large numbers": RungeKutta([[10**30]], [Fraction(10**30 + 1, 10**30)], warn=False),
    "nodes of their own": RungeKutta([["sqrt(2)"]], [1], c=["sqrt(3)"], warn=False),
    "partitioned": PartitionedRungeKutta(
        {"p": HEUN, "q": RungeKutta.from_algebra(ALGEBRA)}, name="pair", reference="r"
    ),
    "mixed parts": PartitionedRungeKutta({"z": GAUSS2, "a": HEUN, "m": HEUN.to_float()}),
}
FORMATS = ["json", "toml"]


def bits(method):
    """Every stored number of a method, doubles by their bits."""
    if method.algebra is not None:
        return (method.algebra,)
    rows = (*method.A, method.b, method.c, *method.embedded)
    return tuple(v.hex() if isinstance(v, float) else v for row in rows for v in row)


def assert_same(found, method):
    assert found == method
    assert (found.name, found.reference, found.digits, found.names) == (
        method.name, method.reference, method.digits, method.names,
    )  # fmt: skip
    assert found.domain == method.domain
    assert [bits(part) for part in found.partitions] == [bits(part) for part in method.partitions]
    assert [part.name for part in found.partitions] == [part.name for part in method.partitions]


@pytest.mark.filterwarnings("ignore::integrators.TableauWarning")
@pytest.mark.parametrize("format", FORMATS)
@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
def test_saved_methods_come_back(tmp_path, method, format):
    path = tmp_path / f"method.{format}"
    save_method(method, path)
    assert_same(load_method(path), method)
    assert_same(load_method(str(path)), method)
    with path.open("rb") as file:
        assert_same(load_method(file), method)
    assert_same(load_method(io.StringIO(path.read_text("utf-8"))), method)
    assert os.listdir(tmp_path) == [path.name]


fractions = st.fractions()
floats = st.floats(allow_nan=False, allow_infinity=False, max_value=1e100, min_value=-1e100)
formulas = st.recursive(
    st.one_of(st.fractions(max_denominator=99).map(str), st.sampled_from(["a", "b", "sqrt(2)", "cbrt(7)"])),
    lambda inner: st.one_of(
        st.tuples(inner, st.sampled_from("+-*"), inner).map(lambda t: f"({t[0]}){t[1]}({t[2]})"),
        inner.map(lambda t: f"1/(({t})^2 + 1)"),
        inner.map(lambda t: f"sqrt(({t})^2 + 3)"),
    ),
    max_leaves=3,
)


@st.composite
def methods(draw, entries, **keywords):
    s = draw(st.integers(1, 3))
    row = st.lists(entries, min_size=s, max_size=s)
    A, b, c, embedded = (
        draw(x) for x in (st.lists(row, min_size=s, max_size=s), row, st.none() | row, st.lists(row, max_size=2))
    )
    name = draw(st.none() | st.text(st.characters(exclude_categories=["Cs", "Cc", "Zl", "Zp"]), max_size=5))
    digits = draw(st.none() | st.integers(1, 40)) if "parameters" not in keywords else None
    try:
        return RungeKutta(A, b, c, embedded=embedded, name=name, digits=digits, warn=False, **keywords)
    except IntegratorError as error:
        assume("bits" not in str(error))  # formulas may grow beyond what is read at all
        raise


@pytest.mark.filterwarnings("ignore::integrators.TableauWarning")
@settings(suppress_health_check=[HealthCheck.too_slow], deadline=None)
@given(st.one_of(methods(fractions), methods(floats)), st.sampled_from(FORMATS))
def test_numbers_survive(method, format):
    assert_same(loads_method(dumps_method(method, format), format), method)


@pytest.mark.filterwarnings("ignore::integrators.TableauWarning")
@settings(max_examples=40, suppress_health_check=[HealthCheck.too_slow], deadline=None)
@given(methods(formulas, parameters=["a", "b"]), st.sampled_from(FORMATS))
def test_formulas_survive(method, format):
    assert_same(loads_method(dumps_method(method, format), format), method)


def test_numbers_in_files_are_the_decimals_they_spell():
    method = loads_method('{"A": [[0, 0], [0.1, 0]], "b": [3e-1, "7/10"]}', "json")
    assert (method.A[1][0], method.b[0]) == (Fraction(1, 10), Fraction(3, 10))
    method = loads_method("A = [[0, 0], [0.1, 0]]\nb = [3e-1, 0.7]", "toml")
    assert (method.A[1][0], method.b) == (Fraction(1, 10), (Fraction(3, 10), Fraction(7, 10)))
    assert method.domain == "QQ"
    rounded = loads_method('{"domain": "float", "A": [["1/3"]], "b": [1]}', "json")
    assert (rounded.A, rounded.domain) == (((1 / 3,),), "float")


def test_published_decimals_stay_readable():
    text = dumps_method(RungeKutta([["0.161"]], [1], digits=3), "json")
    assert json.loads(text)["A"] == [["0.161"]]
    assert '"A": [\n    ["0.161"]\n  ]' in text


def test_the_order_of_blocks_in_a_file_does_not_matter():
    euler = {"p": {"A": [[1]], "b": [1]}, "q": {"A": [[0]], "b": [1]}}
    texts = [json.dumps({"partitions": {name: euler[name] for name in names}}) for names in ("pq", "qp")]
    read = [loads_method(text, "json") for text in texts]
    assert read[0] == read[1] == catalogue_method("symplectic-euler-p")
    assert read[1].names == ("p", "q")


def test_parameters_of_a_partitioned_file_hold_in_all_parts():
    text = '{"parameters": ["g"], "partitions": {"p": {"A": [["g"]], "b": [1]}, "q": {"A": [["1-g"]], "b": [1]}}}'
    method = loads_method(text, "json")
    assert isinstance(method, PartitionedRungeKutta)
    assert method.parameters == ("g",)
    assert ((1 - sympy.Symbol("g"),),) == method.partitions[1].A


def test_loading_warns_of_issues(tmp_path):
    path = tmp_path / "m.json"
    path.write_text('{"A": [[0, 0], ["1/3", 0]], "b": [0, 1], "c": [0, "1/2"]}')
    with pytest.warns(TableauWarning, match=r"row 2 of A sums to 1/3, but c\[2\] is 1/2") as caught:
        load_method(path)
    assert caught[0].filename == __file__


def test_format_is_seen_from_content_where_there_is_no_suffix(tmp_path):
    for format in FORMATS:
        path = tmp_path / "method"
        path.write_text(dumps_method(HEUN, format))
        assert load_method(path) == HEUN
        assert load_method(io.BytesIO(path.read_bytes())) == HEUN
    (tmp_path / "bom.json").write_bytes(b"\xef\xbb\xbf" + dumps_method(HEUN, "json").encode())
    assert load_method(tmp_path / "bom.json") == HEUN


BAD_JSON = {
    "": "content must be JSON, but was not at line 1, column 1",
    '{"A": [[0, 0],\n  [1, 0]': "content must be JSON, but was not at line 2, column 9",
    "[1, 2]": r"content must be a table of keys and values, but was \[1, 2\]",
    "null": "content must be a table of keys and values, but was None",
    "{}": "content must have the key A, but had none",
    '{"A": [[0]]}': "content must have the key b, but had A",
    '{"A": [[0]], "b": [1], "nmae": "x"}': r"had 'nmae'; did you mean name\?",
    '{"A": [[0]], "b": [1], "b": [1]}': "keys must be unique, but 'b' was repeated",
    '{"A": [[NaN]], "b": [1]}': "numbers must be finite, but one was NaN",
    '{"A": [[0]], "b": [-Infinity]}': "numbers must be finite, but one was -Infinity",
    '{"A": [["nan"]], "b": [1]}': r"A\[1\]\[1\] must be a formula, but 'nan' is not finite",
    '{"A": [[1e9999999999999999999999]], "b": [1]}': "exponents of reasonable size",
    '{"A": [[1e99999]], "b": [1]}': "more than 4000 digits",
    '{"A": [[%s]], "b": [1]}' % ("9" * 5000): "content must be JSON of reasonable size",
    '{"A": [["x"]], "b": [1]}': r"A\[1\]\[1\] must be a formula, but 'x' has the unknown name",
    '{"A": [["__import__(\'os\')"]], "b": [1]}': r"A\[1\]\[1\] must be a formula",
    '{"A": [[true]], "b": [1]}': r"A\[1\]\[1\] must be a real number or a formula, but was True",
    '{"A": [[null]], "b": [1]}': r"A\[1\]\[1\] must be a real number or a formula, but was None",
    '{"A": [[0, 0]], "b": [1]}': "A must be square",
    '{"A": 5, "b": [1]}': "A must be a sequence, but was 5",
    '{"A": {"0": 1}, "b": [1]}': "A must be a sequence",
    '{"A": [[0]], "b": [1], "name": 5}': "name must be text, but was 5",
    '{"A": [[0]], "b": [1], "digits": "x"}': "digits must be an integer",
    '{"A": [[0]], "b": [1], "parameters": "x"}': "parameters must be a sequence, but was 'x'",
    '{"A": [[0]], "b": [1], "parameters": 5}': "parameters must be a sequence, but was 5",
    '{"A": [[0]], "b": [1], "domain": "QQ"}': "domain must be float or left out, but was 'QQ'",
    '{"A": [[%s]], "b": [1], "domain": "float"}' % ("9" * 400): r"A\[1\]\[1\] must be a finite number, but was inf",
    '{"A": [[0]], "b": [1], "algebra": {}}': "a method given by an algebra must have the keys .* but had 'A'",
    '{"algebra": {"A": [[0]], "b": [1]}}': "algebra must have the key polynomial",
    '{"algebra": {"polynomial": ["sqrt(2)", 1], "A": [[0]], "b": [1]}}': "polynomial must hold integers and fractions",
    '{"algebra": {"polynomial": [0, 0, 1], "A": [[0, 0], [0, 0]], "b": [1, 1]}}': "polynomial must have simple roots",
    '{"algebra": [1]}': "algebra must be a table",
    '{"partitions": [1]}': r"partitions must map names to tableaux, but was \[1\]",
    '{"partitions": {"p": {"A": [[0]], "b": [1]}}}': "partitions must map two or more names",
    '{"partitions": {"p": {"A": [[0]], "b": [1]}, "q": {"A": [[0, 1]], "b": [1]}}}': "partition q: A must be square",
    '{"partitions": {"p": 1, "q": 2}}': "partition p: a tableau must be a table",
    '{"partitions": {"p": {"partitions": {}}, "q": 2}}': "partition p: a tableau must have the keys",
    '{"partitions": {}, "A": [[0]]}': "a partitioned method must have the keys .* but had 'A'",
    "[" * 100_000: "nesting must be flat, but was too deep",
}  # fmt: skip


@pytest.mark.parametrize(("text", "message"), BAD_JSON.items(), ids=range(len(BAD_JSON)))
def test_bad_json(tmp_path, text, message):
    path = tmp_path / "bad.json"
    path.write_text(text)
    with pytest.raises(IntegratorError, match=message) as caught:
        load_method(path)
    assert "bad.json" in str(caught.value)
    assert len(str(caught.value)) < 400


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("A = [[0]\nb = [1]", r"content must be TOML, but was not: .*line 2, column 1"),
        ("A = [[0]]\nb = [nan]", r"b\[1\] must be a formula, but 'NaN' is not finite"),
        ("A = [[inf]]\nb = [1]", r"A\[1\]\[1\] must be a formula, but 'Infinity' is not finite"),
        ("A = [[1979-05-27]]\nb = [1]", r"A\[1\]\[1\] must be a real number or a formula, but was datetime"),
        ("A = [[1e9999999999999999999999]]\nb = [1]", "exponents of reasonable size"),
        ("", "content must have the key A, but had none"),
        ("A = " + "[" * 100_000, "nesting must be flat|content must be TOML"),
        (".".join("a" * 100_000) + " = 1", "content must have keys of at most 100 parts, but one has more"),
        ("[" + " . ".join("a" * 1000) + "]", "content must have keys of at most 100 parts, but one has more"),
        (".".join(['"\\""', "'.'"] * 500) + " = 1", "content must have keys of at most 100 parts, but one has more"),
        ('A = {x = """ " """, ' + ".".join("a" * 1000) + " = 1}", "content must have keys of at most 100 parts"),
        ("".join(f"[{'a.' * 98}b{k}]\n" for k in range(1100)), "content must have at most 100000 parts in all keys"),
        ("".join(f"{'a . ' * 98}b{k} = 1\n" for k in range(1100)), "content must have at most 100000 parts in all"),
        ("A = [" + f"{{{'a.' * 98}b = 1}}, " * 1100 + "]", "content must have at most 100000 parts in all keys"),
        ("name = [" + "0.5, " * 100_000 + "]", "content must have the key A, but had name"),
        ("A = " + "1" * 10**6, "numbers must have at most 4300 digits in a row, but one has more"),
        (f"name = '''{'a.' * 1000}'''  # {'a.' * 1000}", "content must have the key A, but had name"),
        (f'name = "{"0.1." * 1000}"', "content must have the key A, but had name"),
    ],
    ids=range(18),
)
def test_bad_toml(text, message):
    with pytest.raises(IntegratorError, match=message):
        loads_method(text, "toml", source="bad.toml")


def test_unreadable_files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # messages shorten long paths
    with pytest.raises(IntegratorError, match=r"none\.json must be a readable file, but was not: No such file"):
        load_method("none.json")
    with pytest.raises(IntegratorError, match="must be a readable file, but was not: Is a directory"):
        load_method(".")
    with pytest.raises(IntegratorError, match="source must be a path or an open file, but was 5"):
        load_method(5)  # type: ignore[arg-type]
    closed = io.StringIO()
    closed.close()
    with pytest.raises(IntegratorError, match="input must be a readable file, but was not: I/O operation on closed"):
        load_method(closed)
    with pytest.raises(IntegratorError, match="must be a readable file, but was not: embedded null"):
        load_method("a\0b.json")
    path = tmp_path / "binary.json"
    path.write_bytes(bytes(range(256)))
    with pytest.raises(IntegratorError, match=r"binary\.json must be UTF-8 text, but byte 129 was 0x80"):
        load_method(path)
    path.write_bytes(b"{\0}")
    with pytest.raises(IntegratorError, match="must be text, but was binary"):
        load_method(path)
    path.write_bytes(b" " * (MAX_BYTES + 1))
    with pytest.raises(IntegratorError, match="must have at most 10000000 bytes, but has more"):
        load_method(path)


def test_formats(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # messages shorten long paths
    for call in (lambda: loads_method("", "yaml"), lambda: dumps_method(HEUN, "yaml")):
        with pytest.raises(IntegratorError, match="format must be json or toml, but was yaml"):
            call()
    with pytest.raises(IntegratorError, match=r"path must end in .json or .toml, but was method.txt"):
        save_method(HEUN, "method.txt")
    save_method(HEUN, "method.txt", "toml")
    assert load_method("method.txt") == HEUN
    save_method(HEUN, tmp_path / "method.JSON")
    assert load_method(tmp_path / "method.JSON") == HEUN
    with pytest.raises(IntegratorError, match=r"method must be a RungeKutta, .* or a method with memory, but was 5"):
        save_method(5, tmp_path / "x.json")  # type: ignore[arg-type]
    assert sorted(os.listdir(tmp_path)) == ["method.JSON", "method.txt"]


def test_writing_replaces_at_once_and_keeps_permissions(tmp_path):
    path = tmp_path / "data.bin"
    atomic_write(path, "τ")
    assert path.read_bytes() == "τ".encode()
    path.chmod(0o640)
    atomic_write(path, b"\0")
    assert path.read_bytes() == b"\0"
    assert stat.S_IMODE(path.stat().st_mode) == 0o640
    link = tmp_path / "link"
    link.symlink_to(path)
    atomic_write(link, "linked")
    assert link.is_symlink()
    assert path.read_text() == "linked"
    atomic_write(os.devnull, "x")
    assert not Path(os.devnull).is_file()


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # of a file that is closed later
@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
def test_interrupts_at_any_line_leave_no_file(tmp_path):
    """One signal for each line of the file's code that writing runs."""
    path, lines, hit = tmp_path / "a.txt", 0, 1

    def count(frame, event, _):
        nonlocal lines
        lines += event == "line"
        if lines == hit and event == "line":
            os.kill(os.getpid(), signal.SIGINT)
        return count

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    path.write_text("old")
    try:
        while lines >= hit - 1:
            lines = 0
            sys.settrace(lambda frame, *_: count if frame.f_code.co_filename == text_files.__file__ else None)
            with suppress(KeyboardInterrupt):
                atomic_write(path, "new")
            sys.settrace(None)
            assert os.listdir(tmp_path) == ["a.txt"]
            assert path.read_text() in ("old", "new")
            hit += 1
    finally:
        sys.settrace(None)
        signal.signal(signal.SIGINT, before)
    assert hit > 40


@pytest.mark.parametrize("error", [KeyboardInterrupt, MemoryError, OSError(28, "No space left on device")])
def test_interrupted_writing_leaves_the_old_file_alone(tmp_path, monkeypatch, error):
    path = tmp_path / "method.json"
    path.write_text("old")

    def fail(*_):
        raise error

    monkeypatch.setattr(os, "fsync", fail)
    expected = IntegratorError if isinstance(error, OSError) else error
    with pytest.raises(expected, match="No space left" if isinstance(error, OSError) else None):
        save_method(HEUN, path)
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["method.json"]


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
def test_what_a_killed_process_leaves_goes_with_the_next_write(tmp_path):
    path = tmp_path / "file"
    script = (
        "import os, sys; from integrators.core.text_files import replacing\n"
        "with replacing(sys.argv[1]) as file:\n"
        "    file.write(b'half'); file.flush(); os.kill(os.getpid(), 9)\n"
    )
    for _ in range(2):
        subprocess.run([sys.executable, "-c", script, path], check=False)
        (left,) = os.listdir(tmp_path)  # that of the process before is gone
    others = f"{left[:10]}.csv", "other.tmp"
    for name in others:
        (tmp_path / name).touch()
    atomic_write(path, "whole")
    assert sorted(os.listdir(tmp_path)) == sorted([*others, "file"])
    assert path.read_text() == "whole"


def test_two_processes_write_the_same_file(tmp_path):
    path = tmp_path / "file"
    with replacing(path) as first:
        first.write(b"first")
        atomic_write(path, "second")
        assert path.read_text() == "second"
        assert len(os.listdir(tmp_path)) == 2
    assert path.read_text() == "first"
    assert os.listdir(tmp_path) == ["file"]


def test_unwritable_targets(tmp_path):
    with pytest.raises(IntegratorError, match="must be a writable file, but was not: No such file or directory"):
        save_method(HEUN, tmp_path / "missing" / "method.json")
    (tmp_path / "folder.json").mkdir()
    with pytest.raises(IntegratorError, match="must be a writable file, but was not: Is a directory"):
        save_method(HEUN, tmp_path / "folder.json")
    with pytest.raises(IntegratorError, match="must be a writable file, but was not: File name too long"):
        save_method(HEUN, tmp_path / ("x" * 300 + ".json"))
    with pytest.raises(IntegratorError, match=r"must be a writable file, but was not: .*surrogates not allowed"):
        atomic_write(tmp_path / "text.json", "\ud800")
    assert os.listdir(tmp_path) == ["folder.json"]


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_read_only_targets(tmp_path):
    path = tmp_path / "method.json"
    path.write_text("old")
    path.chmod(0o400)
    with pytest.raises(IntegratorError, match="Permission denied"):
        save_method(HEUN, path)
    assert path.read_text() == "old"


def test_public_names():
    assert module.atomic_write is atomic_write
    assert math.isfinite(MAX_BYTES)


ROUNDED = [["0.292893218813452", 0], ["0.707106781186548", "0.292893218813452"]]


@pytest.mark.parametrize("format", ["json", "toml"])
def test_digits_of_a_reader_take_the_place_of_those_in_the_file(tmp_path, format):
    path = tmp_path / f"method.{format}"
    for digits in (None, 12):
        save_method(RungeKutta(ROUNDED, ["1/2", "1/2"], digits=digits), path)
        assert load_method(path).digits == digits
        assert load_method(path, digits=15) == RungeKutta(ROUNDED, ["1/2", "1/2"], digits=15)
    part = RungeKutta(ROUNDED, ["1/2", "1/2"])
    save_method(PartitionedRungeKutta({"p": part, "q": part}), path)
    assert [x.digits for x in load_method(path, digits=15).partitions] == [15, 15]


def test_digits_of_exact_files_and_no_digits_are_refused(tmp_path):
    path = tmp_path / "method.json"
    save_method(catalogue_method("gauss2"), path)
    with pytest.raises(IntegratorError, match="digits must be left out for a method given by an algebra, but was 9"):
        load_method(path, digits=9)
    path.write_text(dumps_method(HEUN, "json"))
    with pytest.raises(IntegratorError, match="digits must be an integer from 1 to 1000, but was 0"):
        load_method(path, digits=0)
