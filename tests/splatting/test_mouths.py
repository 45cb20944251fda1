"""Two mouths of one hole, each seen in part, against the discs they were cut from."""

import numpy as np
import pytest
from brepgaussian.splatting.concave.mouths import completed
from brepgaussian.splatting.concave.prism import Lattice, Prism, plane_axes

PITCH, CELLS = 0.004, 120


def lattice(normal, height):
    first, second = plane_axes(normal)
    middle = np.array([0.5, 0.5, height])
    return Lattice(middle - PITCH * CELLS / 2 * (first + second), first, second, normal, PITCH, (CELLS, CELLS))


def mouth(normal, height, sector, radius=0.15, missing=0.03):
    """A hole's mouth that is narrower by `missing` within 150 degrees about a direction in the x-y plane."""
    place = lattice(normal, height)
    offset = place.centers()[..., :2] - 0.5
    angle = np.arctan2(offset[..., 1], offset[..., 0])
    near = np.abs(np.angle(np.exp(1j * (angle - np.radians(sector))))) < np.radians(75)
    outline = np.linalg.norm(offset, axis=-1) < np.where(near, radius - missing, radius)
    return Prism(place, outline, 0.4, True, 0.05)


def measured(place, outline):
    """As if all of the outline told of the hole."""
    return Prism(place, outline, 0.4, True, 0.03), float(outline.sum())


UP, DOWN = np.array([0, 0, 1.0]), np.array([0, 0, -1.0])


@pytest.mark.parametrize("sector", [0, 70, 200])
def test_each_mouth_gets_what_the_other_shows(sector):
    prisms = [mouth(UP, 0.7, sector), mouth(DOWN, 0.3, sector + 180)]
    for (prism, _), whole in zip(
        completed([(p, float(p.outline.sum())) for p in prisms], measured),
        (mouth(UP, 0.7, 0, missing=0), mouth(DOWN, 0.3, 0, missing=0)),
        strict=True,
    ):
        wrong = (prism.outline != whole.outline).sum() / whole.outline.sum()
        assert wrong < 0.02


def test_what_explains_less_is_not_taken():
    found = [(mouth(UP, 0.7, 0), 1e6), (mouth(DOWN, 0.3, 180), 1e6)]
    assert completed(found, measured) == found


def test_mouths_beside_each_other_and_angular_ones_stay():
    square = lattice(UP, 0.7)
    outline = (np.abs(square.centers()[..., :2] - 0.5) < 0.1).all(axis=-1)
    half = outline & (square.centers()[..., 0] < 0.57)
    aside = mouth(DOWN, 0.3, 180, radius=0.06)
    for first, second in (
        (Prism(square, half, 0.4, True, 0.1), Prism(lattice(DOWN, 0.3), outline[:, ::-1], 0.4, True, 0.1)),
        (mouth(UP, 0.7, 0), aside),
        (mouth(UP, 0.7, 0), mouth(UP, 0.3, 180)),
    ):
        found = [(first, 1.0), (second, 1.0)]
        assert completed(found, measured) == found
