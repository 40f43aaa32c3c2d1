"""Which class of matter a row of the material table is of, for the material point method."""

from __future__ import annotations

from ...fem.mpm.classes import MaterialClass
from ...fem.scene.material_properties import load_flows
from ...fem.scene.materials import Material

# What yields plastically, what stands as it is built, what slides in grains, what flows; all else
# springs back.
_OF_CATEGORY = {
    "metal": MaterialClass.METAL,
    "stone": MaterialClass.STATIONARY,
    "soil": MaterialClass.SAND,
    "bulk solid": MaterialClass.SAND,
    "liquid": MaterialClass.FLUID,
}
_SNOW = ("snow", "fresh snow", "firn")
# Pastes whose yield stress and viscosity the table of flow does not have.
_PASTES = ("mud", "soft clay", "modelling clay", "butter")


def class_of(material: Material) -> MaterialClass:
    """Return the class of a row: by its name, by how it flows, else by its category."""
    if material.name in _SNOW:
        return MaterialClass.SNOW
    flow = load_flows().get(material.name)
    if material.name in _PASTES or (flow and flow.yield_stress and flow.viscosity):
        return MaterialClass.VISPLAS
    return _OF_CATEGORY.get(material.category, MaterialClass.JELLY)
