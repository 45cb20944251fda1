"""Floors that may as well lie deeper: of deep narrow holes views show the upper part of the walls only.

Silhouettes and edges do not tell where such a hole ends, nor how, and what they accept may be wrong below. So a floor
is told if views agree better about the places that they see on it than about those that they would see were it gone:
by some standard errors, however much deeper its walls go on.
"""

import numpy as np

from brepgaussian.artifacts.views import Views
from brepgaussian.brep.refine.observe import prepare, whole_images
from brepgaussian.brep.refine.pits import Pit, floors, pit_of
from brepgaussian.brep.refine.visibility import Scene
from brepgaussian.brep.structure import Structure

_DEEPER = (0.5, 1.0, 2.0)  # radii of a circle as large as the floor
_SIGMAS = 3.0  # by which views agree better on the floor


def untold_floors(scene: Scene, structure: Structure, views: Views) -> list[int]:
    """Faces of a solid that are floors, and of which the images do not tell that they are where they are.

    Args:
        scene: its triangulation.
        structure: its faces and edges.
        views: images and cameras.
    """
    found = floors(scene.mesh, structure)
    if not found:
        return []
    shown, noise, poses = whole_images(views), prepare(views).noise, np.zeros((len(views.cameras), 3))
    return [face for face in found if not is_told(pit_of(scene, structure, shown, noise, poses, face, 0.0))]


def is_told(pit: Pit) -> bool:
    """Whether views agree better about a floor than if it lay deeper."""
    if not len(pit.grey):
        return False
    now = pit.costs(0.0)
    below = sorted({min(share * pit.radius, pit.room) for share in _DEEPER})
    return all(pit.advantage(pit.costs(deeper), now) >= _SIGMAS for deeper in below)
