"""Corners around the feet of round bosses, against plates whose bosses are known."""

import numpy as np
import pytest
from brepgaussian.splatting.concave import Images, open_feet
from brepgaussian.splatting.concave.feet import Boss, _by_tops, _skirt
from brepgaussian.splatting.concave.prism import Lattice, plane_axes
from brepgaussian.splatting.concave.turned import Axis
from brepgaussian.splatting.concave.volume import Volume
from build123d import Box, Cylinder, Pos, fillet
from rendered import rendered

SIDE, THICK, RADIUS, TALL = 40.0, 6.0, 8.0, 10.0  # of a square plate and of the boss on it, mm; it fills the unit frame
CELLS = 128
AT = np.array([3.0, -2.0])  # of the boss
UP = np.array([0, 0, 1.0])
LOW = -(THICK + TALL) / 2  # of the plate; the part's middle lies in the unit frame's


def part(foot: float):
    """A plate with a boss, with a fillet of a radius around its foot."""
    solid = Box(SIDE, SIDE, THICK) + Pos(*AT, (THICK + TALL) / 2) * Cylinder(RADIUS, TALL)
    if foot:
        at = THICK / 2
        ring = [e for e in solid.edges() if abs(e.center().Z - at) < 1e-6 and abs(e.length - 2 * np.pi * RADIUS) < 1e-3]
        solid = fillet(ring, foot)
    return solid


def face(height: float, normal: np.ndarray, radius: float | None = None) -> tuple[Lattice, np.ndarray]:
    """A face at a height, mm: a disc about the boss's axis, or the whole plate without one."""
    first, second = plane_axes(normal)
    count, pitch = 161, 1.0 / 160
    middle = 0.5 + np.append(AT, height) / SIDE
    rows, columns = (np.mgrid[:count, :count] - count // 2) * pitch
    outline = np.hypot(rows, columns) < (radius if radius is not None else SIDE / 2) / SIDE
    origin = middle - (first + second) * pitch * count / 2
    return Lattice(origin, first, second, normal, pitch, (count, count)), outline


def hull(skirt: float) -> Volume:
    """The same with a cone around the foot, as wide as high."""
    places = (np.stack(np.meshgrid(*[np.arange(CELLS + 1) / CELLS] * 3, indexing="ij"), axis=-1) - 0.5) * SIDE
    x, y, z = np.moveaxis(places, -1, 0)
    around, height = np.hypot(x - AT[0], y - AT[1]), z - (LOW + THICK)
    plate = np.minimum(np.minimum(SIDE / 2 - np.abs(x), SIDE / 2 - np.abs(y)), np.minimum(z - LOW, -height))
    boss = np.minimum(np.minimum(RADIUS - around, TALL - height), z - LOW)
    cone = np.minimum((RADIUS + skirt - around - height) / np.sqrt(2), z - LOW)
    solid = np.maximum(plate, np.maximum(boss, cone) if skirt else boss)
    return Volume((solid / SIDE).astype(np.float32), np.zeros(3), 1 / CELLS)


def cut(views, skirt: float, top: float | None = None) -> np.ndarray:
    """(N, 2) places that are emptied, mm: distance from the boss's axis and height above the plate."""
    before = hull(skirt)
    faces = [face(LOW + THICK, UP), face(LOW, -UP)]
    faces += [] if top is None else [face(LOW + THICK + TALL, UP, top)]
    after = open_feet(Images.of(views, 0.0), before, faces)
    gone = (np.argwhere((before.field > 0) & (after.field <= 0)) / CELLS - 0.5) * SIDE
    return np.column_stack([np.linalg.norm(gone[:, :2] - AT, axis=1), gone[:, 2] - LOW - THICK])


@pytest.fixture(scope="module")
def views(tmp_path_factory):
    return rendered(tmp_path_factory.mktemp("foot"), part(0.0), 40, 500)[0]


@pytest.mark.parametrize("skirt", [2.0, 3.5])
def test_a_skirt_around_a_foot_is_cut(views, skirt):
    gone, voxel = cut(views, skirt), SIDE / CELLS
    assert gone[:, 0].min() > RADIUS - 1.5 * voxel
    assert gone[:, 1].min() > -1.5 * voxel
    inside = gone[:, 0] + gone[:, 1] < RADIUS + skirt  # all of the cone
    assert inside.sum() == pytest.approx(np.pi * skirt**2 * (RADIUS + skirt / 3) / voxel**3, rel=0.25)


@pytest.mark.parametrize("skirt", [2.0, 7.5])
def test_a_round_top_tells_where_a_wall_is_that_a_skirt_hides(views, skirt):
    gone = cut(views, skirt, RADIUS)
    assert gone[:, 0].min() > RADIUS - 1.5 * SIDE / CELLS
    assert gone[:, 0].max() > RADIUS + 0.8 * skirt


def test_a_boss_stands_on_the_next_face_below_its_top():
    faces = [
        face(height, way, radius) for height, way, radius in [(4, UP, 8), (1, UP, None), (-3, UP, None), (-6, -UP, 20)]
    ]
    (boss,) = [boss for boss in _by_tops(faces, 0.02) if boss.radius < 0.3]
    assert boss.radius == pytest.approx(8 / SIDE, abs=0.002)
    assert boss.height == pytest.approx(3 / SIDE)
    np.testing.assert_allclose(boss.axis.through, 0.5 + np.append(AT, 1) / SIDE, atol=0.004)
    assert not [boss for boss in _by_tops(faces, 0.2) if boss.radius < 0.3]  # too low


def test_a_bare_foot_has_none(views):
    assert len(cut(views, 0.0)) == 0


def test_a_foot_with_a_fillet_keeps_it(tmp_path):
    views, _ = rendered(tmp_path, part(3.0), 40, 500)
    assert len(cut(views, 2.5)) == 0
    assert len(cut(views, 2.5, RADIUS)) == 0


def test_a_skirt_ends_beside_an_arm():
    before = hull(2.0)
    foot = np.append(AT, LOW + THICK)
    places = (np.stack(np.meshgrid(*[np.arange(CELLS + 1) / CELLS] * 3, indexing="ij"), axis=-1) - 0.5) * SIDE - foot
    arm = np.minimum(np.minimum(2.0 - np.abs(places[..., 1]), places[..., 0]), 8.0 - places[..., 2]) / SIDE
    boss = Boss(Axis(0.5 + foot / SIDE, UP), RADIUS / SIDE, TALL / SIDE)
    ring = _skirt(before.with_field(np.maximum(before.field, arm.astype(np.float32))), boss)
    assert ring.width == pytest.approx(2 / SIDE, abs=2 / CELLS)
    assert ring.height == pytest.approx(2 / SIDE, abs=2 / CELLS)
    turn = 2 * np.pi * np.arange(len(ring.around)) / len(ring.around)
    first, second = plane_axes(UP)
    away = np.cos(turn)[:, None] * first + np.sin(turn)[:, None] * second
    arm = (away[:, 0] > 0) & (np.abs(away[:, 1]) * RADIUS < 2.0)
    assert not (ring.around & arm).any()
    assert ring.around[away[:, 0] < 0].all()
