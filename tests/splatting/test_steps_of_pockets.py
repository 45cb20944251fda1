"""Cases: a pocket behind a thin rim, and one that narrows at a shoulder; against drawn solids and by hand."""

import numpy as np
import pytest
from brepgaussian.splatting.concave.prism import Lattice, Prism
from brepgaussian.splatting.concave.rays import Rays, exits_of_step
from brepgaussian.splatting.concave.rimmed import _turned
from brepgaussian.splatting.hull import carve
from build123d import Align, Axis, Box, Pos, chamfer
from hypothesis import example, given
from hypothesis import strategies as st
from rendered import missed, rendered

LOW = (Align.CENTER, Align.CENTER, Align.MIN)
HALF, SINK, TOP = 20.0, 5.0, 8.0  # cells: of a square opening, and of its shoulder
NEAR = 0.3  # cells: a drawn corner is rounded by .2


def square(cells=60):
    rows = np.abs(np.arange(cells) + 0.5 - cells / 2) < HALF
    return rows[:, None] & rows


@example(at=(0, 0.6875), sideways=(1, 0.09375))
@given(
    at=st.tuples(st.floats(-0.95, 0.95), st.floats(-0.95, 0.95)),
    sideways=st.tuples(st.floats(-2, 2), st.floats(-2, 2)),
)
def test_rays_meet_the_wide_walls_the_shoulder_or_the_narrow_walls(at, sideways):
    start, side = HALF * np.array(at), np.array(sideways)
    one = np.zeros(1)
    rays = Rays(start[None] + 29.5, side[None], one, one.astype(int), np.zeros((1, 0)), one > 0, one)
    found = float(exits_of_step(rays, square(), 100.0, 0.0, SINK, TOP)[0])
    deep = np.linspace(0, 100, 20_001)
    lateral = np.abs(start + deep[:, None] * side).max(axis=1)

    def left(slack: float) -> float:
        """Depth at which the ray has left walls that stand `slack` cells further out."""
        beyond = lateral > np.where(deep < TOP, HALF, HALF - SINK) + slack
        return float(deep[np.argmax(beyond)]) if beyond.any() else 100.0

    # A ray that grazes a wall is near it for many cells of depth: what counts is how near.
    assert left(-NEAR) - NEAR < found < left(NEAR) + NEAR


def test_a_pocket_with_a_shoulder_is_two_boxes():
    lattice = Lattice(np.array([0.2, 0.2, 0.5]), *np.eye(3), 0.01, (60, 60))
    pocket = Prism(lattice, square(), 0.3, False, 0.0, sink=0.05, step=0.08)
    wide, narrow = pocket.parted()
    points = np.random.default_rng(3).uniform([0.2, 0.2, 0.15], [0.8, 0.8, 0.55], (4000, 3))
    found = np.minimum(wide.signed_distance(points, 0.0), narrow.signed_distance(points, 0.0)) < 0
    away, height = np.abs(points[:, :2] - 0.5).max(axis=1), points[:, 2]
    inside = (height < 0.5) & (height > 0.2) & (away < np.where(height > 0.42, 0.2, 0.15))
    edges = np.stack([away - 0.2, away - 0.15, height - 0.5, height - 0.42, height - 0.2], axis=1)
    clear = np.abs(edges).min(axis=1) > 0.015  # corners of outlines are round
    assert np.array_equal(found[clear], inside[clear])
    assert np.array_equal(pocket.signed_distance(points, 0.0) < 0, found)


def test_a_turned_lattice_keeps_its_middle():
    lattice = Lattice(np.array([0.2, 0.3, 0.5]), *np.eye(3), 0.01, (60, 40))
    turned = _turned(lattice, np.array([0.1, 0.2, 1.0]) / np.linalg.norm([0.1, 0.2, 1.0]))
    assert np.allclose(turned.centers().mean(axis=(0, 1)), lattice.centers().mean(axis=(0, 1)))
    axes = np.stack([turned.first, turned.second, turned.normal])
    assert np.allclose(axes @ axes.T, np.eye(3))
    assert np.linalg.det(axes) > 0


@pytest.mark.parametrize(("rim", "lip", "drop"), [(2.5, 0.0, 0.0), (2.0, 2.0, 4.0)])
def test_a_case_with_a_thin_rim_is_opened_down_to_its_floor(tmp_path, rim, lip, drop):
    case = Box(58, 40, 22, align=LOW)
    inner = 2 * (rim + lip)
    case -= Pos(0, 0, 4) * Box(58 - inner, 40 - inner, 30, align=LOW)
    if lip:
        case -= Pos(0, 0, 22 - drop) * Box(58 - 2 * rim, 40 - 2 * rim, 30, align=LOW)
    more, less = missed(*rendered(tmp_path, case, 40))
    assert more < 0.01
    assert less < 0.005


def test_a_chamfered_pocket_has_no_shoulder(tmp_path):
    block = Box(60, 44, 20, align=LOW) - Pos(0, 0, 8) * Box(36, 22, 30, align=LOW)
    rim = [e for e in block.edges().group_by(Axis.Z)[-1] if abs(e.center().X) < 20 and abs(e.center().Y) < 15]
    views, _ = rendered(tmp_path, chamfer(rim, 3), 40)
    hull, _ = carve(views, 128, concavities=True)
    pocket = max(hull.prisms, key=lambda prism: prism.area)
    assert pocket.draft > 0.7
    assert np.isclose(pocket.sink, 3 / 60, atol=0.012)
    assert np.isclose(pocket.depth, 12 / 60, atol=0.012)
    assert not any(prism.ring for prism in hull.prisms)
