"""Every number that steers a verdict: its meaning, its unit, and why it has this value.

data.py: blocks, pieces, levels of a residual; search.py: acceptance and fits; cause_names.py: names and
sizes; next_run.py: the recommended run. `identify` estimates noise and intervals by the same rules; their
settings lie in identification/noise_settings.py and interval_settings.py.

No setting: what happens to a record before any model (checks/, identification/even_stamps.py), where fits
begin (initial_guess.py, residual_peaks.py, identification/joint_start.py), the steps of derivatives, and what
is only shown (residual_analysis.py, coherence.lost_above). Those numbers stand with their reasons where they
are used (docs/decisions/0180-which-numbers-are-settings.md).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, fields

from rsea_ros.diagnosis.settings.groups import (
    AcceptanceSettings,
    BlockSettings,
    EvidenceSettings,
    FitSettings,
    FloorSettings,
    ForwardSettings,
    NamingSettings,
    NextRunSettings,
    PieceSettings,
    SizeSettings,
    StretchSettings,
)
from rsea_ros.documents.setting import Setting
from rsea_ros.errors import ParameterError
from rsea_ros.identification.settings import IntervalSettings, NoiseSettings

MOST_CAUSES = 4


@dataclass(frozen=True)
class DiagnosisSettings:
    """The effects that a diagnosis tries, and every number that steers its verdict.

    max_causes: the most causes, 1 or more; the search ends earlier where only noise is left. Four causes
    leave too little of the benchmark's records unexplained for a fifth.
    without: effects of the catalogue that are not tried.
    Raises ParameterError for a number below 1.
    """

    max_causes: int = MOST_CAUSES
    without: tuple[str, ...] = ()
    blocks: BlockSettings = field(default_factory=BlockSettings)
    floor: FloorSettings = field(default_factory=FloorSettings)
    acceptance: AcceptanceSettings = field(default_factory=AcceptanceSettings)
    fits: FitSettings = field(default_factory=FitSettings)
    stretches: StretchSettings = field(default_factory=StretchSettings)
    pieces: PieceSettings = field(default_factory=PieceSettings)
    forward: ForwardSettings = field(default_factory=ForwardSettings)
    evidence: EvidenceSettings = field(default_factory=EvidenceSettings)
    naming: NamingSettings = field(default_factory=NamingSettings)
    sizes: SizeSettings = field(default_factory=SizeSettings)
    next_run: NextRunSettings = field(default_factory=NextRunSettings)
    noise: NoiseSettings = field(default_factory=NoiseSettings)
    intervals: IntervalSettings = field(default_factory=IntervalSettings)

    def __post_init__(self) -> None:
        if self.max_causes < 1:
            raise ParameterError(f"max_causes = {self.max_causes}, expected 1 or more")
        object.__setattr__(self, "without", tuple(self.without))

    def numbers(self) -> Iterator[Setting]:
        """Yield every number of the groups with its meaning, unit and reason."""
        for group in (f.name for f in fields(self) if f.name not in ("max_causes", "without")):
            values = getattr(self, group)
            for f in fields(values):
                yield Setting(f"{group}.{f.name}", getattr(values, f.name), **f.metadata)


DEFAULT = DiagnosisSettings()
