"""`rsea law`: fit a law to the unexplained residual and write it as an effect file."""

import argparse
from dataclasses import replace
from pathlib import Path

from rsea_ros.cli import _options, _terminal
from rsea_ros.cli.check import check_records
from rsea_ros.cli.diagnose import readable
from rsea_ros.model.rig_file import load_rig
from rsea_ros.report.remark_words import rig_named
from rsea_ros.report.result_files import LAW, LAW_JSON

HELP = "fit a law to the residual that no known effect explains, and write it as an effect file"
EXAMPLE = "rsea law run.mcap --rig results/model.yaml --out law"
FINDINGS = ("law", "no_law", "at_noise_floor")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    _options.add_runs(parser, "several runs of one bench", "model.yaml of a diagnosis, or any rig")
    _options.add_results(parser, f"the effect file, {', '.join(LAW)}", "out/law-BAG")
    _options.add_json(parser, LAW_JSON)
    _options.add_fail_on(parser, FINDINGS)
    _options.add_topic_options(parser, window=True)


def run(args: argparse.Namespace) -> int:
    default = Path("out") / f"law-{Path(args.bags[0]).stem}"
    place = _options.results_place(args, default, LAW, [*args.bags, args.rig])
    rig, topics = load_rig(args.rig), _options.topic_map(args)
    with _terminal.progress("law") as tell:
        tell("reading", 0.0)
        records = [readable(bag, topics, args) for bag in _options.each_once(args.bags)]
        records = check_records(records, rig, topics.axis, quiet=args.json, masks=True)
        from rsea_ros.laws.effect_source import LawProvenance
        from rsea_ros.laws.learn import learn
        from rsea_ros.report import law as page

        where = _options.provenance("law", args.bags, args.rig)
        bags = {Path(path).name: digest for path, digest in list(where.files.items())[: len(args.bags)]}
        result = learn(records, rig, LawProvenance(where.date, where.version, bags, ""), tell)
        result = replace(result, rig_choice=_options.rig_choice(args))
        report = page.write_law(result, place, where)
    if args.json:
        _options.print_file(report.parent / LAW_JSON)
    else:
        _terminal.say(page.headline(result))
        print(f"rig         {rig_named(result.rig_name, result.rig_choice)}")
        for line in page.law_lines(result):
            _terminal.say(f"  {line}", indent=6)
        if result.laws:
            _terminal.say(page.gain_sentence(result), indent=2)
            print(f"effect      {', '.join(str(report.parent / (w.law.name + '.py')) for w in result.laws)}")
        print(f"report      {report}")
    finding = "law" if result.laws else "at_noise_floor" if result.at_floor else "no_law"
    return _options.FOUND if finding in args.fail_on else 0
