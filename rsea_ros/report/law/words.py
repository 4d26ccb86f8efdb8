"""Sentences about a law for the residual of a model."""

from __future__ import annotations

import math

from rsea_ros.laws.law import Law, LawResult, equation_of
from rsea_ros.report import words

_CLEARLY = 0.1
"""Share of what the law leaves that another variable must explain to be reported."""
NAMES = {"w": "speed", "q": "angle", "theta": "rotor's angle", "d": "deflection", "T": "load", "u": "command",
         "t": "time", "share": "time", "h": "load's angle", "law": "law's value"}  # fmt: skip
UNITS = {"w": "rad/s", "q": "rad", "theta": "rad", "d": "rad", "T": "N m", "u": "N m", "t": "s", "share": "s",
         "h": "rad", "law": "N m"}  # fmt: skip


def headline(result: LawResult) -> str:
    """Return the result in a sentence."""
    if result.at_floor:
        return "No law is needed: the model is at the noise floor"
    if not result.laws:
        return f"{_remaining_text(result)} remains, but no law surely reduces it on held-out blocks"
    law = result.laws[0].law
    kind = "A learnt law, which names no cause: " if law.is_learnt else ""
    share = min(100.0 * result.share, 100.0)
    also = _also(result)
    sentence = f"{share:.0f} % of the remaining residual is a function of {depends_on(law, result)}{also}"
    return f"{kind}{sentence}"


def _remaining_text(result: LawResult) -> str:
    """Return the worst residual on the test blocks: `A residual of 1.19 times the noise (F/T torque)`."""
    ratios = {n: before / result.noise[n] for n, before in result.before.items() if result.noise.get(n)}
    if not ratios:
        return "A residual"
    worst = max(ratios, key=lambda n: ratios[n])
    return f"A residual of {words.number(ratios[worst])} times the noise ({words.channel(worst)})"


def depends_on(law: Law, result: LawResult) -> str:
    """Return the variables of a law, a wave with its period."""
    cycles = [p.shape for p in law.parts if p.term.shape == "cycles_per_revolution"]
    if not cycles:
        return law.regressor
    ratio = abs(result.rig["gear.ratio"])
    around = f"2π/{cycles[0] * ratio:.4g} of the output"
    rotor = "" if ratio == 1.0 else f" ({cycles[0]:.4g} a turn of the rotor)"
    return f"{law.regressor.split(', periodic')[0]}, period {around}{rotor}"


def _also(result: LawResult) -> str:
    if len(result.laws) > 1:
        return f", and of {depends_on(result.laws[1].law, result)}"
    others = [d for d in result.dependences if d.beside > max(_CLEARLY, 2.0 * d.beside_se)]
    return "" if others else " only"


def gain_sentence(result: LawResult) -> str:
    """Return the gain on held-out blocks."""
    low, high = result.gain_ci95
    return (
        f"The residual falls by {100 * result.gain:.1f} % (95 %: {100 * low:.1f} to {100 * high:.1f} %) on "
        "blocks of time that took part in no fit and no choice."
    )


def law_lines(result: LawResult) -> list[str]:
    """Return the equations and their numbers, a line each."""
    lines = []
    for written in result.laws:
        lines.append(equation_of(written.law))
        lines += [f"  {text}" for text in parameter_lines(written.law)]
    return lines


def parameter_lines(law: Law) -> list[str]:
    """Return each parameter with its value, interval and unit."""
    lines, seen = [], set()
    for part, (c, s) in zip(law.parts, law.names, strict=True):
        rows = [(c, part.coefficient, part.ci95, part.term.unit)]
        rows += [(s, part.shape, part.shape_ci95, part.term.shape_unit)] if s and s not in seen else []
        seen.add(s)
        lines += [
            f"{name} = {_value_text(value, ci95)} {words.unit(unit)}".rstrip()
            for name, value, ci95, unit in rows
        ]
    return lines


def _value_text(value: float, ci95: tuple[float, float] | None) -> str:
    if ci95 is None or not all(map(math.isfinite, ci95)):
        return f"{value:.4g}"
    middle, half = words.with_interval(value, *ci95)
    return f"{middle} ± {half}" if half else middle
