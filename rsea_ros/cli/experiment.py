"""`rsea experiment`: the run that separates the remaining causes."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from rsea_ros.cli import _options
from rsea_ros.cli._terminal import positive, progress, say, whole_number
from rsea_ros.cli.diagnose import readable
from rsea_ros.documents import strict_yaml
from rsea_ros.documents.units import plain
from rsea_ros.errors import FieldError, ParameterError
from rsea_ros.experiment.run_shape import UNITS, limits_from, run_text
from rsea_ros.model.rig_file import load_rig
from rsea_ros.outputs.files import Destination, NewFiles
from rsea_ros.report.result_files import COMMANDS, EXPERIMENT, EXPERIMENT_JSON, MODEL, REPORT, json_text
from rsea_ros.report.words import LABEL

if TYPE_CHECKING:
    from rsea_ros.experiment.advice import Advice
    from rsea_ros.experiment.hypothesis import Hypothesis
    from rsea_ros.experiment.stored_models import ModelFile
    from rsea_ros.identification.solver import Map

HELP = "design the run that separates the remaining causes, within the limits of a bench"
EXAMPLE = "rsea experiment friction/model.yaml play/model.yaml --limits torque=20,velocity=1"
NO_RUN = "no_run"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    units = ", ".join(f"{name} ({plain(unit)})" for name, unit in UNITS.items())
    add = parser.add_argument
    what = "model.yaml of each cause (its last effect), a diagnosis.json beside its model.yaml, or a rig"
    add("models", nargs="+", metavar="MODEL", help=what)
    add("--limits", required=True, metavar="NAME=VALUE,…", help=f"limits in both directions: {units}")
    add("--bag", nargs="+", action="extend", default=[], help="earlier runs, used to weight the causes")
    add("--rate", type=positive, default=280.0, help="commands a second, 50 to 1000 Hz (default %(default)g)")
    add("--shortest", type=positive, help="shortest duration, s (default 0.5, or the longest if less)")
    add("--longest", type=positive, default=10.0, help="longest duration of the run, s (default %(default)g)")
    shapes = "number of shapes to compare (default %(default)s)"
    add("--refine", type=whole_number, default=24, metavar="N", help=shapes)
    _options.add_results(parser, ", ".join(EXPERIMENT), "out/experiment")
    _options.add_json(parser, EXPERIMENT_JSON)
    _options.add_fail_on(parser, (NO_RUN,))
    _options.add_topic_options(parser)


def run(args: argparse.Namespace) -> int:
    from rsea_ros.experiment.advice import advise
    from rsea_ros.experiment.proposal import DesignRequest
    from rsea_ros.identification.solver import worker_pools

    place = _options.results_place(args, Path("out") / "experiment", EXPERIMENT, [*args.models, *args.bag])
    shortest = args.shortest or min(0.5, args.longest)
    asked = DesignRequest(limits_from(args.limits), args.rate, shortest, args.longest, refine=args.refine)
    models = [model for path in args.models for model in models_in(path)]
    with progress("experiment") as tell, worker_pools() as pools:
        tell("reading", 0.0)
        hypotheses, noise, excluded = _possible(models, args, pools.run)
        advice = replace(advise(hypotheses, asked, noise, pools.run, tell), excluded=excluded)
    report = write_advice(advice, place, args)
    if args.json:
        _options.print_file(report.parent / EXPERIMENT_JSON)
    else:
        _print(advice, report)
    return _options.FOUND if NO_RUN in args.fail_on and advice.proposal is None else 0


def models_in(path: str) -> list[ModelFile]:
    """Return the causes of a model.yaml, a rig, or a diagnosis.json beside its model.yaml."""
    from rsea_ros.experiment.stored_models import model_of, models_of

    if Path(path).suffix != ".json":
        return [model_of(load_rig(path))]
    content = strict_yaml.read(Path(path)).content
    beside = Path(path).parent / MODEL
    if not beside.is_file():
        raise ParameterError(f"{path}: no {MODEL} beside it, expected both files of a diagnosis")
    extended = load_rig(beside)
    try:
        return models_of(content, extended)
    except (FieldError, ParameterError) as error:
        raise ParameterError(f"{path}: {error}") from None


def _possible(
    models: Sequence[ModelFile], args: argparse.Namespace, run: Map
) -> tuple[list[Hypothesis], dict[str, float], dict[str, float]]:
    """Return the hypotheses; from bags, the noise by channel and the excluded causes.

    With bags, one more hypothesis is that there is no cause.
    """
    from rsea_ros.experiment.campaign import Rules
    from rsea_ros.experiment.hypothesis import NOTHING
    from rsea_ros.experiment.joint_weighing import weigh
    from rsea_ros.experiment.stored_models import hypotheses_from

    if not args.bag:
        return hypotheses_from(models), {}, {}
    first = models[0].rig
    rig = first.with_effects(*(e for e in first.effects if e.name != models[0].name))
    records = [readable(bag, _options.topic_map(args)) for bag in args.bag]
    weighing = weigh(records, rig, [m.name for m in models if m.name != NOTHING], run=run)
    likely = weighing.hypotheses()
    kept = [h for h in likely if h.probability >= Rules.possible] or likely[:1]
    excluded = {h.name: h.probability for h in likely if h not in kept}
    return kept, dict(weighing.cases[0].noise), excluded


def write_advice(advice: Advice, place: Destination, args: argparse.Namespace) -> Path:
    from rsea_ros.report.experiment import advice_json, advice_page

    source = _options.provenance("experiment", args.bag)
    with NewFiles(place) as new:
        if advice.proposal is not None:
            new.write(COMMANDS, run_text(advice.proposal.command, advice.proposal.rate))
        new.write(EXPERIMENT_JSON, json_text(advice_json(advice), source))
        return new.write(REPORT, advice_page(advice, source))


def _print(advice: Advice, report: Path) -> None:
    from rsea_ros.report import experiment as page

    say(page.verdict(advice))
    for name, sure in page.possible_rows(advice):
        say(f"cause       {name}: {sure}", indent=LABEL)
    p = advice.proposal
    if p is not None:
        for i, a in enumerate(p.names):
            for j, b in enumerate(p.names):
                if i != j:
                    rivals = f"{page.plain_name(a)} over {page.plain_name(b)}"
                    say(f"separates   {rivals}: S = {p.table[i, j]:.3g}", indent=LABEL)
        for name, expected, level, limit, unit in page.limit_rows(p, advice.asked.limits.finite_limits()):
            allowed = f"of {limit} {plain(unit)}" if limit != "none" else f"{plain(unit)} (no limit stated)"
            say(f"asks        {name} {expected}, at most {level} {allowed}", indent=LABEL)
        print(f"run         {report.parent / COMMANDS}")
    for proof in advice.proofs:
        say(f"no run      {page.proof_words(proof)}", indent=LABEL)
    print(f"report      {report}")
