"""A law for the residual of a model in sentences, and law.json."""

import math
from typing import Any

from rsea_ros.laws.law import Law, LawResult, equation_of
from rsea_ros.report import words
from rsea_ros.report.result_files import pick

SCHEMA = 1
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
        ratios = {n: v / result.noise[n] for n, v in result.before.items() if result.noise.get(n)}
        worst = max(ratios, key=lambda n: ratios[n], default="")
        size = f" of {words.number(ratios[worst])} times the noise ({words.channel(worst)})" if ratios else ""
        return f"A residual{size} remains, but no law surely reduces it on held-out blocks"
    law = result.laws[0].law
    others = any(d.beside > max(_CLEARLY, 2.0 * d.beside_se) for d in result.dependences)
    also = "" if others else " only"
    if len(result.laws) > 1:
        also = f", and of {depends_on(result.laws[1].law, result)}"
    kind = "A learnt law, which names no cause: " if law.is_learnt else ""
    share = f"{min(100.0 * result.share, 100.0):.0f} %"
    return f"{kind}{share} of the remaining residual is a function of {depends_on(law, result)}{also}"


def depends_on(law: Law, result: LawResult) -> str:
    """Return the variables of a law, a wave with its period."""
    cycles = [p.shape for p in law.parts if p.term.shape == "cycles_per_revolution"]
    if not cycles:
        return law.regressor
    ratio = abs(result.rig["gear.ratio"])
    around = f"2π/{cycles[0] * ratio:.4g} of the output"
    rotor = "" if ratio == 1.0 else f" ({cycles[0]:.4g} a turn of the rotor)"
    return f"{law.regressor.split(', periodic')[0]}, period {around}{rotor}"


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
    return [
        f"{n} = {_value_text(*of[:2])} {words.unit(of[2])}".rstrip() for n, of in _parameters(law).items()
    ]


Size = tuple[float, tuple[float, float] | None, str]


def _parameters(law: Law) -> dict[str, Size]:
    """Return value, 95 % interval and unit of each parameter by name, a shape that terms share once."""
    sizes: dict[str, Size] = {}
    for part, (coefficient, shape) in zip(law.parts, law.names, strict=True):
        sizes[coefficient] = (part.coefficient, part.ci95, part.term.unit)
        if shape:
            sizes.setdefault(shape, (part.shape, part.shape_ci95, part.term.shape_unit))
    return sizes


def _value_text(value: float, ci95: tuple[float, float] | None) -> str:
    if ci95 is None or not all(map(math.isfinite, ci95)):
        return f"{value:.4g}"
    middle, half = words.with_interval(value, *ci95)
    return f"{middle} ± {half}" if half else middle


def law_json(result: LawResult) -> dict[str, Any]:
    """Return the contents of law.json."""
    return {
        "schema": SCHEMA,
        "rig": result.rig_name,
        "sentence": headline(result),
        "data": pick(result, "bags=sources duration_s=duration"),
        "at_noise_floor": result.at_floor,
        "gain": pick(result, "holdout=gain holdout_ci95=gain_ci95 share_of_excess=share"),
        "residual_rms": pick(result, "before after"),
        "noise_rms": pick(result, "noise")["noise"],
        "laws": [_law(w.law) for w in result.laws],
        "depends_on": [
            pick(d, "what=regressor at=place share se of_what_the_law_leaves=beside")
            for d in result.dependences
        ],
        "tried": [pick(t, "at=place terms left chosen") for t in result.tried],
    }


def _law(law: Law) -> dict[str, Any]:
    sizes = {
        n: {"value": v, "unit": unit, "ci95": list(ci95 or ())}
        for n, (v, ci95, unit) in _parameters(law).items()
    }
    return {
        "name": law.name, "file": f"{law.name}.py",
        **pick(law, "at=place depends_on=regressor learnt=is_learnt"), "equation": equation_of(law),
        "parameters": sizes,
    }  # fmt: skip
