"""Designed experiments against fixed ones: python -m bench experiment COMMAND LOG …

    causes LOG [FIRST COUNT] [--limits full|lab|work]   hidden-cause benches, one a line of LOG; resumes
    random LOG OUT [--limits …]   the random multisines of LOG once more, on the same benches, into OUT
    summary LOG                   the figures of those lines
    wire OUT                      the real driver on a simulated bench, an overload in the middle of a run
    limits RUNS                   limit violations in RUNS runs, true values drawn from their intervals

Truth is the second bench of test/independent. Every policy starts from the same poor log, 10 s of slow work
at 0.5 N m, weighs the same causes by the same rule, and stops at the same probability; what differs is the
run: designed; a piece of the paper's chirp, 20 s long, of the same peak as the limit; a random multisine of
the designed runs' power in 0.5 to 100 Hz, clipped at the limit. Causes are those that a
session weighs (experiment/weighed_causes.py).

Limits `full`: the bench near its rating (the paper's chirp has 20 N m). Limits `lab`: 3 N m, six times the
slow work, as for the first runs on a machine with a suspected fault. Limits `work`: 0.65 N m, the peak of
the slow work: no run is stronger than what the machine has already done. seconds: of all runs played, whole.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from bench import ROOT, parser_of

sys.path[:0] = [str(ROOT), str(ROOT / "test")]

from independent.bench import drawn_bench, record_command  # noqa: E402
from independent.hidden import hide  # noqa: E402
from independent.severities import SEVERITIES, drawn_parameters  # noqa: E402

from bench.experiment.figures import SECONDS, SHORTEST, print_figures  # noqa: E402
from bench.experiment.policies import RATE, Fixed, fixed_chirp, random_multisine  # noqa: E402
from bench.results import append_line, read_lines  # noqa: E402
from msg_adapters import write_record  # noqa: E402
from rsea_ros.cli._processes import Processes  # noqa: E402
from rsea_ros.cli.demo import EXCITED, patience  # noqa: E402
from rsea_ros.experiment.campaign import Budget, Campaign  # noqa: E402
from rsea_ros.experiment.hypothesis import motion  # noqa: E402
from rsea_ros.experiment.joint_weighing import USUAL, weigh  # noqa: E402
from rsea_ros.experiment.proposal import DesignRequest  # noqa: E402
from rsea_ros.experiment.run_design import propose  # noqa: E402
from rsea_ros.experiment.run_shape import RunLimits, largest_share, of_command, of_response  # noqa: E402
from rsea_ros.hardware.peer.remote import RemoteBench  # noqa: E402
from rsea_ros.identification.solver import worker_pools  # noqa: E402
from rsea_ros.model.rig_file import load_rig, save_rig  # noqa: E402
from rsea_ros.model.simulation import synthesize  # noqa: E402
from rsea_ros.records.record import Channel  # noqa: E402

LIMITS = {
    "full": RunLimits(torque=25.0, velocity=2.0, deflection=0.04),
    "lab": RunLimits(torque=3.0, velocity=2.0, deflection=0.04),
    "work": RunLimits(torque=0.65, velocity=2.0, deflection=0.04),
}
DESIGNS = 5
"""Benches whose designed runs are repeated for the limits."""
PER_RUN = 0.0
"""s that are as dear as one more run: the bench does not count runs."""


def hidden_case(k):
    """Return bench number k, its cause, and the parameters."""
    rng = np.random.default_rng([17, k])
    name = USUAL[k % len(USUAL)]
    severity = SEVERITIES[(k // len(USUAL) + k) % 3]
    bench = drawn_bench(rng)
    parameters = drawn_parameters(name, severity, rng)
    return bench, hide(bench, name, parameters), name, severity, parameters


def slow_work(seconds=10.0, amplitude=0.5):
    """Return a command with little information, N m."""
    t = np.arange(round(seconds * RATE)) / RATE
    return amplitude * np.sin(2.0 * np.pi * 0.25 * t) * (1.0 + 0.3 * np.sin(2.0 * np.pi * 0.07 * t))


def is_shown(plain, bench, limits):
    """Return whether the cause shows within the limits: in 20 s of chirp, beside the same noise."""
    command = fixed_chirp(limits)
    with_it, without = (record_command(b, command, np.random.default_rng(5)) for b in (bench, plain))
    sizes = {"ft": 0.03, "position": 6e-6}
    away = [np.sqrt(np.mean((with_it[n].y - without[n].y) ** 2)) / s for n, s in sizes.items()]
    return bool(max(away) > 0.3)


def play_policy(policy, first, weighing, bench, rig, rng, pools, limits):
    """Return the entry of a policy on a bench."""
    asked = DesignRequest(limits, RATE, SHORTEST, probe=1.0, refine=8, per_run=PER_RUN)

    def play(proposal):
        return record_command(bench, proposal.command, rng)

    campaign = Campaign(
        rig, USUAL, asked, play, Budget(seconds=SECONDS, runs=12), run=pools.run, choose=policy
    )
    outcome = campaign.go([first], weighing)
    return outcome, outcome_entry(outcome)


def one(k, pools, limits):
    """Return the line of bench k."""
    plain, bench, name, severity, parameters = hidden_case(k)
    rig, begun = load_rig("paper_high_impedance"), time.process_time()
    rng = np.random.default_rng([18, k])
    first = record_command(bench, slow_work(), rng)
    weighing = weigh([first], rig, USUAL, run=pools.run)
    same = (first, weighing, bench, rig, rng, pools, limits)
    designed, entry = play_policy(propose, *same)
    runs = [r.proposal.command for r in designed.rounds if r.proposal is not None]
    rms = float(np.sqrt(np.mean(np.concatenate([np.trim_zeros(u) for u in runs]) ** 2))) if runs else 0.0
    line = {"bench": k, "cause": name, "severity": severity, "parameters": parameters}
    line |= {"shown": is_shown(plain, bench, limits), "designed": entry, "rms": rms}
    if runs and designed.end == "confirmed":
        commands = {"chirp": fixed_chirp(limits), "random": random_multisine(rms, k, limits.torque)}
        line |= {n: play_policy(Fixed(u, SHORTEST), *same)[1] for n, u in commands.items()}
    return line | {"cpu": time.process_time() - begun}


def random_again(log, out, limits):
    """Write the lines of a log with the random multisine played once more."""
    rig = load_rig("paper_high_impedance")
    with worker_pools() as pools:
        for line in read_lines(log)[len(read_lines(out)) :]:
            if "random" in line:
                k = line["bench"]
                bench, rng = hidden_case(k)[1], np.random.default_rng([18, k])
                first = record_command(bench, slow_work(), rng)
                policy = Fixed(random_multisine(line["rms"], k, limits.torque), SHORTEST)
                weighing = weigh([first], rig, USUAL, run=pools.run)
                line["random"] = play_policy(policy, first, weighing, bench, rig, rng, pools, limits)[1]
                print(k, line["cause"], line["designed"]["seconds"], line["random"]["seconds"], flush=True)
            append_line(out, line)


def outcome_entry(outcome):
    """Return the part of an outcome that counts."""
    kinds = [getattr(getattr(r.proposal, "shape", None), "kind", "") for r in outcome.rounds if r.proposal]
    return {
        "end": outcome.end,
        "cause": outcome.cause,
        "probability": outcome.weighing.probability[outcome.cause],
        "seconds": outcome.seconds,
        "kinds": kinds,
        "proofs": [[p.bound.true, p.bound.rival, p.bound.most] for p in outcome.proofs],
        "left": outcome.weighing.left,
    }


def causes(log, first, count, limits):
    """Play benches and append their lines."""
    done = {entry["bench"] for entry in read_lines(log)}
    with worker_pools() as pools:
        for k in range(first, first + count):
            if k in done:
                continue
            line = one(k, pools, limits)
            append_line(log, line)
            played = {p: line[p] for p in ("designed", "chirp", "random") if p in line}
            short = {p: [e[n] for n in ("end", "cause", "seconds")] for p, e in played.items()}
            print(k, line["cause"], line["severity"], short, f"{line['cpu']:.0f} s", flush=True)


def limits(runs):
    """Count violations in designed runs on benches drawn from their intervals."""
    rig, rng, broken, worst, made = load_rig("paper_high_impedance"), np.random.default_rng(3), 0, 0.0, 0
    tight = RunLimits(torque=25.0, velocity=1.0, deflection=0.015, ft=22.0)
    with worker_pools() as pools:
        designs = []
        for k in range(DESIGNS):
            _, bench, *_ = hidden_case(k * 7)
            first = record_command(bench, slow_work(), np.random.default_rng([18, k]))
            possible = weigh([first], rig, USUAL, run=pools.run).hypotheses(0.005)[:7]
            asked = DesignRequest(tight, RATE, probe=1.0, refine=0)
            designs.append((possible, propose(possible, asked, run=pools.run)))
        for k in range(runs):
            possible, proposal = designs[k % len(designs)]
            shares = np.array([h.probability for h in possible])
            true = possible[rng.choice(len(possible), p=shares / shares.sum())].draws(1, rng)[0]
            peaks = of_response(proposal.command, motion(true, proposal.command, RATE))
            share = largest_share(peaks | of_command(proposal.command, RATE), tight)
            made, broken, worst = made + 1, broken + (share > 1.0), max(worst, share)
            if made % 1000 == 0:
                print(f"{made} runs, {broken} broke a limit, largest share used {worst:.3f}", flush=True)
    sizes = [d.peaks.at_level["torque"] for _, d in designs]
    print(f"{made} runs, {broken} broke a limit; largest share {worst:.3f}; torques {np.round(sizes, 1)}")


def wire(out):
    """Inject an overload into a run on a simulated bench; print when the torque was zero and how it ended."""
    rig = load_rig("paper_high_impedance").with_effect("current_loop_lag", time_constant=3e-3)
    out.mkdir(parents=True)
    save_rig(rig, out / "bench.yaml")
    command = slow_work(6.0, 0.6)
    write_record(synthesize(rig, Channel(np.arange(len(command)) / RATE, command), seed=1), out / "slow.mcap")
    values = {"bag": out / "slow.mcap", "out": out / "session", "limits": "torque=15", "ask": False}
    values |= {"causes": "current_loop_lag,command_delay", "longest": 4.0, "rig": "paper_high_impedance"}
    with Processes(out / "log", 77) as nodes, RemoteBench(out / "tty", "--rig", out / "bench.yaml") as bench:
        start = {"autostart": True, "resume": True}
        nodes.start("driver", {**bench.parameters(), **patience(), **EXCITED, **start})
        nodes.start("experiment", values)
        deadline = time.monotonic() + 120.0
        while not (abs(bench.torque()[0]) > 5) and time.monotonic() < deadline:
            time.sleep(0.01)
        moved = abs(bench.torque()[0])
        bench.ask("alert", bits=32)
        begun = time.monotonic()
        while bench.torque()[0] != 0 and time.monotonic() - begun < 5.0:
            time.sleep(0.001)
        zero = time.monotonic() - begun
        nodes.wait("experiment", 60.0)
        last = bench.torque()
    said = json.loads((out / "session" / "experiment.json").read_text())
    runs = len(list((out / "session").glob("run-*.mcap")))
    print(f"overload at {moved} counts: torque zero after {1e3 * zero:.0f} ms (counts, enabled: {last})")
    print(f"loop ended: {said['end']}: {said['why']}; seconds {said['seconds']}, runs kept {runs}")


def main(argv: Sequence[str]) -> None:
    """Run a command."""
    parser = parser_of(__doc__)
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    played = commands.add_parser("causes")
    played.add_argument("log", type=Path)
    played.add_argument("first", type=int, nargs="?", default=0)
    played.add_argument("count", type=int, nargs="?", default=60)
    played.add_argument("--limits", choices=LIMITS, default="full")
    again = commands.add_parser("random")
    again.add_argument("log", type=Path)
    again.add_argument("out", type=Path)
    again.add_argument("--limits", choices=LIMITS, default="full")
    commands.add_parser("summary").add_argument("log", type=Path)
    commands.add_parser("wire").add_argument("out", type=Path)
    commands.add_parser("limits").add_argument("runs", type=int, nargs="?", default=10_000)
    args = parser.parse_args(argv)
    if args.command == "limits":
        limits(args.runs)
    elif args.command == "wire":
        wire(args.out)
    elif args.command == "summary":
        print_figures(read_lines(args.log))
    elif args.command == "random":
        random_again(args.log, args.out, LIMITS[args.limits])
    else:
        causes(args.log, args.first, args.count, LIMITS[args.limits])
