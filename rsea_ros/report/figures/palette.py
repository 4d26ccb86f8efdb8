"""Few colours, each with one meaning on every page. Blue and orange are told apart by colour-blind eyes."""

INK = "#1f2933"
QUIET = "#66717d"
GRID = "#e6e9ec"
MEASURED = "#7b8794"
AFTER = "#1864ab"
"""The model at the end: fitted, or extended."""
BEFORE = "#d9730d"
"""The model that something is wrong with."""
NOISE = "#adb5bd"
TRUTH = "#2b8a3e"


def faint(colour: str, opacity: float) -> str:
    """Return a #rrggbb colour as rgba() of an opacity from 0 to 1."""
    red, green, blue = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    return f"rgba({red},{green},{blue},{opacity:g})"
