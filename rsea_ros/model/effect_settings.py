"""Effects as people list them, by option or in a rig: each once, with values that it can have."""

from __future__ import annotations

from collections.abc import Sequence

from rsea_ros.effects.catalogue import effect_named
from rsea_ros.errors import FieldError, RseaError
from rsea_ros.model.rig import EffectSetting


def check_effects(settings: Sequence[EffectSetting]) -> None:
    """Raise FieldError for an effect that is unknown or listed twice, and for a value out of bounds."""
    for i, setting in enumerate(settings):
        if setting.name in (earlier.name for earlier in settings[:i]):
            raise FieldError(f"effect {setting.name} is given twice, expected once", f"effects[{i}]")
        try:
            effect_named(setting.name).check(setting.parameters)
        except RseaError as error:
            raise FieldError(str(error), f"effects[{i}].parameters") from None
