"""Torque commanded by a page: soft start, a limit, and zero when no page holds it.

torque(t) = envelope(t) · shape(t), |shape| ≤ 1. The envelope grows and shrinks by at most `growth` and
falls to zero within RELEASE when the hold ends. Another shape begins when that of the one before is zero.
"""

import math
import threading
from dataclasses import dataclass

from rsea_ros.extension.base import ParameterError

PATIENCE = 0.4
"""s without a heartbeat of the page after which nobody holds the command; it beats every 0.1 s."""
RELEASE = 0.02
"""s from any torque to zero when the hold ends, as the driver's own ramp."""
CLOSING = 0.1
"""s of zeros after that, before the commands cease."""
KINDS = ("constant", "sine", "chirp")
LOWEST, SWEEP = 0.1, 20.0
"""Hz at which a chirp begins; s in which it rises to its frequency, evenly by octaves, and falls back."""
HIGHEST = 60.0


@dataclass(frozen=True)
class Bounds:
    """Bounds of a command: torque N m, slew N m/s; growth of the envelope N m/s."""

    torque: float
    slew: float = math.inf
    growth: float = 20.0


@dataclass(frozen=True)
class Wish:
    """A page's request. amplitude: N m, also negative. frequency: Hz, of a chirp the highest."""

    kind: str = "constant"
    amplitude: float = 0.0
    frequency: float = 1.0

    @property
    def shape(self) -> tuple[str, float]:
        """The factor of the envelope; the sign of a constant belongs to its envelope."""
        return (self.kind, self.frequency if self.kind != "constant" else 0.0)


def check_wish(wish: Wish, bounds: Bounds) -> Wish:
    """Return a wish that may be commanded. Raises ParameterError for any other."""
    if wish.kind not in KINDS:
        raise ParameterError(f"kind {wish.kind!r}, expected one of {', '.join(KINDS)}")
    if not abs(wish.amplitude) <= bounds.torque:  # also what is not a number
        raise ParameterError(f"amplitude {wish.amplitude:g} N·m, expected at most {bounds.torque:g} N·m")
    if wish.kind != "constant" and not LOWEST < wish.frequency <= HIGHEST:
        raise ParameterError(
            f"frequency {wish.frequency:g} Hz, expected above {LOWEST:g} and at most {HIGHEST:g} Hz"
        )
    slew = 2.0 * math.pi * wish.shape[1] * abs(wish.amplitude)
    if slew > bounds.slew:
        raise ParameterError(
            f"{wish.amplitude:g} N·m at {wish.frequency:g} Hz change by {slew:.0f} N·m/s,"
            f" expected at most {bounds.slew:g} N·m/s, the driver's slew_limit"
        )
    return wish


class Commander:
    """Who holds the command, and the torque now. Times are s of a monotonic clock; any thread may call.

    bounds: None until they are known; then nothing may be held. holder: who holds it, None: nobody. active:
    whether commands are to be published.
    """

    def __init__(self, bounds: Bounds | None = None) -> None:
        self.bounds = bounds
        self.holder: object = None
        self._lock = threading.Lock()
        self._wish, self._running = Wish(), Wish()
        self._heard = self._began = self._last = self._zero_since = 0.0
        self._envelope = self._fall = 0.0
        self.active = False

    def hold(self, who: object, wish: Wish, now: float) -> bool:
        """Hold the command or continue to; return whether the page has it.

        A page repeats this as its heartbeat.
        Raises ParameterError for a forbidden command.
        """
        if self.bounds is None:
            raise ParameterError("the limits of the bench are not known yet")
        wish = check_wish(wish, self.bounds)
        with self._lock:
            if self._holds(now) and self.holder != who:
                return False
            if not self.active:
                self.active, self._last, self._running, self._envelope = True, now, wish, 0.0
                self._began = now
            self.holder, self._wish, self._heard = who, wish, now
            return True

    def release(self, who: object) -> None:
        with self._lock:
            if self.holder == who:
                self._let_go()

    def torque(self, now: float) -> float | None:
        """Return the torque to command now, N m; None: publish nothing (any more)."""
        with self._lock:
            if not self.active or self.bounds is None:
                return None
            step, self._last = max(0.0, now - self._last), now
            if self.holder is not None and not self._holds(now):
                self._let_go()
            self._move(step, now)
            if self.holder is None and self._envelope == 0.0 and now - self._zero_since > CLOSING:
                self.active = False
                return None
            value = self._envelope * _shape(self._running, now - self._began)
            return min(max(value, -self.bounds.torque), self.bounds.torque)

    def _holds(self, now: float) -> bool:
        return self.holder is not None and now - self._heard <= PATIENCE

    def _let_go(self) -> None:
        self.holder, self._fall = None, abs(self._envelope) / RELEASE

    def _move(self, step: float, now: float) -> None:
        if self.holder is None or self.bounds is None:
            aim, most = 0.0, self._fall * step
        else:
            alike = self._wish.shape == self._running.shape
            aim, most = self._wish.amplitude if alike else 0.0, self.bounds.growth * step
        before = self._envelope
        self._envelope += min(max(aim - before, -most), most)
        if self._envelope == 0.0:
            self._zero_since = now if before != 0.0 else self._zero_since or now
            if self.holder is not None and self._running != self._wish:
                self._running, self._began = self._wish, now
        else:
            self._zero_since = 0.0


def _shape(wish: Wish, t: float) -> float:
    """Return the value of a shape, -1 to 1, some s after it began."""
    if wish.kind == "constant":
        return 1.0
    if wish.kind == "sine":
        return math.sin(2.0 * math.pi * wish.frequency * t)
    rounds, rest = divmod(t, 2.0 * SWEEP)
    turn = _chirp_phase(wish.frequency, SWEEP)
    phase = _chirp_phase(wish.frequency, min(rest, 2.0 * SWEEP - rest))
    phase = 2.0 * turn - phase if rest > SWEEP else phase
    return math.sin(2.0 * rounds * turn + phase)


def _chirp_phase(highest: float, t: float) -> float:
    """Return the phase, rad, of a chirp that has risen for t s."""
    rate = math.log(highest / LOWEST) / SWEEP
    return 2.0 * math.pi * LOWEST / rate * math.expm1(rate * t)
