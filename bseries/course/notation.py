"""Answers in the notation of the sheets, rewritten in that of the parser of formulas."""

from __future__ import annotations

import re
import unicodedata

from integrators.exact.expressions import ELEMENTARY, ROOTS

SIGNS = {"·": "*", "⋅": "*", "×": "*", "⁄": "/", "’": "'", "′": "'"}
GREEK = {"γ": "gamma", "ε": "eps", "θ": "theta", "π": "pi", "φ": "phi", "ω": "omega"}
"""Signs in answers, and what the parser of formulas reads in their place."""
BESIDE_GREEK = re.compile(rf"(?<=[^\W_])(?=[{''.join(GREEK)}])|(?<=[{''.join(GREEK)}])(?=\w)")
RAISED = re.compile("[⁺⁻]?[⁰¹²³⁴-⁹]+")
FRACTION = re.compile(r"(?<!\w)[¼-¾⅐-⅞]")
ROOT = re.compile(r"[√∛]\s*(\d+|[^\W\d]\w*|(?=\())")
ROOT_NAMES = {"√": "sqrt", "∛": "cbrt"}
LOGARITHM = re.compile(r"(?<![^\W\d])ln(?!\w)")
INVERSE = re.compile(r"(?<![^\W\d])(?:arc|ar)(sin|cos|tan)(h?)(?!\w)")
EXPONENTIAL = re.compile(r"(?:(?<![\w.])e|(?<=\d)e(?![+-]?\d))(?!\w)")
APPLIED = re.compile(
    rf"(?<![^\W\d])({'|'.join(ELEMENTARY)})(?!\w)\s*(\^\(?\d+\)?)?\s*"
    r"(?:\(([^()]*)\)|(\d*\s*[^\W\d]\w*)(?!\s*[*/^(]|\w))"
)
"""A function of what is in parentheses, or of a name with a number, with a power behind its name: sin^2(q), ln p."""
TOKEN = re.compile(r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|[^\W\d]\w*|\s+|.", re.DOTALL)
"""A number, a name, a space or a sign."""


def plain(text: str) -> str:
    """An answer in the notation that the parser of formulas reads.

    Example:
        >>> plain("3θ²/8 + 2·sin(q) - 1e3"), plain("4(1 + p) + ½ f'f")
        ('3*theta^(2)/8 + 2*sin(q) - 1e3', "4*(1 + p) + (1/2)*f'f")
        >>> plain("q − 2 ln q + p sin²(2q)"), plain("(2/h) arctan(h√2)·e^0.1")
        ('q − 2*log(q) + p*sin(2*q)^(2)', '(2/h)*atan(h*sqrt(2))*exp(1)^0.1')
    """
    text = RAISED.sub(lambda found: f"^({unicodedata.normalize('NFKC', found[0])})", text)
    text = FRACTION.sub(r"(\g<0>)", text)
    text = unicodedata.normalize("NFKC", text)
    text = BESIDE_GREEK.sub(" ", text)
    for sign, word in (SIGNS | GREEK).items():
        text = text.replace(sign, word)
    text = ROOT.sub(lambda found: f" {ROOT_NAMES[found[0][0]]}" + (f"({found[1]})" if found[1] else ""), text)
    text = EXPONENTIAL.sub("exp(1)", INVERSE.sub(r"a\1\2", LOGARITHM.sub("log", text)))
    text = APPLIED.sub(lambda found: f"{found[1]}({found[3] or found[4]}){found[2] or ''}", text)
    return with_products(text)


def with_products(text: str) -> str:
    """A formula with a sign * between factors that stand side by side.

    What 1/2a or e^2a means would be a guess: behind / and ^ nothing is inserted.

    Example:
        >>> with_products("a(1 + 2b) c^(2)d"), with_products("1/2a + e^2a + f''(f, f)"), with_products("sin(q)(p/q)p")
        ('a*(1 + 2*b)*c^(2)*d', "1/2a + e^2a + f''(f, f)", 'sin(q)*(p/q)*p')
    """
    written, last, ends, guess, groups = "", "", False, False, list[bool]()
    for token in TOKEN.findall(text):
        if token.isspace():
            written += token
            continue
        is_name, opens = token[0].isalpha(), token == "("
        if ends and not guess and (is_name or opens) and last not in (*ELEMENTARY, *ROOTS, "f"):
            written = written.rstrip() + "*"
        if opens:
            groups.append(guess)
        if token == ")" and groups:
            guess = groups.pop()  # of what stands before the group, which may be its exponent
        elif opens or token in "*,;" or (token in "+-−" and ends):
            guess = False
        elif token == "/" or last == "^":
            guess = True
        written += token
        ends, last = token == ")" or token[0].isalnum() or len(token) > 1, token
    return written
