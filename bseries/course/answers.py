"""Answers to the exercises: a text file of lines `1a = …`, its template, and the check of what was answered."""

from __future__ import annotations

import re
from typing import Any, NamedTuple

from bseries.course.questions import QUESTIONS, Question
from bseries.exceptions import SeriesError
from bseries_base.errors import BSeriesError, shorten, shown, suggestion
from bseries_base.table import Column, Table, as_frame, as_html, as_text

MOST_CHARACTERS = 100_000
"""Of a text of answers."""
MOST_BYTES = 4 * MOST_CHARACTERS
"""Of a file of answers."""
MOST_OF_AN_ANSWER = 500
"""Characters of an answer."""
LINE = re.compile(r"\s*(\w+)\s*=(.*)", re.DOTALL)
RIGHT, WRONG, UNREADABLE = "right", "wrong", "unreadable"


class CheckedAnswer(NamedTuple):
    """An answer and its verdict."""

    key: str  # of the question
    text: str
    verdict: str  # right, wrong or unreadable
    remark: str  # how a right answer was decided, in what a wrong one differs, or what an unreadable one must be


class CheckedAnswers(NamedTuple):
    """The answers to the exercises that were given, checked; `check_answers` makes it.

    Example:
        >>> checked = check_answers("16c = yes, no, no")
        >>> checked
        <CheckedAnswers: 0 of 1 right, 51 questions open>
        >>> checked.answers[0].remark
        '2 of 3 wrong'
    """

    answers: tuple[CheckedAnswer, ...]  # in the order of the exercises
    open: tuple[str, ...]  # the keys of questions without an answer

    @property
    def right(self) -> int:
        """The number of right answers."""
        return sum(answer.verdict == RIGHT for answer in self.answers)

    @property
    def all_right(self) -> bool:
        """Whether every answer that was given is right."""
        return self.right == len(self.answers)

    def __repr__(self) -> str:
        return f"<CheckedAnswers: {self.right} of {len(self.answers)} right, {len(self.open)} questions open>"

    def to_dict(self) -> dict[str, Any]:
        """The verdicts as JSON-ready data."""
        return {
            "schema": 1,
            "kind": "answers",
            "right": self.right,
            "given": len(self.answers),
            "open": list(self.open),
            "answers": [answer._asdict() for answer in self.answers],
        }

    def to_table(self) -> Table:
        """The verdicts as a table, which is text, Markdown, CSV, LaTeX, HTML or JSON."""
        answer = Column("answer", get=lambda answer: shorten(answer.text))
        return Table(
            f"Answers: {self.right} of {len(self.answers)} right",
            (Column("key"), answer, Column("verdict"), Column("remark")),
            self.answers,
            [f"No answers to {', '.join(self.open)}."] if self.open else [],
            data=self.to_dict,
            items="answers",
        )

    __str__, _repr_html_, to_pandas = as_text, as_html, as_frame


def check_answers(text: str) -> CheckedAnswers:
    """Check answers to the exercises of the course.

    Formulas are compared as functions, so that every equivalent form is right. Numbers are compared exactly, or to the
    digits that the exercise asks for. The engine computes what is right.

    Args:
        text: Lines ``key = answer`` such as ``1d = no``; what follows # is a comment, and a line without an answer is
            an open question. `answer_template` has all keys, and says how each answer is written.

    Returns:
        A verdict and a remark for each answer.

    Raises:
        SeriesError: The text is too long or has no answer, a line is no ``key = answer``, or a key is unknown or there
            twice.

    Example:
        >>> print(check_answers("1d = no  # it is symmetric\\n14a = p*sin(q)/2\\n14c = cos(2*q)/48 - p^2*cos(q)/24"))
        Answers: 2 of 3 right
        <BLANKLINE>
        key  answer                       verdict  remark
        ───  ───────────────────────────  ───────  ────────────────────────────────────
        1d   no                           right
        14a  p*sin(q)/2                   wrong    is that of the variant implicit in q
        14c  cos(2*q)/48 - p^2*cos(q)/24  right    equal exactly
        ...

    References:
        E. Hairer, lecture on long-time behaviour, section 8, for exercises 1 to 6.
    """
    given = _read(text)
    checked = tuple(_checked(question, given[question.key]) for question in QUESTIONS if question.key in given)
    return CheckedAnswers(checked, tuple(question.key for question in QUESTIONS if question.key not in given))


def answer_template() -> str:
    """The text of a file for answers: every key, with what is asked and how the answer is written.

    Example:
        >>> print(answer_template().split("\\n\\n")[1])
        # c_1, c_2, c_3, c_4 of the implicit Euler method
        # 4 numbers, separated by commas, exactly
        1a =
    """
    head = [
        "# Answers to the exercises. Write each behind its key, on one line; leave open what you have not done.",
        "# Formulas have * for products and ^ for powers, as in -h^2*p*sin(q)/24. Numbers may be 1/3, sqrt(2) or pi/4.",
        "# Check them with: bseries course --check answers.txt",
    ]
    questions = [f"# {question.asks}\n# {question.kind.form}\n{question.key} =" for question in QUESTIONS]
    return "\n\n".join(["\n".join(head), *questions]) + "\n"


def _read(text: str) -> dict[str, str]:
    """The answers by their keys, without those that are open."""
    if not isinstance(text, str):
        raise SeriesError(f"answers must be text, but were {shown(text)}")
    if len(text) > MOST_CHARACTERS:
        raise SeriesError(f"answers must have at most {MOST_CHARACTERS:,} characters, but had {len(text):,}")
    keys, given = [question.key for question in QUESTIONS], dict[str, str]()
    for number, line in enumerate(text.removeprefix("\ufeff").splitlines(), 1):
        content = line.partition("#")[0].strip()
        if not content:
            continue
        match = LINE.fullmatch(content)
        if match is None:
            raise SeriesError(f"line {number} must be key = answer, as in 1d = no, but was {shorten(content)!r}")
        key, answer = match[1], match[2].strip()
        if key not in keys:
            near = suggestion(key, keys)
            raise SeriesError(f"keys must be of {keys[0]} to {keys[-1]}, but line {number} had {shorten(key)!r}{near}")
        if answer and key in given:
            raise SeriesError(f"keys must have one answer, but line {number} gave another one to {key}")
        if answer:
            given[key] = answer
    if not given:
        raise SeriesError("answers must hold an answer such as 1d = no, but held none")
    return given


def _checked(question: Question, text: str) -> CheckedAnswer:
    """The verdict on an answer."""
    try:
        if len(text) > MOST_OF_AN_ANSWER:
            raise SeriesError(f"{question.key} must have at most {MOST_OF_AN_ANSWER} characters, but had {len(text)}")
        right, remark = question.kind.judge(text, question.truth(), question.key)
    except BSeriesError as error:
        return CheckedAnswer(question.key, text, UNREADABLE, str(error))
    return CheckedAnswer(question.key, text, RIGHT if right else WRONG, remark)
