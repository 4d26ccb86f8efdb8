"""`rsea law`: fit a law to the unexplained residual and write it as an effect file."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

from rsea_ros.cli._output import FOUND, add_fail_on, add_json, add_results, print_file, results_place
from rsea_ros.cli._terminal import progress, say
from rsea_ros.cli._topics import (
    add_rig,
    add_runs,
    add_topic_options,
    add_window_options,
    each_once,
    rig_choice,
    topic_map,
)
from rsea_ros.report.result_files import LAW, LAW_JSON

HELP = "fit a law to the residual that no known effect explains, and write it as an effect file"
EXAMPLE = "rsea law run.mcap --rig results/model.yaml --out law"
FINDINGS = ("law", "no_law", "at_noise_floor")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    add_runs(parser, "several runs of one bench")
    add_rig(parser, "model.yaml of a diagnosis, or any rig")
    add_results(parser, f"the effect file, {', '.join(LAW)}", "out/law-BAG")
    add_json(parser, LAW_JSON)
    add_fail_on(parser, FINDINGS)
    add_topic_options(parser)
    add_window_options(parser)


def run(args: argparse.Namespace) -> int:
    """Search for a law and write it."""
    from rsea_ros.model.rig_file import load_rig

    place = results_place(args, Path("out") / f"law-{Path(args.bags[0]).stem}", LAW, [*args.bags, args.rig])
    rig, topics = load_rig(args.rig), topic_map(args)
    with progress("law") as tell:
        tell("reading", 0.0)
        from rsea_ros.cli._checks import check_records
        from rsea_ros.cli.diagnose import readable

        records = [readable(bag, topics, args) for bag in each_once(args.bags)]
        records = check_records(records, rig, topics.axis, quiet=args.json, masks=True)
        from rsea_ros.cli._output import provenance
        from rsea_ros.laws.effect_source import LawProvenance
        from rsea_ros.laws.learn import learn
        from rsea_ros.report.law.page import write_law

        where = provenance("law", args.bags, args.rig)
        bags = {Path(path).name: digest for path, digest in list(where.files.items())[: len(args.bags)]}
        result = learn(records, rig, LawProvenance(where.date, where.version, bags, ""), tell)
        result = replace(result, rig_choice=rig_choice(args))
        report = write_law(result, place, where)
    if args.json:
        print_file(report.parent / LAW_JSON)
    else:
        from rsea_ros.report.law.words import gain_sentence, headline, law_lines
        from rsea_ros.report.rig import rig_named

        say(headline(result))
        print(f"rig         {rig_named(result.rig_name, result.rig_choice)}")
        for line in law_lines(result):
            say(f"  {line}", indent=6)
        if result.laws:
            say(gain_sentence(result), indent=2)
            print(f"effect      {', '.join(str(report.parent / (w.law.name + '.py')) for w in result.laws)}")
        print(f"report      {report}")
    finding = "law" if result.laws else "at_noise_floor" if result.at_floor else "no_law"
    return FOUND if finding in args.fail_on else 0
