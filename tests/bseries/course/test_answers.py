"""Answers to the exercises: right and wrong ones to every question, equivalent forms, refusals."""

from __future__ import annotations

import json
import re
import time
from pathlib import Path
from typing import Any

import pytest

import bseries as bs
from bseries.course import questions
from bseries.course.answers import answer_template, check_answers
from bseries.course.questions import QUESTIONS

HERE = Path(__file__).parent
RIGHT = (HERE / "right_answers.txt").read_text(encoding="utf-8")
WRONG = dict(
    line.split("->") for line in (HERE / "wrong_answers.txt").read_text(encoding="utf-8").splitlines() if "=" in line
)
SHEET = (Path(questions.__file__).parent / "exercises.md").read_text(encoding="utf-8")
KEYS = [question.key for question in QUESTIONS]
MOST_SECONDS = 5.0
"""CPU time that one answer may take, of which most is SymPy's import."""


def only(text: str) -> Any:
    """The verdict on one answer."""
    (answer,) = check_answers(text).answers
    return answer


def test_the_answers_of_the_solutions_are_right():
    checked = check_answers(RIGHT)
    assert [answer.key for answer in checked.answers] == KEYS
    assert [answer for answer in checked.answers if answer.verdict != "right"] == []
    assert checked.all_right
    assert checked.open == ()


@pytest.mark.parametrize(("text", "remark"), WRONG.items(), ids=[text.split(" ")[0] for text in WRONG])
def test_a_wrong_answer_to_each_question(text, remark):
    answer = only(text)
    assert answer.verdict == "wrong"
    assert remark.strip() in answer.remark


def test_there_is_a_wrong_answer_to_each_question():
    assert [text.partition("=")[0].strip() for text in WRONG] == KEYS


@pytest.mark.parametrize(
    ("text", "remark"),
    [
        ("7a = f'f (2*theta - 1)/2", "equal exactly"),
        ("7a = -(1/2 - theta)*f'(f)", "equal exactly"),
        ("7a = f’f theta − 1/2 f’f", "equal exactly"),
        ("7a = (θ − 1/2)·f′f", "equal exactly"),
        ("\ufeff4b = 3a^2/8", "equal exactly"),
        ("4a = 2a + 3a^2/8 − a^2×cos(2θ)/2 + a^2⋅cos(4θ)/8", "equal exactly"),
        ("13b = 4.9969e7", "equal to 3 digits"),
        ("9b = -f'(f'(f))/6 - f''( f , f )/6", "equal exactly"),
        ("4a = 2*a + a^2*(3 - 4*cos(2*theta) + cos(4*theta))/8", "equal exactly"),
        ("4a = 2*a + (a*(1 - cos(theta)^2))^2", "equal exactly"),
        ("14b = (1 - cos(2*q) + 2*p^2*cos(q))/24", "equal exactly"),
        ("14c = 7 - p^2*cos(q)/24 - sin(q)^2/24", "equal exactly"),
        ("2a = p + q - log(p*q^2)", "equal exactly"),  # derivatives are compared
        ("3c = (P/exp(Q))^2/2 - 1/exp(Q)", "equal exactly"),
        ("5b = log(I) - (I/h - 1)*log(1 - h/I) - 1", "equal to 50 digits at 20 random points"),
        ("8b = asin(h*omega/2/sqrt(1 + h^2*omega^2/4))*2/h", "equal to 50 digits at 20 random points"),
        ("13a = (1 - h^2/2 + h^4/24)^2 + (h - h^3/6)^2", "equal exactly"),
        ("1a = 1.0, 1.5, 8/3, 31/6", "equal exactly"),
        ("7c = sqrt(1/4)", "equal exactly"),
        ("16b = -pi*sin(pi/6)/120", "equal exactly"),
        ("13b = 49969000", "equal to 3 digits"),
        ("13c = 1.10517", "equal to 4 digits"),
        ("9c = 0, 0, 0; 1/2, 0, 0; 1/2, 0, 0; 0, 1/2, 1/2", "tested on all trees with up to 6 nodes"),
        ("12c = 1/8, 0; 1/4, 3/8; 1/4, 3/4", "tested on all trees with up to 6 nodes"),
        ("1d = No # by symmetry", ""),
        ("1d = No.", ""),
        ("12b = no, yes, yes, no, yes, no.", ""),
        # as the sheets print it
        ("1b = y² + ¼h²y⁴ + ⅛h⁴y⁶", "equal exactly"),
        ("2a = p − ln p + q − 2 ln q", "equal exactly"),
        ("2a = p - ln(p) + q - 2ln(q)", "equal exactly"),
        ("3a = r (p₂ cos φ − p₁ sin φ)", "equal exactly"),
        ("3b = ½(p_r² + p_φ²/r²) − 1/r", "equal exactly"),
        ("3c = ½P² e^(−2Q) − e^(−Q)", "equal exactly"),
        ("3c = P^2*e^(-2*Q)/2 - e^-Q", "equal exactly"),
        ("4a = 2a + a² sin⁴θ", "equal exactly"),
        ("5b = (I ln I − (I−h) ln(I−h))/h − 1", "equal exactly"),
        ("6a = sin x cos z + sin y cos x + sin z cos y", "equal exactly"),
        ("7b = (θ² − θ + ⅓) f'f'f + (½θ² − ½θ + 1/12) f″(f,f)", "equal exactly"),
        ("7c = 1/√4", "equal exactly"),
        ("8b = (2/h) arctan(hω/2)", "equal exactly"),
        ("13b = 5.00·10⁷", "equal to 3 digits"),
        ("13c = e^0.1", "equal to 4 digits"),
        ("14c = (cos 2q − 2p² cos q)/48", "equal exactly"),
        ("16a = 6πε", "equal exactly"),
        ("9c = 0, 0; ½, 0; 0, 1", "tested on all trees with up to 6 nodes"),
        (
            "12e = 1/(2-∛2)/2, 0, 0; 1/(2-∛2), 1/(2-∛2)/2, 0; 1/(2-∛2), 1/(2-∛2), (1-2/(2-∛2))/2; 1/(2-∛2), 1/(2-∛2), "
            "1-2/(2-∛2)",
            "tested on all trees with up to 6 nodes",
        ),
        ("6c = YES,no", ""),
    ],
)
def test_equivalent_answers_are_right(text, remark):
    answer = only(text)
    assert (answer.verdict, answer.remark) == ("right", remark)


@pytest.mark.parametrize(
    "text",
    [
        "14a = -p*sin(q)/2 + 10^-40*p",  # not told from the truth in doubles
        "14c = 7 - p^2*cos(q)/24 - sin(q)^2/24 + 10^-40*p",
        "14a = -p*sin(q)/2 + 1",
        "14a = -p*q/2",
        "14a = -sin(q)*sqrt(p^2)/2",
        "4c = 0.16666666666666667",
        "16b = -0.0130899693899575",
        "13b = 4.97e7",
        "13c = -1.105",
        "5b = log(abs(I))",
        "12e = 1/(2-cbrt(2))/2, 0, 0; 1/(2-cbrt(2)), (1-2/(2-cbrt(2)))/2, 0; 1/(2-cbrt(2)), (1-2/(2-cbrt(2))), "
        "1/(2-cbrt(2))/2; 1/(2-cbrt(2)), (1-2/(2-cbrt(2))), 1/(2-cbrt(2))",  # the triple jump is symmetric
    ],
)
def test_what_is_nearly_right_is_not(text):
    assert only(text).verdict != "right"


@pytest.mark.parametrize(
    ("text", "remark"),
    [
        ("4c = 0.1667", "agrees to 4 digits"),
        ("4c = 0.166666666666667", "agrees to 15 digits"),
        ("15b = 1/6, 0.0138889", "entry 2: agrees to 6 digits"),
        ("15a = 0.25*gamma - 0.0416666666666667, 1/12", "entry 1: agrees to 15 digits"),
        ("14c = 0.0208333*(cos(2*q) - 2*p^2*cos(q)) + 7", "agrees to 5 digits"),
        ("9b = -0.166667*(f''(f,f) + f'f'f)", "agrees to 5 digits"),
        ("11a = 0.75, -0.416666666666667; 0.75, 0.25; 0.75, 0.25", "is right to 15 digits"),
        ("12e = 0.675603595979829, 0, 0; 1.35120719195966, 0.675603595979829, 0; 1.35120719195966, 1.35120719195966, "
         "-0.851207191959658; 1.35120719195966, 1.35120719195966, -1.70241438391932", "is right to 15 digits"),
    ],
)  # fmt: skip
def test_rounded_answers_are_told_that_an_exact_one_is_asked_for(text, remark):
    answer = only(text)
    assert (answer.verdict, answer.remark) == ("wrong", f"{remark}, but an exact answer is asked for")


@pytest.mark.parametrize(
    ("text", "remark"),
    [
        ("4c = 0.1677", "differs"),
        ("4c = 0.17", "differs"),
        ("15a = 0.24*gamma - 0.0416666666666667, 1/12", "entry 1: differs"),
        ("14c = -0.0208333*(cos(2*q) - 2*p^2*cos(q))", "differs"),
        ("11a = 0.75, -0.416666666676667; 0.75, 0.25; 0.75, 0.25", "is another method"),
        (
            "12e = 0.6756, 0, 0; 1.3600, 0.6756, 0; 1.3600, 1.3600, -0.8512; 1.3600, 1.3600, -1.7024",
            "has order 0, not 3",
        ),
    ],
)
def test_digits_that_are_wrong_are_not_taken_for_rounded_ones(text, remark):
    answer = only(text)
    assert answer.verdict == "wrong"
    assert answer.remark.startswith(remark)
    assert "exact" not in answer.remark


@pytest.mark.parametrize(
    ("text", "remark"),
    [
        (
            "14a = lg(p)",
            "(known: p, q, h, sqrt, cbrt, root, sin, cos, tan, asin, acos, atan, sinh, cosh, tanh, asinh, "
            "acosh, atanh, exp, log, erf, pi)",
        ),
        ("4b = 3/8a^2", "'3/8a^2' has 'a' where an operator is expected"),  # (3/8) a² or 3/(8a²)?
        ("3c = e^-2Q", "has 'Q' where an operator is expected"),
        ("8b = atan h*omega/2", "has 'h' where '(' is expected"),
        ("1d = no, by symmetry", "1d must be yes or no; but was 'no, by symmetry'"),
        ("14a = 9**9**9", "has a power of more than 4000 digits"),
        ("14a = " + "exp(" * 60 + "p" + ")" * 60, "more than 6 roots, powers or functions within each other"),
        ("14a = " + "(" * 200 + "p" + ")" * 200, "is nested more than 100 deep"),
        ("14a = " + "+".join(["p"] * 300), "14a must have at most 500 characters, but had 599"),
        ("14a = 1/0", "divides by zero"),
        ("14a = x", "has the unknown name 'x'"),
        ("14a = __import__('os').getcwd()", "must be a formula"),
        ("14a = [p for p in q]", "must be a formula"),
        ("1a = 1, 2", "1a must be 4 numbers, separated by commas, exactly, but had 2 entries"),
        ("4c = p", "has the unknown name 'p'"),
        ("6c = yes", "6c must be yes or no for each"),
        ("1d = maybe", "1d must be yes or no; but was 'maybe'"),
        ("7a = f'f*f'f", "must be a sum of numbers times elementary differentials"),
        ("7a = f''(f)", "has a derivative of order 2 with 1 argument"),
        ("7a = f'", "where '(' is expected"),
        ("7a = " + "f'" * 30 + "f", "more than 12 factors f"),
        ("7a = x*f'f", "'x*f'(f)' has the unknown name 'x'"),
        ("9c = 1, 2; 3", "s + 1 rows of s entries"),
        ("9c = def step(f, y, h): return y", "9c must be a tableau"),
        ("12e = " + "; ".join([", ".join(f"sqrt({n})" for n in (2, 3, 5, 7, 11))] * 6), "a field of degree 16"),
    ],
)
def test_answers_that_cannot_be_read_get_a_sentence_and_take_no_time(text, remark):
    start = time.process_time()
    answer = only(text)
    assert answer.verdict == "unreadable"
    assert remark in answer.remark
    assert "\n" not in answer.remark
    assert time.process_time() - start < MOST_SECONDS


@pytest.mark.few(5)
@pytest.mark.parametrize(
    "formula",
    [
        "exp(exp(exp(exp(exp(exp(p))))))",
        "p^p^p^p^p",
        "(p+q+h)^100*(p-q+h)^100*(2*p-q+h)^100",
        "(p+q+h)^99*(p-q)^99*(p+q+h) - (p+q+h)^100*(p-q)^98*(p-q) - p*sin(q)/2",
        "+".join(f"sin({k}*q)" for k in range(40)),
        "tan(q+tan(q+tan(q+tan(q))))",
        "*".join(f"sin({k}*p+q)" for k in range(35)),
        "9" * 490,
    ],
)
@pytest.mark.parametrize("key", ["14a", "14c"])  # 14c is compared up to a constant
def test_large_formulas_are_judged_in_no_time(key, formula):
    start = time.process_time()
    assert only(f"{key} = {formula}").verdict in ("right", "wrong")
    assert time.process_time() - start < MOST_SECONDS


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("a" * 10**6, "answers must have at most 100,000 characters, but had 1,000,000"),
        ("1d no", "line 1 must be key = answer, as in 1d = no, but was '1d no'"),
        ("# all\n\n= no", "line 3 must be key = answer"),
        ("17a = 1", "keys must be of 1a to 16c, but line 1 had '17a'; did you mean"),
        ("1d = no\n1d = yes", "keys must have one answer, but line 2 gave another one to 1d"),
        ("", "answers must hold an answer such as 1d = no, but held none"),
        (answer_template(), "answers must hold an answer"),
        (3, "answers must be text, but were 3"),
    ],
    ids=range(8),
)
def test_files_that_cannot_be_read_get_a_sentence(text, sentence):
    with pytest.raises(bs.SeriesError, match=re.escape(sentence)):
        check_answers(text)


def test_the_template_has_every_key_once_and_takes_answers():
    lines = [line for line in answer_template().splitlines() if not line.startswith("#")]
    assert [line.removesuffix(" =") for line in lines if line] == KEYS
    filled = answer_template().replace("\n4c =\n", "\n4c = 1/6\n")
    assert check_answers(filled + "1d = no\n").right == 2


def test_the_sheet_asks_what_is_checked():
    """Every exercise has a solution, and names its keys after **Answers**."""
    headings = re.findall(r"^## Exercise (\d+): .+ \{#ex(\d+)\}$", SHEET, re.MULTILINE)
    assert headings == [(str(n), str(n)) for n in range(1, 17)]
    asked = re.findall(r"^\*\*Answers.*?\n\n", SHEET, re.MULTILINE | re.DOTALL)
    assert re.findall(r"`(\d+[a-e])`:", "".join(asked)) == KEYS
    assert SHEET.count("::: {.solution}\n") == SHEET.count("\n:::\n") == 16


def test_the_steps_on_the_sheet_are_those_that_are_checked():
    for step, code in zip(questions.STEPS, re.findall(r"```python\n(.*?)```", SHEET, re.DOTALL), strict=True):
        space: dict[str, Any] = {}
        exec(code, space)  # our own text
        assert bs.trace(space[step.__name__]) == bs.trace(step)


def test_displays():
    checked = check_answers("1d = yes\n14a = x\n4c = 1/6")
    assert repr(checked) == "<CheckedAnswers: 1 of 3 right, 49 questions open>"
    assert str(checked).startswith("Answers: 1 of 3 right\n")
    assert checked._repr_html_().startswith("<p>Answers: 1 of 3 right</p>")
    document = json.loads(checked.to_table().to_json())
    assert document == json.loads(json.dumps(checked.to_dict()))
    assert [answer["verdict"] for answer in document["answers"]] == ["wrong", "right", "unreadable"]
