"""Names and values in a sentence, and text from outside on a terminal."""

import difflib
import re
from collections.abc import Iterable, Sequence

_CONTROLS = (
    r"[\x00-\x08\x0b-\x1a\x1c-\x1f\x7f-\x9f\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff\ufffe\uffff]"
)
_COLOUR = r"\x1b(?!\[[\d;]*m)"
_PLAIN, _COLOURED = re.compile(f"{_CONTROLS}|\x1b"), re.compile(f"{_CONTROLS}|{_COLOUR}")
_LONGEST = 60
_SHORTEST = 3
"""Letters of the beginning of a name that say which one may be meant."""


def list_names(names: Sequence[str], last: str = "and") -> str:
    """Return names as `a, b and c`; last: the word before the last of them."""
    return f" {last} ".join([", ".join(names[:-1]), names[-1]] if names[1:] else names)


def did_you_mean(name: str, names: Iterable[str]) -> str:
    """Return `, did you mean X?` with the known name nearest to a wrong one, or nothing.

    A beginning of a name counts as near: `paper_hi`.
    """
    known = list(names)
    near = difflib.get_close_matches(name, known, n=1, cutoff=0.6)
    near = near or [one for one in known if len(name) >= _SHORTEST and one.startswith(name)]
    return f", did you mean {near[0]}?" if near else ""


def printable(text: str, *, colours: bool = False) -> str:
    """Return text in which control characters (all but tab and newline) are shown as \\u001b.

    A name in a file may hold sequences that a terminal obeys, or that turn the direction of writing.
    colours: let sequences pass that set a colour.
    """
    pattern = _COLOURED if colours else _PLAIN
    return pattern.sub(lambda match: f"\\u{ord(match[0]):04x}", text)


def in_docstring(text: str) -> str:
    """Return text of unknown origin as a part of a Python docstring, which it cannot end."""
    return " ".join(printable(text).split("\n")).replace("\\", "\\\\").replace('"', '\\"')


def quote(value: object, longest: int = 60) -> str:
    """Return a value for a message: quoted, and shortened if it is long."""
    text = repr(value)
    return text if len(text) <= longest else f"{text[: longest - 1]}…"


def no_utf_8(error: UnicodeDecodeError) -> str:
    """Return which byte of a file is not text in UTF-8."""
    return f"byte {error.start} is {error.object[error.start]:#04x}, which is not UTF-8"


def brief(text: str, longest: int = _LONGEST) -> str:
    """Return a text of unknown origin fit for a message: one line, no control characters, not too long."""
    cut = text[: longest + 1]
    plain = "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in cut[:longest])
    return plain + ("…" if len(cut) > longest else "")
