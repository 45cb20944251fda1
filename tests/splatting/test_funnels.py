"""Round concavities that are straight down to a cone: against cones by hand, and drawn solids."""

from dataclasses import replace

import numpy as np
import pytest
from blocks import disc
from brepgaussian.splatting.concave.join import told_once
from brepgaussian.splatting.concave.prism import Prism
from brepgaussian.splatting.concave.rays import Rays, exits_of_funnel
from brepgaussian.splatting.hull import carve
from build123d import Align, Axis, Box, BuildPart, BuildSketch, Cylinder, Mode, Plane, Polygon, Pos, revolve
from hypothesis import given
from hypothesis import strategies as st
from rendered import missed, rendered

LOW = (Align.CENTER, Align.CENTER, Align.MIN)
RADIUS, SINK, TOP, DRAFT = 20.0, 12.0, 8.0, 0.75  # cells


def round_cells(cells=60):
    rows = np.arange(cells) + 0.5 - cells / 2
    return np.hypot(rows[:, None], rows) < RADIUS


@given(at=st.floats(0, 0.95), around=st.floats(0, 6.28), sideways=st.tuples(st.floats(-2, 2), st.floats(-2, 2)))
def test_rays_meet_the_straight_walls_the_cone_or_the_throat(at, around, sideways):
    start, side = RADIUS * at * np.array([np.cos(around), np.sin(around)]), np.array(sideways)
    one = np.zeros(1)
    rays = Rays(start[None] + 29.5, side[None], one, one.astype(int), np.zeros((1, 0)), one > 0, one)
    found = float(exits_of_funnel(rays, round_cells(), 100.0, 0.0, DRAFT, SINK, TOP)[0])
    deep = np.linspace(0, 100, 20_001)
    radius = RADIUS - np.clip(DRAFT * (deep - TOP), 0, SINK)

    def first(radius):
        beyond = np.hypot(*(start + deep[:, None] * side).T) > radius
        return deep[np.argmax(beyond)] if beyond.any() else 100.0

    assert first(radius - 0.6) - 0.1 <= found <= first(radius + 0.6) + 0.1  # cells draw a circle to half a cell


@pytest.mark.parametrize("through", [False, True])
def test_a_funnel_is_a_cylinder_above_a_cone(through):
    funnel = replace(disc(0.3, 0.5, 0.01), through=through, draft=0.8, sink=0.2, step=0.1)
    wide, cone = funnel.parted()
    assert (wide.depth, wide.ring, wide.through, wide.draft) == (0.1, True, False, 0.0)
    assert (cone.through, cone.step) == (through, 0.0)
    points = np.random.default_rng(3).uniform([0.1, 0.1, 0.4], [0.9, 0.9, 1.05], (4000, 3))
    found = funnel.signed_distance(points, 0.0) < 0
    away, height = np.hypot(*(points[:, :2] - 0.5).T), points[:, 2]
    radius = 0.3 - np.clip(0.8 * (0.9 - height), 0, 0.2)
    inside = (height < 1) & (height > 0.5) & (away < radius)
    clear = np.abs(np.stack([away - radius, height - 1, height - 0.5, height - 0.9], axis=1)).min(axis=1) > 0.015
    assert np.array_equal(found[clear], inside[clear])


@pytest.mark.parametrize(
    ("throat", "straight", "cone"),
    [(6, 5, 20), (9, 14, 11)],
)
def test_a_funnel_is_opened_to_its_throat(tmp_path, throat, straight, cone):
    with BuildPart() as part:
        Box(60, 60, 40, align=LOW)
        with BuildSketch(Plane.XZ):
            low = 40 - straight - cone
            Polygon((0, 0), (throat, 0), (throat, low), (22, 40 - straight), (22, 40), (0, 40), align=None)
        revolve(axis=Axis.Z, mode=Mode.SUBTRACT)
    more, less = missed(*rendered(tmp_path, part.part, 40))
    assert more < 0.012
    assert less < 0.012


def test_a_straight_blind_bore_is_no_funnel(tmp_path):
    bored = Box(60, 60, 30, align=LOW) - Pos(0, 0, 12) * Cylinder(18, 30, align=LOW)
    views, _ = rendered(tmp_path, bored, 40)
    hull, _ = carve(views, 128, concavities=True)
    assert not any(prism.draft or prism.step for prism in hull.prisms)
    assert any(np.isclose(prism.depth, 18 / 60, atol=0.012) for prism in hull.prisms)


@pytest.mark.parametrize(("facing", "kept"), [((0, 0.6, 0.8), 1), ((0, 0, -1), 2)])
def test_skin_across_a_wide_through_mouth_is_no_other_opening(facing, kept):
    funnel = replace(disc(0.3, 1.0, 0.01), through=True, error=0.01)
    normal = np.array(facing, float)
    first = np.array([1.0, 0, 0])
    small = disc(0.08, 0.05, 0.01)
    shape = small.lattice.shape[0] * 0.01 / 2
    second = np.cross(normal, first)
    corner = np.array([0.5, 0.5, 0.7]) - shape * (first + second)
    lattice = replace(small.lattice, origin=corner, first=first, second=second, normal=normal)
    skin = Prism(lattice, small.outline, 0.05, facing[2] < 0, 0.05)
    assert len(told_once([funnel, skin], [], 0.02)) == kept
