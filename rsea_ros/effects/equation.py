"""The equation of an effect is written once: the first indented lines of its file's docstring."""

from __future__ import annotations


def equation_of(docstring: str | None) -> str:
    """Return the first indented lines of a docstring as one line; empty without any."""
    begin, end = _place(lines := (docstring or "").splitlines())
    return " ".join(line.strip() for line in lines[begin:end])


def without_equation(docstring: str | None) -> str:
    """Return a docstring without its first indented lines, and the empty line after them."""
    begin, end = _place(lines := (docstring or "").strip().splitlines())
    return "\n".join([*lines[:begin], *lines[end + 1 :]]).strip()


def _place(lines: list[str]) -> tuple[int, int]:
    """Return the first and the one after the last of the first indented lines; both the end without any."""
    indented = [line.startswith("    ") and bool(line.strip()) for line in lines]
    begin = indented.index(True) if True in indented else len(lines)
    rest = indented[begin:]
    return begin, begin + (rest.index(False) if False in rest else len(rest))
