"""`rsea predict`: simulate a model on the commands of a new bag."""

import argparse
import json
from dataclasses import replace
from pathlib import Path
from typing import NoReturn

import numpy as np

from msg_adapters import read_record
from rsea_ros.cli._options import add_force, add_topic_options, cut, topic_map
from rsea_ros.errors import ParameterError
from rsea_ros.model.prediction_errors import predict
from rsea_ros.model.rig_file import load_rig
from rsea_ros.outputs.files import check_free, write_file
from rsea_ros.records.stamps import repair_stamps
from rsea_ros.report.result_files import fault_json, pick

HELP = "simulate a model on the commands of a bag and print its errors as JSON"
EXAMPLE = "rsea predict results/model.yaml other_run.mcap"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("model", help="model.yaml, or the name or file of any rig")
    parser.add_argument("bag", help="rosbag2 directory, .mcap or .db3")
    about = "file for the predicted channels: t in s, then one column per channel in SI units"
    parser.add_argument("--out", metavar="CSV", help=about)
    about = "record whose condition holds (default: the bag's own name)"
    parser.add_argument("--condition", metavar="RECORD", help=about)
    parser.add_argument("--rig", action=_RigComesFirst, help=argparse.SUPPRESS)
    add_force(parser)
    parser.add_argument("--json", action="store_true", help="no effect: this verb always prints JSON")
    add_topic_options(parser, window=True)


class _RigComesFirst(argparse.Action):
    """Refuses the option that other verbs have, and says what stands in its place."""

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: object,
        option_string: str | None = None,
    ) -> NoReturn:  # fmt: skip
        parser.error(f"no --rig here: a model or a rig is the first argument, `{parser.prog} {values} BAG`")


def run(args: argparse.Namespace) -> int:
    if args.out:
        check_free([Path(args.out)], force=args.force, inputs=[args.bag, args.model])
    record = read_record([args.bag], topics=topic_map(args), strict=False)
    record, faults = repair_stamps(record)
    record = cut(replace(record, faults=(*record.faults, *faults)), args)
    rig = load_rig(args.model)
    if args.condition is not None:
        if rig.condition(args.condition) is None:
            known = ", ".join(c.record for c in rig.conditions) or "a model with conditions"
            raise ParameterError(f"--condition {args.condition}: not in {args.model}, expected {known}")
        rig = rig.under(args.condition)
    from rsea_ros.checks.check import check_record  # after the bag, so that a bad bag is refused at once

    comparisons = predict(rig, record)
    if args.out:
        t = next(iter(comparisons.values())).t
        columns = [np.interp(t, c.t, c.predicted).tolist() for c in comparisons.values()]
        rows = (",".join(map(repr, row)) for row in zip(t.tolist(), *columns, strict=True))
        write_file(args.out, "\r\n".join([",".join(["t", *comparisons]), *rows, ""]), force=args.force)
    errors = {n: pick(c, "rms_error fit_percent") for n, c in comparisons.items()}
    with np.errstate(all="ignore"):
        faults_json = [fault_json(fault) for fault in check_record(record, rig, args.axis).faults]
    print(json.dumps({"channels": errors, "data": {"faults": faults_json}}, indent=2))
    return 0
