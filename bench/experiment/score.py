"""Designed experiments against fixed ones: python -m bench experiment COMMAND LOG …

    causes LOG [FIRST COUNT] [--limits full|lab|work]   hidden-cause benches, one a line of LOG; resumes
    summary LOG                   the figures of those lines

Truth is the second bench of test/independent. Every policy starts from the same poor log, 10 s of slow work
at 0.5 N m, weighs the same causes by the same rule, and stops at the same probability; what differs is the
run: designed; a piece of the paper's chirp, 20 s long, of the same peak as the limit; a random multisine of
the designed runs' power in 0.5 to 100 Hz, clipped at the limit. Causes are those that a
session weighs (experiment/weighed_causes.py).

Limits `full`: the bench near its rating (the paper's chirp has 20 N m). Limits `lab`: 3 N m, six times the
slow work, as for the first runs on a machine with a suspected fault. Limits `work`: 0.65 N m, the peak of
the slow work: no run is stronger than what the machine has already done. seconds: of all runs played, whole.
"""

import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Annotated

import numpy as np
from independent.bench import drawn_bench, record_command
from independent.hidden import hide
from independent.severities import SEVERITIES, drawn_parameters
from scipy.optimize import brentq

from bench.results import read_lines, resumed
from rsea_ros.experiment.campaign import Budget, Campaign, Rules
from rsea_ros.experiment.joint_weighing import USUAL, weigh
from rsea_ros.experiment.proposal import DesignRequest, peaks
from rsea_ros.experiment.run_design import propose
from rsea_ros.experiment.run_shape import RunLimits, at_rest_around
from rsea_ros.identification.excitation import ExcitationSettings, chirp, ramp_ends
from rsea_ros.identification.solver import worker_pools
from rsea_ros.model.rig_file import load_rig

RATE, CHIRP = 280.0, 20.0
"""Hz; s."""
MOST = 0.99
"""Largest RMS of a clipped multisine as a share of its limit."""
LIMITS = {
    name: RunLimits(torque=torque, velocity=2.0, deflection=0.04)
    for name, torque in {"full": 25.0, "lab": 3.0, "work": 0.65}.items()
}
ALIKE = {"torque_constant_error", "ft_gain_error"}
"""No run separates these without another measurement: proved by experiment/bound.py on each bench."""
SECONDS = 20.0
"""s of excitation that a policy has."""
SHORTEST = 0.015
"""s of the first run of a policy, at least (four samples)."""
PER_RUN = 0.0
"""s that are as dear as one more run: the bench does not count runs."""


class Fixed:
    """Plays pieces of a command one after another, each as long as all before it together."""

    def __init__(self, command, shortest):
        self._command, self._at, self._shortest = command, 0, round(shortest * RATE)

    def __call__(self, hypotheses, asked, noise, run, tell):
        size = max(self._shortest, self._at)
        piece = self._command[self._at : self._at + size]
        self._at += len(piece)
        chances = (1.0,) * len(hypotheses)
        if hypotheses[0].probability >= Rules.confirmed:  # what a run within the limits could still show
            chances = propose(hypotheses, asked, noise, run, tell).chances
        run = ramp_ends(piece, min(round(0.25 * RATE), len(piece) // 4))
        return _Played(run, tuple(h.name for h in hypotheses), chances)


class _Played:
    """The part of a proposal that the campaign uses."""

    def __init__(self, run, names, chances):
        command = at_rest_around(run, RATE)
        self.command, self.duration, self.rate = command, len(run) / RATE, RATE
        self.names, self.chances = names, chances
        self.decided = self.resolved = 1.0
        self.peaks = peaks(command, RATE, ())
        self.hopeless, self.energy = (), float(np.sum(command**2) / RATE)


def fixed_chirp(limits):
    """Return the paper's chirp without its noise, at the torque limit, N m."""
    return chirp(
        ExcitationSettings(rate=RATE, duration=CHIRP, amplitude=limits.torque * 0.98, noise=0.0, low=0.05)
    )


def random_multisine(rms, seed, torque):
    """Return a multisine of random phases and equal lines in 0.5 to 100 Hz of some RMS, 20 s, N m.

    Clipped at the limit, and so much larger before that its RMS afterwards is as asked. Without clipping, its
    peak would be about four times its RMS.
    """
    rng = np.random.default_rng(seed)
    n = round(CHIRP * RATE)
    spectrum = np.zeros(n // 2 + 1, complex)
    lines = np.arange(round(0.5 * CHIRP), round(100.0 * CHIRP))
    spectrum[lines] = np.exp(2j * np.pi * rng.random(len(lines)))
    signal = np.fft.irfft(spectrum, n)
    signal, asked = signal / signal.std(), min(rms, MOST * torque)

    def excess(log_size):
        return float(np.std(np.clip(np.exp(log_size) * signal, -torque, torque)) - asked)

    size = np.exp(brentq(excess, np.log(0.5 * asked), np.log(1e4 * torque)))
    return np.clip(size * signal, -torque, torque)


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


def outcome_entry(outcome):
    """Return the part of an outcome that counts."""
    kinds = [getattr(getattr(r.proposal, "shape", None), "kind", "") for r in outcome.rounds if r.proposal]
    return {
        "end": outcome.end, "cause": outcome.cause, "seconds": outcome.seconds, "kinds": kinds,
        "probability": outcome.weighing.probability[outcome.cause], "left": outcome.weighing.left,
        "proofs": [[p.bound.true, p.bound.rival, p.bound.most] for p in outcome.proofs],
    }  # fmt: skip


def causes(
    log: Path, first: int = 0, count: int = 60, *, limits: Annotated[str, LIMITS] = "full"
) -> Iterator[str]:
    """Play hidden-cause benches, designed runs against fixed ones, and append their lines.

    log: JSON lines, a bench each
    first: number of a bench
    count: of benches
    """
    with worker_pools() as pools:
        works = ((k, partial(one, k, pools, LIMITS[limits])) for k in range(first, first + count))
        for line in resumed(log, works, "bench"):
            played = {p: line[p] for p in ("designed", "chirp", "random") if p in line}
            short = {p: [e[n] for n in ("end", "cause", "seconds")] for p, e in played.items()}
            yield f"{line['bench']} {line['cause']} {line['severity']} {short} {line['cpu']:.0f} s"


def summary(log: Path) -> Iterator[str]:
    """Print the figures of the lines of a log.

    log: of `causes`
    """
    lines = read_lines(log)
    apart = [x for x in lines if x["shown"] and x["cause"] not in ALIKE]
    right = [x for x in apart if good(x, "designed")]
    alike = [x for x in lines if x["cause"] in ALIKE]
    proved = [x for x in alike if x["designed"]["cause"] in ALIKE and x["designed"]["proofs"]]
    wrong = [x for x in lines if x["designed"]["end"] == "confirmed" and x["designed"]["cause"] != x["cause"]]
    yield f"benches {len(lines)}, of which a run within the limits can tell {len(apart)}"
    yield f"right unique cause {len(right)} of {len(apart)}; wrong name confirmed {len(wrong)}"
    yield f"torque constant or F/T gain: {len(proved)} of {len(alike)} said to be undecidable, with proof"
    for x in (x for x in apart if x not in right):
        yield f"  not: {x['bench']} {x['cause']} {x['severity']} {x['designed']}"
    pairs = [x for x in right if x["designed"]["seconds"] > 0]
    yield f"decided by the log alone: {len(right) - len(pairs)}; the others by policy:"
    for policy in ("chirp", "random") if pairs else ():
        yield from _pairs(pairs, policy)


def _pairs(pairs, policy):
    """Yield the seconds of a policy beside the designed runs, also where its first run was not enough."""
    # a policy that did not get as far as the right name has used all its seconds and would need more
    other = np.array([x[policy]["seconds"] if good(x, policy) else SECONDS for x in pairs])
    ours = np.array([x["designed"]["seconds"] for x in pairs])
    ratio = ours / other
    failed = sum(not good(x, policy) for x in pairs)
    less, more = int(np.sum(ratio < 0.99)), int(np.sum(ratio > 1.01))
    yield (f"  {policy}: median {np.median(other):.3f} s, designed {np.median(ours):.3f} s, paired median "
           f"ratio {np.median(ratio):.2f}, geometric mean {np.exp(np.mean(np.log(ratio))):.2f}; designed "
           f"shorter in {less}, equal in {len(pairs) - less - more}, longer in {more}; {failed} failed")
    long = other > SHORTEST
    if long.any():
        yield (f"    in the {long.sum()} pairs where it needs more than the shortest run: median "
               f"{np.median(other[long]):.3f} s, designed {np.median(ours[long]):.3f} s, paired median ratio "
               f"{np.median(ratio[long]):.2f}")


def good(x, policy):
    """Return whether a policy confirmed the right cause."""
    return x[policy]["end"] == "confirmed" and x[policy]["cause"] == x["cause"]
