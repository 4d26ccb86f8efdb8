"""Figures of a log of python -m bench experiment: causes right, and excitation of each policy in pairs."""

from __future__ import annotations

import numpy as np

ALIKE = {"torque_constant_error", "ft_gain_error"}
"""No run separates these without another measurement: proved by experiment/bound.py on each bench."""
SECONDS = 20.0
"""s of excitation that a policy has."""
SHORTEST = 0.015
"""s of the first run of a policy, at least (four samples)."""


def print_figures(lines):
    """Print the figures of the lines of a log."""
    apart = [x for x in lines if x["shown"] and x["cause"] not in ALIKE]
    right = [x for x in apart if x["designed"]["end"] == "confirmed" and x["designed"]["cause"] == x["cause"]]
    alike = [x for x in lines if x["cause"] in ALIKE]
    proved = [x for x in alike if x["designed"]["cause"] in ALIKE and x["designed"]["proofs"]]
    wrong = [x for x in lines if x["designed"]["end"] == "confirmed" and x["designed"]["cause"] != x["cause"]]
    print(f"benches {len(lines)}, of which a run within the limits can tell {len(apart)}")
    print(
        f"right unique cause {len(right)} of {len(apart)}; wrong name confirmed {len(wrong)} of {len(lines)}"
    )
    print(f"torque constant or F/T gain: {len(proved)} of {len(alike)} said to be undecidable, with proof")
    for x in apart:
        if x not in right:
            print("  not:", x["bench"], x["cause"], x["severity"], x["designed"])
    pairs = [x for x in right if x["designed"]["seconds"] > 0]
    print(f"decided by the log alone: {len(right) - len(pairs)}; the others by policy:")
    for policy in ("chirp", "random") if pairs else ():
        _print_pairs(pairs, policy)


def _print_pairs(pairs, policy):
    """Print the seconds of a policy beside the designed runs, also where its first run was not enough."""
    # a policy that did not get as far as the right name has used all its seconds and would need more
    other = np.array([x[policy]["seconds"] if good(x, policy) else SECONDS for x in pairs])
    ours = np.array([x["designed"]["seconds"] for x in pairs])
    ratio = ours / other
    failed = sum(not good(x, policy) for x in pairs)
    less, more = int(np.sum(ratio < 0.99)), int(np.sum(ratio > 1.01))
    mean = np.exp(np.mean(np.log(ratio)))
    print(
        f"  {policy}: median {np.median(other):.3f} s, designed {np.median(ours):.3f} s, paired median "
        f"ratio {np.median(ratio):.2f}, geometric mean {mean:.2f}; designed shorter in {less}, equal in "
        f"{len(pairs) - less - more}, longer in {more}; {failed} not decided by it"
    )
    long = other > SHORTEST
    if long.any():
        print(
            f"    in the {long.sum()} pairs where it needs more than the shortest run: median "
            f"{np.median(other[long]):.3f} s, designed {np.median(ours[long]):.3f} s, paired median ratio "
            f"{np.median(ratio[long]):.2f}"
        )


def good(x, policy):
    """Return whether a policy confirmed the right cause."""
    return x[policy]["end"] == "confirmed" and x[policy]["cause"] == x["cause"]
