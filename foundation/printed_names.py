"""Names of methods and scenes as a paper prints them: Störmer–Verlet for stormer-verlet."""

from __future__ import annotations

import re
from itertools import pairwise


def _spellings(words: str) -> dict[str, str]:
    """Words by their spelling in names."""
    ascii_letters = str.maketrans("éö", "eo", "()")
    return {word.lower().translate(ascii_letters): word for word in words.split()}


PERSONS = _spellings(
    "Atela Blanes Bogacki Boris Casas Cash Chin Crouzeix Dormand Euler Fehlberg Fermi Gauss Heiles Heun Hénon Imada "
    "Karp Kahan Kepler Kutta Lawson Li Lie Lobatto Lorenz Lotka McLachlan Merson Moan Nyström Okunbor Pasta Prince "
    "Qin Radau Ralston Riccati Rosenbrock Ruth Shampine Skeel Sofroniou Spaletta Strang Störmer Suzuki Takahashi "
    "Toda Trotter Ulam Umeno Verlet Verner Volterra Yoshida Zhang"
)
SHORT = _spellings(
    "ABC AVF DOP GARK GRK IA IIA IIIA IIIB IIIC IIID IIIE PEFRL RK RKN RODAS ROS SDIRK SSPRK TDRK Tsit W (KDK) (DKD)"
)
PLAIN = _spellings(
    "body brusselator central charged classical collocation dipole double energy explicit field flow general harmonic "
    "implicit jump linear magnetic midpoint nonlinear oscillator outer particle pendulum perturbed rigid simplified "
    "solar symplectic system trapezoidal triple"
)
KNOWN = PERSONS | SHORT | PLAIN
WHOLE = {
    "field-nijhoff": "Field–Nijhoff",
    "lennard-jones": "Lennard-Jones",
    "n-body": "n-body",
    "p": "(implicit p)",
    "q": "(implicit q)",
    "van-der-pol": "Van der Pol",
}
"""Names, and parts of names, that follow no rule."""
_PART = re.compile(r"([a-z]*)([0-9]*\w*)")
_NAME = re.compile(r"(?<![\w./\\-])[a-z][a-z0-9]+(?:-[a-z0-9]+)*(?![\w/\\-]|\.\w)")
"""A name in a text; file names are none."""
_POWER = re.compile(r"(?<=\w)\^([0-9]+)\b")
_SUPERSCRIPTS = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")


def printed_text(text: str) -> str:
    """A text with the names of catalogues in it as printed, and with whole powers as superscripts.

    Example:
        >>> printed_text("stormer-verlet-kdk on perturbed-kepler, h = 0.1"), printed_text("rk4.csv, h = 0.1")
        ('Störmer–Verlet (KDK) on perturbed Kepler, h = 0.1', 'rk4.csv, h = 0.1')
    """
    raised = _POWER.sub(lambda found: found[1].translate(_SUPERSCRIPTS), text)
    return _NAME.sub(lambda found: printed_name(found[0]), raised)


def printed_name(name: str) -> str:
    """A name of a catalogue as text for titles and legends; any other name is left alone.

    Example:
        >>> printed_name("stormer-verlet-kdk"), printed_name("symplectic-euler-p"), printed_name("rk4")
        ('Störmer–Verlet (KDK)', 'symplectic Euler (implicit p)', 'RK4')
        >>> printed_name("gauss3"), printed_name("lotka-volterra"), printed_name("my-method")
        ('Gauss 3', 'Lotka–Volterra', 'my-method')
    """
    parts = [name] if name in WHOLE else name.split("-")
    words = [WHOLE.get(part) or _printed_part(part) for part in parts]
    if not all(words):
        return name
    text = words[0]
    for before, word in pairwise(words):
        is_pair = before in PERSONS.values() and word.split()[0] in PERSONS.values()
        text += ("–" if is_pair else " ") + word
    return text


def _printed_part(part: str) -> str:
    """A part between hyphens as printed; nothing if it is not known."""
    found = _PART.fullmatch(part)
    if found is None or (found[1] and found[1] not in KNOWN):
        return ""
    number = found[2].upper()
    joint = " " if found[1] and number and found[1] not in SHORT else ""
    return KNOWN.get(found[1], "") + joint + number
