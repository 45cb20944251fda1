"""Bosses in pockets, below their rims: geometry against boxes, and parts of other sizes than any that was looked at."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from brepgaussian.artifacts.truth import read_truth
from brepgaussian.artifacts.views import read_views
from brepgaussian.settings.views import ViewsSettings
from brepgaussian.splatting.concave import Prism
from brepgaussian.splatting.concave import carve as carve_module
from brepgaussian.splatting.concave import islands as islands_module
from brepgaussian.splatting.concave.bosses import _rectangles
from brepgaussian.splatting.concave.prism import Lattice
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.concave.sections import PIECES, Rounded, Section
from brepgaussian.splatting.concave.walls import Walls
from brepgaussian.splatting.hull import carve
from brepgaussian.views.stage import make_views
from build123d import Align, Box, Cylinder, Pos, Rot
from rendered import rendered

PITCH = 0.01


def pocket(section=None):
    """A pocket of 0.2 x 0.1 in the plane z = 0.5, 0.3 deep, with a boss of 0.06 x 0.06 whose top is 0.1 below."""
    lattice = Lattice(np.array([0.3, 0.3, 0.5]), *np.eye(3), PITCH, (40, 30))
    outline, boss = np.zeros((40, 30), bool), np.zeros((40, 30), bool)
    outline[10:30, 10:20] = True
    boss[17:23, 12:18] = True
    whole = Prism(lattice, outline, 0.3, False, 0.0)
    island = Prism(whole.lowered(0.1), boss, 0.2, False, 0.0, section=section)
    return replace(whole, islands=(island,))


def test_a_pocket_with_a_boss_is_the_pockets_box_without_the_bosss():
    points = np.random.default_rng(5).uniform([0.25, 0.25, 0.1], [0.75, 0.65, 0.6], (2000, 3))
    boxes = [([0.4, 0.4, 0.2], [0.6, 0.5, 0.52]), ([0.47, 0.42, -1], [0.53, 0.48, 0.4])]
    inside = [((points > low) & (points < high)).all(axis=1) for low, high in boxes]
    edges = np.concatenate([points - np.array(b) for box in boxes for b in box], axis=1)
    clear = np.abs(edges).min(axis=1) > 0.012  # a cell: corners of an outline are round
    found = pocket().signed_distance(points, 0.02) < 0
    assert np.array_equal(found[clear], (inside[0] & ~inside[1])[clear])
    assert (inside[0] & inside[1]).sum() > 10


def test_surfels_lie_on_a_bosss_walls_and_on_its_top():
    half = (3.0, 3.0)
    section = Section((19.5, 14.5), 0.0, Rounded(half, 0.0))
    walls = Walls([pocket(section)], PITCH)
    places = np.array([[0.533, 0.45, 0.3], [0.467, 0.45, 0.3], [0.5, 0.45, 0.402], [0.5, 0.45, 0.3]])
    facing = np.array([[1.0, 0, 0], [-1.0, 0, 0], [0, 0, 1.0], [1.0, 0, 0]])
    on = walls.under(places, facing)
    assert on.piece[0] != on.piece[1]
    assert min(on.piece[:2]) >= PIECES + 1  # the pocket's own are numbered below
    assert on.piece[2] == 2 * PIECES + 1  # the boss's top: past its pocket's pieces and floor, and its own pieces
    assert on.piece[3] == -1  # in the middle of the boss
    assert np.allclose(on.foot[:3], [[0.53, 0.45, 0.3], [0.47, 0.45, 0.3], [0.5, 0.45, 0.4]])
    assert np.allclose(on.normal[:3], facing[:3])


@pytest.mark.parametrize(("beside", "kept"), [(0.27, 2), (0.9, 3)], ids=["a part of the others", "a boss"])
def test_a_boss_that_leaves_much_is_asked_once_more_beside_the_others(monkeypatch, beside, kept):
    """Behind what is none, views see the others, which explain them as well."""
    whole = pocket()
    islands = [replace(whole.islands[0], error=e) for e in (0.16, 0.18, 0.6)]
    asked = []

    def seen(_rays, _standing, _cut, some):
        asked.extend(some)
        return [islands_module._Seen(some[0], 1.0, 0.46 / beside, 0.75 * beside >= 0.46)]

    monkeypatch.setattr(islands_module, "_seen", seen)
    hull = SimpleNamespace(without=lambda *_: SimpleNamespace(scene=lambda: None))
    told = [islands_module._Seen(island, 1.0, island.error, True) for island in islands]
    found = islands_module._beside_others(None, hull, whole, 0.0, told)
    assert len(found) == kept
    assert all(a is b for a, b in zip(found, islands, strict=False))
    assert len(asked) == 1
    assert asked[0] is islands[2]


@pytest.mark.parametrize(("deeper", "again"), [(0.1, True), (0.01, False)])
def test_bosses_are_sought_anew_where_a_floor_was_the_top_of_one(monkeypatch, deeper, again):
    first = pocket()
    taller = replace(first.islands[0], depth=0.25)
    sought = []

    def with_islands(_images, _hull, _uncut, known, k, _done):
        sought.append(known[k])
        return replace(known[k], islands=(taller, taller)), "filled"

    monkeypatch.setattr(carve_module, "sounded", lambda _i, _s, p: replace(p, depth=max(p.depth, 0.3 + deeper)))
    monkeypatch.setattr(carve_module, "_with_islands", with_islands)
    found, hull = carve_module._sounded_again(None, None, "hull", None, [first], 0, [])
    assert found.depth == pytest.approx(0.3 + deeper)
    assert (len(found.islands), hull) == ((2, "filled") if again else (1, "hull"))
    assert [(p.islands, p.depth) for p in sought] == [((), pytest.approx(0.3 + deeper))] * again


@pytest.mark.parametrize(("part", "seed", "interreflection"), [("boss_tray", 5, 0.9), ("post_pan", 6, 0.0)])
def test_bosses_below_a_rim_stand_where_they_are(tmp_path, part, seed, interreflection):
    settings = ViewsSettings(rendered_views=40, image_size=400, interreflection=interreflection)
    files = {"out_views": tmp_path / "views.h5", "out_truth": tmp_path / "truth.h5"}
    make_views(object_name="tray", source="part", path=f"{part}:{seed}", settings=settings, **files)
    views, truth = read_views(files["out_views"]), read_truth(files["out_truth"])
    hull, _ = carve(views, 128, concavities=True)
    (found,) = [prism for prism in hull.prisms if prism.islands]
    up = [f for f in np.unique(truth.point_face) if (truth.normals[truth.point_face == f] @ [0, 0, 1]).mean() > 0.99]
    middles = [truth.points[truth.point_face == f].mean(axis=0) for f in up]
    rim = max(middles, key=lambda m: m[2])[2]
    floor = found.lattice.origin[2] - found.depth
    tops = [m for m in middles if floor + 0.02 < m[2] < rim - 0.02]
    assert len(found.islands) == len(tops)
    assert abs(floor - min(m[2] for m in middles)) < 0.005  # told by the rays that meet none of them
    for top in tops:
        heights = [
            abs(island.lattice.origin[2] - top[2])
            for island in found.islands
            if island.lateral(island.lattice.coordinates(top[None])[0])[0] < 0
        ]
        assert min(heights) < 0.005


def test_bosses_in_the_corners_of_a_pocket_stand_where_they_are(tmp_path):
    """They touch two of its walls, and from above they have the grey of its floor."""
    low = (Align.CENTER, Align.CENTER, Align.MIN)
    case = Box(66, 48, 24, align=low) - Pos(0, 0, 4) * Box(58, 40, 24, align=low)
    for x, y in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
        case += Pos(24 * x, 15 * y, 4) * Box(10, 10, 13, align=low)
    views, truth = rendered(tmp_path, case, 40)
    hull, _ = carve(views, 128, concavities=True)
    scene = Scene(hull.vertices, hull.triangles)
    at = truth.mesh_vertices.min(axis=0) + np.array([33, 24, 0]) / 66
    posts = np.array([[24 * x, 15 * y, 14.5] for x in (-1, 1) for y in (-1, 1)]) / 66 + at
    above, beside = (posts + np.array([0, 0, d]) / 66 for d in (5.0, 0.0))
    beside[:, 0] -= np.sign(posts[:, 0] - at[0]) * 10 / 66
    assert (scene.signed_distance(posts) < 0).all()
    assert (scene.signed_distance(above) > 0).all()
    assert (scene.signed_distance(beside) > 0).all()


def test_a_rib_and_posts_that_channels_and_corners_would_cut_away_stand(tmp_path):
    """Round holes face each other in the walls beside them, and screw holes go through the posts near their corners."""
    low = (Align.CENTER, Align.CENTER, Align.MIN)
    case = Box(76, 54, 28, align=low) - Pos(0, 0, 4) * Box(69, 47, 28, align=low)
    case += Pos(4, 0, 4) * Box(5, 47, 13, align=low)
    for side in (-1, 1):
        case -= Pos(36 * side, 0, 17) * Rot(0, 90, 0) * Cylinder(7, 8)
    posts = [(29.5 * x, 18.5 * y) for x in (-1, 1) for y in (-1, 1)]
    for x, y in posts:
        case += Pos(x, y, 4) * Box(10, 10, 18, align=low)
    for x, y in posts:
        case -= Pos(x * 0.98, y * 0.98, 0) * Cylinder(2.3, 90)
    views, truth = rendered(tmp_path, case, 50, 600)
    regions = truth.face_ids.astype(np.int64) + 1
    hull, _ = carve(views, 160, concavities=True, patches=regions, relief=True)
    solid, found = Scene(truth.mesh_vertices, truth.mesh_triangles), Scene(hull.vertices, hull.triangles)
    low_corner = truth.mesh_vertices.min(axis=0)
    points = np.random.default_rng(0).uniform(low_corner, truth.mesh_vertices.max(axis=0), (100_000, 3))
    real, near = solid.signed_distance(points), found.signed_distance(points)
    inside = np.all(
        (points > low_corner + 6 / 76) & (points < truth.mesh_vertices.max(axis=0) - [5 / 76, 5 / 76, 0]), axis=1
    )
    clear = inside & (np.abs(real) > 1.5 / 160)
    assert (clear & (real < 0) & (near > 0)).sum() < 0.03 * (clear & (real < 0)).sum()
    assert (clear & (real > 0) & (near < 0)).sum() < 0.01 * (clear & (real > 0)).sum()


def test_long_narrow_holes_through_bosses_are_open_all_the_way(tmp_path):
    """Rays tell no depth of them; silhouettes or the far mouth do."""
    settings = ViewsSettings(rendered_views=40, image_size=500)
    files = {"out_views": tmp_path / "views.h5", "out_truth": tmp_path / "truth.h5"}
    make_views(object_name="case", source="part", path="board_case:5", settings=settings, **files)
    views, truth = read_views(files["out_views"]), read_truth(files["out_truth"])
    hull, _ = carve(views, 128, concavities=True)
    scene = Scene(hull.vertices, hull.triangles)
    whole = [
        f for f in np.unique(truth.point_face) if np.abs(truth.normals[truth.point_face == f].mean(axis=0)).max() < 0.2
    ]
    walls = [truth.points[truth.point_face == f] for f in whole]  # all around
    holes = [w for w in walls if np.ptp(w[:, :2], axis=0).max() < 0.07]
    assert len(holes) == 4
    for wall in holes:
        low, high = wall.min(axis=0), wall.max(axis=0)
        axis = np.linspace([*(low + high)[:2] / 2, low[2]], [*(low + high)[:2] / 2, high[2]], 20)
        assert (scene.signed_distance(axis) > 0).all()


GRID = np.stack(np.meshgrid(np.arange(90.0), np.arange(80.0), indexing="ij"), axis=-1)


def walled(turn=0.0):
    """A pocket of 60 by 44 cells."""
    walls = Section((45.0, 40.0), turn, Rounded((30.0, 22.0), 0.0))
    lattice = Lattice(np.zeros(3), *np.eye(3), PITCH, (90, 80))
    return Prism(lattice, walls.signed_distance(GRID) < 0, 0.3, False, 0.0, section=walls)


def boss(whole, outline):
    """What stands in it, a tenth below its rim."""
    return Prism(whole.lowered(0.1), outline, 0.2, False, 0.0)


@pytest.mark.parametrize("turn", [0.0, 0.35])
def test_the_section_of_a_boss_in_a_corner_reaches_into_its_walls(turn):
    """Its outline is ragged; the sides that face the pocket are where most of it ends."""
    post = Section((45 + 24 * np.cos(turn) - 16 * np.sin(turn), 40 + 24 * np.sin(turn) + 16 * np.cos(turn)), turn,
                   Rounded((6.0, 6.0), 0.0))  # fmt: skip
    whole = walled(turn)
    walls = whole.section
    outline = post.signed_distance(GRID) < 0
    outline |= (np.abs(GRID - np.array(post.center) + 5 * np.array([np.cos(turn), np.sin(turn)])) < 2.0).all(axis=-1)
    found = next(iter(_rectangles(whole, boss(whole, outline), np.zeros((90, 80)))))
    border = post.border(200)
    free = border[walls.signed_distance(border) < -1]
    assert np.abs(found.signed_distance(free)).max() < 1.0
    beyond = found.border(200)
    assert walls.signed_distance(beyond).max() > 2.0
    alone = Section((45.0, 40.0), turn, Rounded((6.0, 6.0), 0.0))
    island = boss(whole, alone.signed_distance(GRID) < 0)
    found = next(iter(_rectangles(whole, island, np.zeros((90, 80)))))
    assert np.abs(found.signed_distance(alone.border(200))).max() < 1.0


@pytest.mark.parametrize("past", [2, 6])
def test_the_sides_of_a_boss_are_where_views_show_steps(past):
    """Beside a floor of one grey the cells of its top go on, to one side, as far as its shadow is even."""
    whole = walled()
    rib = Section((45.0, 40.0), 0.0, Rounded((5.0, 12.0), 0.0))
    wider = Section((45.0 + past / 2, 40.0), 0.0, Rounded((5.0 + past / 2, 12.0), 0.0))
    slope = np.exp(-(rib.signed_distance(GRID) ** 2))
    island = boss(whole, wider.signed_distance(GRID) < 0)
    found = list(_rectangles(whole, island, slope))[-1]
    assert np.abs(found.signed_distance(rib.border(200))).max() <= 1.0


@pytest.mark.parametrize("wide", [1.0, 2.0, 2.6])
def test_sides_of_a_narrow_boss_do_not_cross(wide):
    """Narrower by three cells it would be nothing, and no border of that can be looked at."""
    whole = walled()
    rib = Section((45.2, 40.0), 0.0, Rounded((wide, 12.0), 0.0))
    slope = np.exp(-np.abs(GRID[..., 0] - 45))
    island = boss(whole, rib.signed_distance(GRID) < 0)
    for found in _rectangles(whole, island, slope):
        assert min(found.shape.half) > 0
        assert len(found.border(96)) == 96
