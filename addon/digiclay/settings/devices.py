"""Device of a new bed: preset, layout and method as one valid scene."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from ..core.model.layout import Layout
from ..core.scene.scene_source import load
from ..core.scene.schema import Scene
from ..core.scene.toml_table import PRESETS, resolve
from .own_presets import path

if TYPE_CHECKING:
    from ..core.control.blister import Blister

__all__ = ["change_layout", "fit_blister", "make_scene"]


def make_scene(preset: str, layout: Layout, method: str) -> Scene:
    """Return the scene of a preset, with another plan of the bed and another method.

    Parameters
    ----------
    preset : str
        One of the core's presets, or the name of the user's own.
    layout : Layout
    method : str
        A preset of the user's own keeps its gains when it is of this method.

    Raises
    ------
    DigiclayError
        When the preset cannot be read, or does not go together with the layout.
    """
    control = {"layout": {"arrangement": layout.arrangement}, "control": {"method": method}}
    if preset in PRESETS:
        return change_layout(resolve({"preset": preset, **control}), layout)
    scene = load(path(preset))
    if scene.method != method:
        plain = resolve(control)
        scene = replace(scene, method=method, control=plain.control, blister=plain.blister)
    return change_layout(scene, layout)


def change_layout(scene: Scene, layout: Layout) -> Scene:
    """Return a scene with another plan of the bed; a blister wider than the bed is made to fit.

    Parameters
    ----------
    scene : Scene
    layout : Layout
    """
    blister = scene.blister and fit_blister(scene.blister, layout)
    return replace(scene, layout=layout, blister=blister)


def fit_blister(blister: Blister, layout: Layout) -> Blister:
    """Return a blister that is at most as wide as the longer side of a bed, in the same proportions.

    Parameters
    ----------
    blister : Blister or None
    layout : Layout
    """
    widest = max(layout.columns * layout.pitch, layout.rows * layout.row_spacing) / 2
    if blister.radius <= widest:
        return blister
    share = widest / blister.radius
    return replace(
        blister,
        radius=widest,
        edge_radius=blister.edge_radius * share,
        flat_radius=blister.flat_radius * share,
        sigma=blister.sigma * share,
    )
