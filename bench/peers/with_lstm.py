"""A small LSTM, from input to output, trained by Adam until the budget is spent."""

from __future__ import annotations

import torch
from common import PeerCase, PeerResult, scale

HIDDEN, LENGTH, BATCH, SKIP, RATE = 32, 300, 16, 30, 3e-3
"""Units; samples of a sequence; sequences of a step; samples at a sequence's start that no loss looks at."""


class Network(torch.nn.Module):
    """One layer and a linear read-out."""

    def __init__(self) -> None:
        super().__init__()
        self.layer = torch.nn.LSTM(1, HIDDEN, batch_first=True)
        self.out = torch.nn.Linear(HIDDEN, 1)

    def forward(self, u):
        """Return outputs, shape (batch, n), of inputs of this shape."""
        return self.out(self.layer(u[..., None])[0])[..., 0]


def fit(case: PeerCase) -> PeerResult:
    """Train, and run over all inputs."""
    torch.manual_seed(1)
    torch.set_num_threads(1)
    u, y, mean, size = scale(case)
    inputs, targets = (torch.tensor(a, dtype=torch.float32) for a in (u, y))
    network = Network()
    optimizer = torch.optim.Adam(network.parameters(), RATE)
    length, rounds = min(LENGTH, case.split - 1), 0
    while case.seconds_left > 0.15 * case.budget:
        starts = torch.randint(0, case.split - length, (BATCH,))
        at = starts[:, None] + torch.arange(length)
        loss = torch.mean((network(inputs[at]) - targets[at])[:, SKIP:] ** 2)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        rounds += 1
    with torch.no_grad():
        run = network(inputs[None, :])[0, case.split :].numpy()
    return PeerResult(mean + size * run, note=f"{HIDDEN} units, {rounds} steps of Adam")
