"""Changes of a rig's structure by effects."""

from __future__ import annotations

from rsea_ros.effects.catalogue import effect_named
from rsea_ros.model.rig import Rig


def with_structure(rig: Rig) -> Rig:
    """Return the rig with the changes of structure by its effects (a compliant gear or base).

    Raises ParameterError for wrong parameters, and for an effect that this rig cannot have.
    """
    for setting in rig.effects:
        effect = effect_named(setting.name)
        effect.vector(setting.parameters)
        if effect.structure is not None:
            rig = effect.structure(rig, effect.complete(setting.parameters))
    return rig
