"""What effects change of a rig's structure."""

from __future__ import annotations

from rsea_ros.effects.catalogue import effect_named
from rsea_ros.model.rig import Rig


def structured(rig: Rig) -> Rig:
    """Return the rig with what its effects change of its structure (a gear or a base that gives).

    Raises ParameterError for an effect whose parameters are wrong, or that this rig cannot have.
    """
    for setting in rig.effects:
        effect = effect_named(setting.name)
        effect.vector(setting.parameters)
        if effect.structure is not None:
            rig = effect.structure(rig, effect.complete(setting.parameters))
    return rig
