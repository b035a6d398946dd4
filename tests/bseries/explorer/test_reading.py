"""Text from forms: what is read, and the sentence for what is not."""

from __future__ import annotations

from fractions import Fraction

import pytest

import bseries as bs
from bseries.explorer.reading import MOST_CHARACTERS, Request, read_integer, read_method, read_positive, read_scene

RK4_ROWS = "0 0 0 0\n1/2 0 0 0\n0 1/2 0 0\n0 0 1 0\n1/6 1/3 1/3 1/6"


@pytest.mark.parametrize(
    "text",
    [
        "RK4",
        RK4_ROWS,
        RK4_ROWS.replace("\n", ";"),
        "0|0,0,0,0\r\n1/2|1/2,0,0,0\n1/2|0,1/2,0,0\n1|0,0,1,0\n|1/6,1/3,1/3,1/6\n",
        "A = [[0,0,0,0],['1/2',0,0,0],[0,'1/2',0,0],[0,0,1,0]]\nb = ['1/6','1/3','1/3','1/6']",
        '{"A": [[0,0,0,0],["1/2",0,0,0],[0,"1/2",0,0],[0,0,1,0]], "b": ["1/6","1/3","1/3","1/6"]}',
    ],
)
def test_one_tableau_in_all_forms(text):
    assert bs.modified_equation(read_method(text), 5) == bs.modified_equation("rk4", 5)


def test_formulas_in_rows_keep_their_spaces_between_commas():
    found = read_method("1/2 - sqrt(3)/6, 0; sqrt(3)/3, 1/2 - sqrt(3)/6; 1/2, 1/2")
    assert bs.order_of(found) == 3
    assert found.b == (Fraction(1, 2), Fraction(1, 2))


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "method must be a name such as rk4 or a tableau, but was empty"),
        ("rk5000", "name must be a method of the catalogue, but was 'rk5000'"),
        ("0 0; 1/2; 1", "method must be a tableau with a row for each stage and then the weights"),
        ("0;1;2", "but had rows of 1, 1, 1"),
        ("x", "name must be a method"),
        ("a; b", "a"),
        ("0 0; __import__('os') 0; 0 1", "A"),
        ("{", "method"),
        ('{"A": 3}', "method"),
        ("A = __import__('os')", "method"),
        ("gauss40", "method must have at most 24 stages to explore, but had 40"),
    ],
)
def test_no_method(text, sentence):
    with pytest.raises(bs.errors) as caught:
        read_method(text)
    assert sentence in str(caught.value)
    assert "\n" not in str(caught.value)


def test_scenes_in_all_forms():
    assert read_scene("pendulum") == bs.scene("pendulum")
    assert read_scene("Henon-Heiles", "p=0,1; q=1/2,0").y0.tolist() == [0, 1, 0.5, 0]
    assert read_scene("p^2/2 - cos(q)", "p=1; q=0").field == bs.scene("pendulum").field
    assert read_scene("p' = -sin(q); q' = p", "p=1;q=0").field == bs.scene("pendulum").field


@pytest.mark.parametrize(
    ("text", "start", "sentence"),
    [
        ("nowhere", "", "nowhere"),
        ("p^2/2", "", "start must be given"),
        ("p^2/2 + zeta(q)", "p=0;q=1", "zeta"),
        ("p' = import os", "p=0", ""),
        ("pendulum", "p=0;q", 'start must be values by block, as in "p=0; q=-3/2", but was'),
        ("pendulum", "p=0;x=1", "x"),
        ("pendulum", "p=0;q=1/0", "q"),
        ("outer-solar-system", "", "scene must have at most 24 variables to explore, but had 36"),
    ],
)
def test_no_scene(text, start, sentence):
    with pytest.raises(bs.errors) as caught:
        read_scene(text, start)
    assert sentence in str(caught.value)


def test_numbers_and_lengths_are_bounded():
    assert read_integer("", "order", 5, 8) == 5
    assert read_integer("7", "order", 5, 8) == 7
    assert read_positive("1/10", "span", 20, 1000) == 0.1
    for text in ("0", "9", "-1", "1.5", "many", "1e99", "99999"):
        with pytest.raises(bs.SeriesError, match="order must be a whole number from 1 to 8"):
            read_integer(text, "order", 5, 8)
    for text in ("0", "-1", "nan", "1e9", "x"):
        with pytest.raises(bs.errors, match="span must be"):
            read_positive(text, "span", 20, 1000)
    with pytest.raises(bs.SeriesError, match="method must have at most 4,000 characters, but had 4,001"):
        Request(method="0" * (MOST_CHARACTERS + 1)).checked()
    assert Request(method=" rk4 \n").checked().method == "rk4"


def test_a_start_is_read_as_everywhere():
    assert read_scene("pendulum", "p=0; q=root(8,3)").y0.tolist() == [0, 2]
    with pytest.raises(bs.SeriesError, match="start must be values by block"):
        read_scene("pendulum", "p=0; p=1; q=1")


def test_rows_may_end_with_their_digits():
    rows = "0 0; 0.666666667 0; 0.25 0.75"
    assert [bs.order_of(read_method(text)) for text in (rows, rows + "; digits = 9")] == [1, 2]
    assert read_method(rows.replace(";", "\n") + "\ndigits=9\n").digits == 9
    with pytest.raises(bs.errors, match="digits must be an integer from 1 to 1000, but was 2000"):
        read_method(rows + "; digits = 2000")
