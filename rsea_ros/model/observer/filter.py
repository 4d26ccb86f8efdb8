"""The filter, compiled: the mean through the simulation's own step, the covariance through the linear model.

    predict   z = step(z, u), with the effects of the model as known torques;   P = F P F' + Q + g s_u^2 g'
    update    S = h P h' + r,  K = P h' / S,  z += K nu,  P = (I - K h) P (I - K h)' + K r K'   (Joseph)

F and Q are exact for any time between stamps (transition.py). g is the response to a motor torque held for
that time, s_u its doubt. Source: Anderson, Moore, Optimal Filtering, 1979, sections 3.1 and 6.7.

What the model lacks is learnt from the innovations nu, by channel; r is the stated variance of the noise:

    position   Q and s_u^2 times phi,  phi *= 1 + (h P h' / S) (nu^2 / S - 1) / n: the score of ln phi
               (Creal, Koopman, Lucas, Journal of Applied Econometrics 28, 2013)
    ft         ft = h z + m + v, m of variance M, which lacks: S = h P h' + M + r', T_d = h z + M / S nu.
               M: the mean of nu^2 over h P h' + r' (covariance matching: Myers, Tapley, IEEE Trans. Automatic
               Control 21, 1976); r' = r, or more where nu is white (Mehra, ibid. 15, 1970)

So T_d becomes the reading, of variance r', as M grows. M is at least kappa times what the stated spreads
of the spring make (consider parameters: Schmidt, 1966); kappa: the share that nu confirms, 1 at first.
"""

from functools import partial
from typing import Any, NamedTuple

import numpy as np

from rsea_ros.compiler import njit
from rsea_ros.effects import signal_table as st
from rsea_ros.effects.effect import compiled
from rsea_ros.model.drive import LONGEST_STEP
from rsea_ros.model.observer.transition import exponential, transition
from rsea_ros.model.step import OUTPUTS, Calls, Linear, StepInputs, StepState, advance
from rsea_ros.records.record import FloatArray

POSITION, WRENCH, TORQUE = range(3)
NOW, FORCED, SINCE, ERROR, STARTED, CLOCK = range(6)
"""In `clock`: time (s), command in force (N m), since when (s), what the drive makes beside it (N m)."""
SIGMA = 3
FIXED, WALK, LACK, STATED, LEFT, _, COUNT, POWER, FIRST, SECOND, LAST, BEFORE, DOUBT, BRIEF = range(14)
"""In `learnt`: 1 where nothing is learnt; phi; M, N^2 m^2; what the spreads make of it; what of it the last
ft has left in T_d and in T_p; of the innovations of ft over sqrt(S): number, means of their squares and of
one times the last and the one before, these two; mean of the doubt by spreads; from BRIEF on: means of
squares over WINDOWS."""
LONG, START = 2048.0, 16.0
"""Samples: 2048 tell a variance to 3 %; 16 are 50 ms at 280 Hz, in which friction has to show."""
WINDOWS, LIMITS = (128.0, 16.0, 1.0), (1.43, 3.13, 32.8)
"""Samples of shorter means of nu^2, and the part of S that these pass by chance in 1 of 10^8, of 10^5 for the
longest, which drifts (chi-square)."""
WHITE = 2.0 * np.log(LONG)
"""Of n (rho_1^2 + rho_2^2), up to which the innovations are white: Schwarz, Annals of Statistics 6, 1978, for
two coefficients. Beyond twice of it they are not, and from fewer samples than that nobody can tell."""
LEAST, MOST = 1e-2, 1e8
"""Of phi. Below a hundredth the walk is less than an encoder shows within a minute; 1e8 follows any drive."""
USUAL = 100.0
"""Of sqrt(S): a larger nu counts as this one, so that one wrong sample is forgotten within 2 LONG."""
SAME = 1e-6
SHORTEST = 1e-7
"""s. Stamps nearer than this are the same instant."""
GATE = 4.0
"""Sigmas of the measured motor torque beyond which it, and no longer the command, is what the motor makes."""


inner: Any = partial(njit, cache=True, nogil=True, error_model="numpy",
                     no_cpython_wrapper=True, no_cfunc_wrapper=True)()  # fmt: skip
"""For functions that only compiled ones call: what Python would need to call them takes long to compile."""


once: Any = partial(njit, cache=True, nogil=True, error_model="numpy", inline="always")()
"""For functions that one place calls."""


class FilterModel(NamedTuple):
    """The constants of the filter; only `held` changes: step for which linear.phi, f and q hold, s.

    measured: rows of position and ft on z, shape (2, n). spreads: rows of the torques by one sigma of the
    spring's values. noise: variances of position, ft, motor torque. hold: how long a command stays in
    force, s.
    """

    linear: Linear
    calls: Calls
    block: FloatArray
    block_scale: FloatArray
    a: FloatArray
    walk: FloatArray
    scale: FloatArray
    f: FloatArray
    q: FloatArray
    measured: FloatArray
    spreads: FloatArray
    noise: FloatArray
    estimated: FloatArray
    torques: FloatArray
    held: FloatArray
    hold: float


class FilterState(NamedTuple):
    """All that changes, as views of `whole`, so that a copy of one array is a checkpoint.

    extra: (d[, zero]). reach: g. predicted: position, ft, measured motor torque. estimate: T_d, T_p, d, their
    sigmas. score: by channel the sum of nu^2 / S, their number, the sum of nu.
    """

    whole: FloatArray
    x: FloatArray
    extra: FloatArray
    p: FloatArray
    table: FloatArray
    effect_x: FloatArray
    reach: FloatArray
    predicted: FloatArray
    estimate: FloatArray
    clock: FloatArray
    score: FloatArray
    learnt: FloatArray


@compiled
def disturbance(s, p, x):  # type: ignore[no-untyped-def]
    """Add the disturbance and the drive's torque beside its command, p[0], to the torque on the gear."""
    s[st.GEAR_TORQUE] += p[0]


@once
def predict(model, state, t):  # type: ignore[no-untyped-def]
    """Go to an instant; a command older than `hold` ends on the way, as the bench ends it."""
    end, reached = state.clock[SINCE] + model.hold, False
    while not reached:
        reached = state.clock[FORCED] == 0.0 or t <= end
        _propagate(model, state, t if reached else end)
        if not reached:
            state.clock[FORCED] = 0.0


@once
def _propagate(model, state, t):  # type: ignore[no-untyped-def]
    dt = t - state.clock[NOW]
    if dt < SHORTEST:
        return
    count = int(np.ceil(dt / LONGEST_STEP - 1e-6))
    _set_step(model, state.table, dt / count)
    if abs(dt - model.held[1]) > SAME * dt:
        transition(model.a, model.walk, model.scale, dt, model.f, model.q)
        model.held[1] = dt
    model.calls.p[0] = state.extra[0] + state.clock[ERROR]
    command, out, none = np.full(count, state.clock[FORCED]), np.empty((count, len(OUTPUTS))), np.empty(0)
    inputs = StepInputs(command, none, none, state.clock[NOW], False, np.empty((0, 4)))
    advance(model.linear, model.calls, inputs, StepState(state.x, state.table, state.effect_x), out)
    n = len(state.x)
    for i in range(n):
        state.reach[i] = model.f[i, n]
    _spread(model, state)
    state.clock[NOW] = t
    state.predicted[POSITION], state.predicted[WRENCH] = out[count - 1, 0], out[count - 1, 3]
    state.predicted[TORQUE] = out[count - 1, 2]
    if len(state.extra) > 1:
        state.predicted[POSITION] += state.extra[1]
    _estimate(model, state)


@inner
def _set_step(model, table, h):  # type: ignore[no-untyped-def]
    """Make the propagators of a step of h seconds, where the last one was another."""
    linear, n = model.linear, len(model.linear.phi)
    if abs(h - model.held[0]) > SAME * h:
        whole = np.empty(model.block.shape)
        exponential(model.block, model.block_scale, h, whole)
        for i in range(n):
            for j in range(n):
                linear.phi[i, j] = whole[i, j]
            for j in range(linear.g.shape[1]):
                linear.g[i, j] = whole[i, n + j]
        model.held[0] = h
    table[st.STEP] = model.held[0]
    table[st.MOBILITY] = 0.0
    for i in range(n):
        table[st.MOBILITY] += linear.spans[0, i] * linear.g[i, 0]


@inner
def _spread(model, state):  # type: ignore[no-untyped-def]
    """Let the covariance grow over the time of f and q."""
    p, n, walk = state.p, len(state.p), state.learnt[WALK]
    torque = min(walk, 1.0) * model.noise[TORQUE]
    fp = np.zeros((n, n))
    for i in range(n):
        for k in range(n):
            if model.f[i, k] != 0.0:
                for j in range(n):
                    fp[i, j] += model.f[i, k] * p[k, j]
    for i in range(n):
        for j in range(i + 1):
            value = walk * model.q[i, j]
            for k in range(n):
                value += fp[i, k] * model.f[j, k]
            if i < len(state.reach):
                value += torque * state.reach[i] * state.reach[j]
            p[i, j] = p[j, i] = value


@inner
def _estimate(model, state):  # type: ignore[no-untyped-def]
    """Read the torques on both ends from the state and from the torques that the last step ended with."""
    s, n = state.table, len(state.x)
    for k in range(2):
        value = model.torques[k, 0] * s[st.COMMAND]
        for port in range(5):
            value += model.torques[k, port] * s[st.FIRST_FORCE + port]
        for i in range(n):
            value += model.estimated[k, i] * state.x[i]
        state.estimate[k] = value
    state.estimate[2] = state.extra[0]
    learnt, stated = state.learnt, 0.0
    for k in range(len(model.spreads)):
        torque = 0.0
        for i in range(n):
            torque += model.spreads[k, i] * state.x[i]
        stated += torque * torque
    learnt[STATED] = stated
    learnt[LEFT] = learnt[LEFT + 1] = _lack(learnt, model.noise[WRENCH])


@inner
def _lack(learnt, r):  # type: ignore[no-untyped-def]
    """Return M, N^2 m^2: learnt, or stated so far as the innovations of ft confirm it."""
    n = min(learnt[COUNT], LONG)
    kappa = (r + n * learnt[LACK]) / (r + n * learnt[DOUBT]) if n > 0.0 else 1.0
    return max(learnt[LACK], min(kappa, 1.0) * learnt[STATED])


@inner
def doubt(model, state):  # type: ignore[no-untyped-def]
    """Put the sigmas of the estimates beside them; the doubt in the motor's torque is part of both."""
    n, x, walk = len(state.p), len(state.x), state.learnt[WALK]
    # where phi is small the true walk lies between none and phi's, which makes half of P: 3/4 of P count
    share = 1.0 if state.learnt[FIXED] == 1.0 else 1.0 - 0.25 * min(1.0, 0.1 / walk)
    for k in range(2):
        variance = min(walk, 1.0) * model.noise[TORQUE] * model.torques[k, 0] ** 2
        for i in range(n):
            for j in range(n):
                variance += model.estimated[k, i] * state.p[i, j] * model.estimated[k, j]
        state.estimate[SIGMA + k] = np.sqrt(share * variance + state.learnt[LEFT + k])
    state.estimate[SIGMA + 2] = np.sqrt(state.p[x, x])


@inner
def update(model, state, channel, value):  # type: ignore[no-untyped-def]
    """Correct the state by a measured position (rad) or ft (N m); a value that is not finite is ignored."""
    if not (np.isfinite(value) and np.isfinite(model.noise[channel])):
        return
    p, h, r, n = state.p, model.measured[channel], model.noise[channel], len(state.p)
    ph, s = np.zeros(n), r
    for i in range(n):
        for j in range(n):
            ph[i] += p[i, j] * h[j]
    for i in range(n):
        s += h[i] * ph[i]
    error, own, learnt, lack = value - state.predicted[channel], s - r, state.learnt, 0.0
    _score(state, channel, error, r + own / max(learnt[WALK], 1.0))
    if learnt[FIXED] == 0.0:
        if channel == POSITION or not np.isfinite(model.noise[POSITION]):
            surprise = min(error * error / s, USUAL * USUAL) - 1.0
            learnt[WALK] = min(max(learnt[WALK] * (1.0 + own / s * surprise / START), LEAST), MOST)
        else:
            r = _learn(learnt, error, own, r)
            lack = _lack(learnt, model.noise[WRENCH])
            s = own + lack + r
            for k in range(2):
                shared = 0.0
                for i in range(n):
                    shared += model.estimated[k, i] * ph[i]
                state.estimate[k] += lack / s * error
                learnt[LEFT + k] = lack - lack * (2.0 * shared + lack) / s
    gain = ph / s
    _joseph(p, gain, h, r + lack)
    _shift(model, state, gain * error)


@inner
def _learn(learnt, error, own, r):  # type: ignore[no-untyped-def]
    """Learn M from an innovation of ft (N m). own: h P h', r: stated noise, N^2 m^2. Return the noise r'."""
    learnt[COUNT] += 1.0
    n, known = min(learnt[COUNT], LONG), own + r
    error = min(max(error / np.sqrt(known), -USUAL), USUAL)
    learnt[POWER] += (error * error - learnt[POWER]) / n
    learnt[FIRST] += (error * learnt[LAST] - learnt[FIRST]) / n
    learnt[SECOND] += (error * learnt[BEFORE] - learnt[SECOND]) / n
    learnt[BEFORE], learnt[LAST] = learnt[LAST], error
    learnt[DOUBT] += (learnt[STATED] - learnt[DOUBT]) / n
    power = max(learnt[POWER], 1e-9)  # of a sensor that repeats one value
    correlation = n * (learnt[FIRST] ** 2 + learnt[SECOND] ** 2) / (power * power)
    white = min(max(2.0 - correlation / WHITE, 0.0), 1.0) if n > 2.0 * WHITE else 0.0
    excess = max(power - 1.0, 0.0) * known
    noise, lack = r + white * excess, (1.0 - white) * max(excess, learnt[FIRST] * known)
    for i in range(len(WINDOWS)):
        learnt[BRIEF + i] += (error * error - learnt[BRIEF + i]) / min(n, WINDOWS[i])
        size, expected = learnt[BRIEF + i] * known, own + noise + (lack if WINDOWS[i] == 1.0 else 0.0)
        if size > LIMITS[i] * expected:
            lack = max(lack, size - own - noise)
    learnt[LACK] = lack
    return noise


@inner
def _joseph(p, gain, h, r):  # type: ignore[no-untyped-def]
    n = len(p)
    left, hp = np.empty((n, n)), np.zeros(n)
    for j in range(n):
        for k in range(n):
            hp[j] += h[k] * p[k, j]
    for i in range(n):
        for j in range(n):
            left[i, j] = p[i, j] - gain[i] * hp[j]
    for i in range(n):
        lh = 0.0
        for k in range(n):
            lh += left[i, k] * h[k]
        for j in range(i + 1):
            p[i, j] = p[j, i] = left[i, j] + (r * gain[i] - lh) * gain[j]


@inner
def _shift(model, state, change):  # type: ignore[no-untyped-def]
    """Add a change of z, shape (n,), to the state and to all that was read from it."""
    x = len(state.x)
    for i in range(x):
        state.x[i] += change[i]
    for i in range(x, len(change)):
        state.extra[i - x] += change[i]
    for k in range(2):
        for i in range(len(change)):
            state.predicted[k] += model.measured[k, i] * change[i]
            state.estimate[k] += model.estimated[k, i] * change[i]
    state.estimate[2] = state.extra[0]


@inner
def weigh_torque(model, state, value):  # type: ignore[no-untyped-def]
    """Compare the measured motor torque (N m) with the command, and correct a contradiction at once."""
    if not np.isfinite(value) or model.noise[TORQUE] == 0.0:
        return
    error = value - state.predicted[TORQUE]
    _score(state, TORQUE, error, model.noise[TORQUE])
    believed = error if error * error > GATE * GATE * model.noise[TORQUE] else 0.0
    change = believed - state.clock[ERROR]
    if change != 0.0:
        state.clock[ERROR] = believed
        z = np.zeros(len(state.p))
        for i in range(len(state.x)):
            z[i] = state.reach[i] * change
        _shift(model, state, z)
        for k in range(2):
            state.estimate[k] += model.torques[k, 0] * change


@inner
def _score(state, channel, error, variance):  # type: ignore[no-untyped-def]
    state.score[3 * channel] += error * error / variance
    state.score[3 * channel + 1] += 1.0
    state.score[3 * channel + 2] += error
