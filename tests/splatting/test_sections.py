"""Openings' outlines in cells and the sections that they are drawings of."""

import numpy as np
import pytest
from brepgaussian.splatting.concave.draw import border_of, fitted
from brepgaussian.splatting.concave.sections import Rounded, Section
from drawings import CENTER, SECTIONS, SHAPE, chewed, opened, raster
from hypothesis import assume, given
from hypothesis import strategies as st

PIECES = [
    ("circle", 1),
    ("slot", 4),
    ("rectangle", 4),
    ("pocket", 8),
    ("hexagon", 6),
    ("octagon", 8),
    ("keyed", 4),
    ("flatted", 2),
    ("bent slot", 4),
]


@pytest.mark.parametrize("name", SECTIONS)
@pytest.mark.parametrize("seed", [11, 12])
def test_the_section_of_a_chewed_outline_is_found(name, seed):
    true = SECTIONS[name]
    found = fitted(chewed(raster(true), seed), opened)
    assert found is not None
    assert type(found.shape) is type(true.shape)
    assert np.allclose(found.center, true.center, atol=0.4)
    assert np.abs(found.signed_distance(true.border(200))).max() < 1.2
    if isinstance(true.shape, Rounded):
        assert np.allclose(sorted(found.shape.half), sorted(true.shape.half), atol=0.5)
        assert abs(found.shape.radius - true.shape.radius) < (1.5 if name == "pocket" else 0.5)


@pytest.mark.parametrize("radius", [10.0, 13.4, 25.0])
@pytest.mark.parametrize("seed", [21, 22])
def test_small_corners_of_a_large_pocket_are_found(radius, seed):
    """Beginning from large ones, all places on them are outliers."""
    true = Section((106.7, 76.8), 0.003, Rounded((91.4, 60.8), radius))
    grid = np.stack(np.indices((215, 155)), axis=-1).astype(float)
    found = fitted(chewed(true.signed_distance(grid) < 0, seed), opened)
    assert found is not None
    assert np.allclose(found.shape.half, true.shape.half, atol=0.5)
    assert abs(found.shape.radius - radius) < 2.5


@pytest.mark.parametrize("cut", ["disc with two ears", "angle", "triangle"])
def test_other_outlines_have_no_section(cut):
    rows, columns = np.indices(SHAPE)
    disc = (rows - 45) ** 2 + (columns - 50) ** 2 < 20**2
    shapes = {
        "disc with two ears": disc | ((np.abs(columns - 50) < 6) & (np.abs(rows - 45) < 32)),
        "angle": disc & ((rows > 45) | (columns > 50)),
        "triangle": (rows > 20) & (rows - 20 > 1.5 * np.abs(columns - 50)) & (rows < 80),
    }
    assert fitted(shapes[cut], opened) is None


def test_narrow_and_empty_outlines_have_no_section():
    assert fitted(np.zeros(SHAPE, bool), opened) is None
    assert fitted(raster(Section(CENTER, 0.0, Rounded((20.0, 1.5), 0.0))), lambda cells: cells) is None


@given(
    angle=st.floats(-3, 3),
    half=st.tuples(st.floats(4, 30), st.floats(4, 30)),
    share=st.floats(0, 1),
    at=st.tuples(st.floats(-60, 60), st.floats(-60, 60)),
)
def test_distance_outside_is_that_to_a_drawing_of_the_border(angle, half, share, at):
    radius = share * min(half)
    section = Section((0.0, 0.0), angle, Rounded(half, radius))
    inner = np.array(half) - radius
    steps, turn = np.linspace(-1, 1, 401)[:, None], np.linspace(0, 2 * np.pi, 721)
    ring = radius * np.column_stack([np.cos(turn), np.sin(turn)])
    lines = [np.array([a, b]) * inner + ring for a in (-1, 1) for b in (-1, 1)]
    lines += [np.hstack([steps * inner[0], np.full_like(steps, side * half[1])]) for side in (-1, 1)]
    lines += [np.hstack([np.full_like(steps, side * half[0]), steps * inner[1]]) for side in (-1, 1)]
    c, s = np.cos(angle), np.sin(angle)
    drawing = np.concatenate(lines) @ np.array([[c, s], [-s, c]])
    distance = section.signed_distance(np.array([at]))[0]
    assume(distance > 0)
    assert abs(np.linalg.norm(drawing - np.array(at), axis=1).min() - distance) < 0.1


@pytest.mark.parametrize(("name", "count"), PIECES)
def test_pieces_are_the_faces_of_a_wall(name, count):
    section = SECTIONS[name]
    places = section.border(2000)
    pieces, normals = section.pieces(places), section.gradient(places)
    away = ~section.near_corners(places, 0.6)  # a border is traced in steps of half a cell
    assert np.abs(section.signed_distance(places[away])).max() < 0.05
    assert len(np.unique(pieces)) == count
    curved = {"circle": 180.0, "slot": 180.0, "bent slot": 180.0, "pocket": 91.0, "keyed": 180.0, "flatted": 180.0}
    for piece in np.unique(pieces):
        own = normals[(pieces == piece) & away]
        assert np.degrees(np.arccos(np.clip(own @ own.T, -1, 1))).max() <= curved.get(name, 1.0)


def test_border_lies_half_way_between_cells():
    cells = np.zeros((6, 7), bool)
    cells[2:4, 2:5] = True
    border = border_of(cells)
    assert len(border) == 10
    assert set(border[:, 0]) == {1.5, 2.0, 3.0, 3.5}
    assert set(border[:, 1]) == {1.5, 2.0, 3.0, 4.0, 4.5}
