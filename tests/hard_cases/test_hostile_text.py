"""Readers of text: mutations of good texts, and very long texts, end in a result or a sentence.

Nothing is timed: with a reader that is quadratic in the length of its text, these tests take hours.
"""

import json
import random
import warnings

import pytest

import bseries as bs
from bseries.cli.application import Refusal
from bseries.cli.options.values import EXACT, REALS
from bseries.course.answers import check_answers
from bseries.explorer.reading import MOST_CHARACTERS, read_method, read_positive, read_scene
from bseries_base.errors import MOST
from integrators import parse_hamiltonian, parse_scene
from integrators.exact.expressions import parse_expression, parse_number
from integrators.methods import export_tableau, import_tableau
from integrators.methods.exchange.tableaus import FORMATS
from integrators.methods.kinds.files import dumps_method, loads_method
from integrators.scenes.text import loads_scene
from trees import Tree
from trees.hopf import Forest

LONG = 200_000
SERIES = {name: json.dumps(bs.series(name, 3).to_dict()) for name in ("rk4", "sdirk2", "tsit5")}
TABLEAU = {
    name: (lambda text: import_tableau(text, None, fractions=True), export_tableau("bogacki-shampine32", name))
    for name in FORMATS
}
RK4 = bs.RungeKutta([[0, 0], ["1/2", 0]], [0, 1], name="midpoint", reference="Runge")
READERS = {
    **TABLEAU,
    "plain": (import_tableau, "A = [[0, 0], [1/2, 0]]; b = [0, 1]"),
    "trees": (Tree, "[τ,[τ^2,[τ]],[τ]]"),
    "coloured trees": (lambda text: Tree(text, names=("p", "q")), "p[q,q[p^2]]"),
    "level sequences": (Tree, "[0,1,2,2,1]:[0,1,0,1,1]"),
    "Hamiltonians": (parse_hamiltonian, "p1^2/2 + sqrt(p2^2 + 1) - cos(q1 - q2)"),
    "equations": (parse_scene, "p' = -sin(q) - p/10\ndq/dt = p"),
    "blocks": (lambda text: parse_scene("x' = y; y' = -x", blocks=text), "p=y; q=x"),
    "parameters": (lambda text: parse_scene("x' = mu - x^2", parameters=text), "mu=1/2; nu=3"),
    "start": (lambda text: parse_scene("x' = -x; y' = x", start=text), "x=1; y=0.5"),
    "scene files": (
        loads_scene,
        'variables = {p = 2, q = 2}\nterms = [{over = "pairs", hamiltonian = "1/(q_i - q_j)^2"}]\n'
        'hamiltonian = "(p1^2 + p2^2)/2"\nstart = {p = [0, 1], q = ["1/2", 2]}',
    ),
    **{f"series of {name}": (bs.load_series, text) for name, text in SERIES.items()},
    **{
        f"methods in {format}": (lambda text, format=format: loads_method(text, format), dumps_method(RK4, format))
        for format in ("json", "toml")
    },
    "forests": (Forest, "τ·[τ]^2·[τ,[τ]]"),
    "numbers": (lambda text: parse_number(text, names=("mu",)), "mu^2 - root(3,5)^-2*cos(pi/7) + 1e-5"),
    "formulas": (lambda text: parse_expression(text, names=("x", "y")), "sin(x)^2/y - exp(x*y) + cbrt(abs(y))"),
    "answers": (check_answers, "1d = no  # it is symmetric\n14c = cos(2*q)/48 - p^2*cos(q)/24"),
    "steps": (lambda text: EXACT.convert(text, None, None), "2*pi/100"),
    "values": (lambda text: REALS.convert(text, None, None), "1/10, 0.2, sqrt(2)"),
    "explorer's methods": (
        lambda text: read_method(text[:MOST_CHARACTERS]),
        "0 | 0 0\n1/2 | 1/2 0\n | 0 1\ndigits = 15",
    ),
    "explorer's scenes": (lambda text: read_scene(*text.split("@", 1)), "p' = -sin(q); q' = p@p=0; q=-3/2"),
    "explorer's spans": (lambda text: read_positive(text, "span", 20.0, 1e4), "2*pi"),
}
PIECES = (
    *"()[]{}\"'\\,;:=+-*/^.#_ \n\t\x00",
    *(
        "//",
        "**",
        "1e9",
        "e",
        "0",
        "9" * 30,
        "τ",
        "√",
        "sqrt(",
        "root(2,",
        "p",
        "q",
        "A = ",
        "b = ",
        "nan",
        "None",
        "\ud800",
    ),
    *("/*", "#=", '"""', "'''", "1/", "[[", "]]", "CRootOf(x**2 - 2, 1)", "ButcherTableau", "PetscReal", "²", "ﬁ"),
)


def mutated(text, source):
    """A text with one to four changes: pieces cut out, doubled, exchanged, put in, or repeated."""
    for _ in range(source.randint(1, 4)):
        i, j = sorted(source.randrange(len(text) + 1) for _ in range(2))
        j = min(j, i + source.choice((1, 3, 10, len(text))))
        piece = source.choice(PIECES)
        text = source.choice(
            (
                text[:i] + text[j:],
                text[:j] + text[i:j] + text[j:],
                text[:i] + piece + text[j:],
                text[:i] + piece + text[i:],
                text[:i] + piece * source.choice((2, 30, 3000)) + text[i:],
                text[j:] + text[:i],
            )
        )[:LONG]
    return text


def outcome(read, text):
    """Read a text; what is no text of this kind must be refused in a sentence."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return read(text)
        except (*bs.errors, Refusal) as error:
            sentence = str(error)
    assert len(sentence) <= MOST
    assert sentence.isprintable()
    return None


@pytest.mark.parametrize("name", READERS)
def test_mutations_are_read_or_refused(name):
    read, text = READERS[name]
    assert outcome(read, text) is not None
    source = random.Random(name)  # the same mutations in every run
    for _ in range(40):
        outcome(read, mutated(text, source))


REPEATED = (
    *("a", "1", " ", "(", "[", "{", "#", "=", ";", ",", '\\"', "\\'", "1/", "1.", "a ", "A = ", "A=(", "A[", "]["),
    *("√", "/*", "#=", "d ", "CRootOf(", "class ", "c =\n 1\n", "x'=1;", "τ,", "p+", "x=1;", "\n", "(RK1", "1e1", "//"),
    *("name=", "[0,", "p^", "'", '"'),
)
BEGINNINGS = ("", "A = [", "A = {", "ButcherTableau ", "ExplicitRKTableau ", '"', "[", "p' = ", "# 1 1 ", 'name = "')


@pytest.mark.few(12)
@pytest.mark.parametrize("name", READERS)
def test_long_texts_are_read_once(name):
    read, _ = READERS[name]
    for k, piece in enumerate(REPEATED):
        outcome(read, BEGINNINGS[k % len(BEGINNINGS)] + piece * (LONG // len(piece)))


@pytest.mark.parametrize(
    ("format", "text"),
    [
        ("diffrax", "ButcherTableau " + "a" * LONG),
        ("sciml", "ExplicitRKTableau " + "a" * LONG),
        ("petsc", "A = {" + "1" * LONG + "}"),
        ("nodepy", '"' + '\\"' * LONG),
        ("nodepy", "A = [" + "0.5, " * 90_000 + "]; b = [1]"),
    ],
)
def test_long_tableaus_are_refused(format, text):
    with pytest.raises(bs.IntegratorError):
        import_tableau(text, format)


def test_long_scenes_are_refused_before_they_are_read():
    with pytest.raises(bs.IntegratorError, match="hamiltonian must have at most 10,000 characters, but has 4"):
        parse_hamiltonian("+".join(f"p{k}" for k in range(8000)))
    with pytest.raises(bs.IntegratorError, match="equations must be at most 1,000, but were 20,000: write a Scene"):
        parse_scene("\n".join(f"x{k}' = -x{k}" for k in range(20_000)))
    many = parse_scene("\n".join(f"x{k}' = -x{k}" for k in range(300)))
    assert many.dimension == 300


def test_pairs_of_many_sites_are_not_listed():
    text = 'variables = {{p = {0}, q = {0}}}\nterms = [{{over = "{1}", hamiltonian = "1/(q_i - q_j)"}}]'
    assert loads_scene(text.format(200_000, "pairs")).dimension == 400_000
    with pytest.raises(bs.IntegratorError, match="q_i - q_j other than zero"):  # one site is its own neighbour
        loads_scene(text.format(1, "ring"))
