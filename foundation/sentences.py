"""The base of all errors of these packages: sentences that every terminal and every encoding can show."""

from __future__ import annotations

MOST = 1000
"""Characters of a sentence; a longer one loses its middle."""


def plain(text: str) -> str:
    """Text in one line: spaces in place of line ends, escapes in place of what cannot be shown.

    Example:
        >>> print(plain("name must be text,\\nbut was \\x1b[31m, \\ud800"))
        name must be text, but was \\x1b[31m, \\ud800
    """
    return "".join(x if x.isprintable() else " " if x.isspace() else ascii(x)[1:-1] for x in text)


class SentenceError(ValueError):
    """An error whose message is one sentence, whatever text of users it quotes."""

    def __init__(self, sentence: str = "") -> None:
        text = plain(str(sentence))
        super().__init__(text if len(text) <= MOST else f"{text[: MOST // 2]} ... {text[-MOST // 3 :]}")
