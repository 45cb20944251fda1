"""Arrangement, evidence, cut, gate and structure on solids with known answers."""

from itertools import product

import numpy as np
import pytest
from brep_support import patches_of
from brepgaussian.brep import occ, solid
from brepgaussian.brep.build_faces import build_face
from brepgaussian.brep.cells import arrange, sample_triangles
from brepgaussian.brep.evidence import cell_volumes, gather
from brepgaussian.brep.gate import examine, integrity
from brepgaussian.brep.labelling import _cut, one_body
from brepgaussian.brep.patches import Patch, make_patches
from brepgaussian.brep.polyhedron import polyhedral
from brepgaussian.brep.sheets import make_sheet
from brepgaussian.brep.silhouettes import make_silhouettes
from brepgaussian.brep.structure import extract
from brepgaussian.geometry.surfaces import cylinder, plane, sphere, torus
from brepgaussian.settings.brep import BrepSettings
from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut, BRepAlgoAPI_Fuse
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt


def box(low, high):
    return BRepPrimAPI_MakeBox(gp_Pnt(*map(float, low)), gp_Pnt(*map(float, high))).Shape()


def arrangement_of(patches, margin=0.04):
    sheets = [make_sheet(i, patches, margin) for i in range(len(patches))]
    return arrange([build_face(s) for s in sheets], [s.patch for s in sheets], 1e-5)


def test_cells_of_a_block_with_a_hole(kit):
    known = kit.block_with_hole()
    patches = make_patches(known.primitives.items, known.points, 0.05)
    found = arrangement_of(patches)
    assert found.cells == 2  # the block and the bore
    np.testing.assert_allclose(np.bincount(found.sample_facet, found.sample_weight), found.area, rtol=1e-2)
    free, volume = cell_volumes(found, None)
    bore = np.pi * 0.2**2 * 0.5
    np.testing.assert_allclose(np.sort(volume), [bore, known.volume], rtol=0.03)
    assert not free.any()
    views = kit.make_views(kit.box_corners(np.array([1.0, 0.8, 0.25])))  # as if the upper half were air
    silhouettes = make_silhouettes(views.alpha, views.cameras, 10, 200)
    free, volume = cell_volumes(found, silhouettes)
    assert 0.2 < free.sum() / volume.sum() < 0.55
    evidence = gather(found, patches, None)
    used = [i for i, o in enumerate(found.origins) if o and found.area[i] > 0.01]
    assert min(evidence.coverage[i] for i in used if found.origins[i] == (6,)) > 0.95


def test_a_hemisphere_on_a_plate_closes():
    """Poles on its rim, in the plate's plane, would leave its sheet no margin there."""
    rng = np.random.default_rng(3)
    middle, radius, side, deep = np.array([0.5, 0.5, 0.5]), 0.37, 0.45, 0.3
    out = rng.normal(size=(6000, 3))
    out /= np.linalg.norm(out, axis=1)[:, None]
    out[:, 2] = np.abs(out[:, 2])
    surfaces, clouds = [sphere(middle, radius)], [middle + radius * out]
    ring = rng.uniform(-side, side, (6000, 2))
    ring = ring[np.hypot(*ring.T) > radius]
    surfaces.append(plane(middle, np.eye(3)[2]))
    clouds.append(middle + np.column_stack([ring, np.zeros(len(ring))]))
    surfaces.append(plane(middle - deep * np.eye(3)[2], -np.eye(3)[2]))
    clouds.append(middle + np.column_stack([rng.uniform(-side, side, (3000, 2)), np.full(3000, -deep)]))
    for axis, sign in product((0, 1), (-1.0, 1.0)):
        wall = np.column_stack([rng.uniform(-side, side, (1500, 2)), rng.uniform(-deep, 0, 1500)])
        wall[:, axis] = sign * side
        surfaces.append(plane(middle + sign * side * np.eye(3)[axis], sign * np.eye(3)[axis]))
        clouds.append(middle + wall)
    found = arrangement_of(patches_of(surfaces, clouds))
    _, volume = cell_volumes(found, None)
    dome = 2 / 3 * np.pi * radius**3
    np.testing.assert_allclose(np.sort(volume), np.sort([dome, (2 * side) ** 2 * deep]), rtol=0.03)


def bent_rod(rng, noise=0.0):
    """Patches of a rod bent by a right angle: torus, two cylinders and two ends, with the volume."""
    ring, rod, arm = 0.3, 0.08, 0.35
    centre, x, y, z = np.array([0.2, 0.2, 0.5]), *np.eye(3)

    def tube(count, middle, out, up):
        turn = rng.uniform(0, 2 * np.pi, count)[:, None]
        normals = np.cos(turn) * out + np.sin(turn) * up
        return middle + rod * normals, normals

    angle, along = rng.uniform(0, np.pi / 2, (4000, 1)), rng.uniform(0, arm, (3000, 1))
    out = np.cos(angle) * x + np.sin(angle) * y
    faces = [
        (torus(centre, z, ring, rod), *tube(4000, centre + ring * out, out, z)),
        (cylinder(centre + ring * x, y, rod), *tube(3000, centre + ring * x - along * y, x, z)),
        (cylinder(centre + ring * y, x, rod), *tube(3000, centre + ring * y - along * x, y, z)),
    ]
    for end, normal, across in ((centre + ring * x - arm * y, -y, x), (centre + ring * y - arm * x, -x, y)):
        turn, radius = rng.uniform(0, 2 * np.pi, (600, 1)), rod * np.sqrt(rng.uniform(0, 1, (600, 1)))
        xyz = end + radius * (np.cos(turn) * across + np.sin(turn) * z)
        faces.append((plane(end, normal), xyz, np.tile(normal, (600, 1))))
    reach = 0.02
    patches = [
        Patch(s, k, xyz + noise * rng.normal(size=xyz.shape), n, reach, 0.001) for k, (s, xyz, n) in enumerate(faces)
    ]
    return patches, np.pi * rod**2 * (2 * arm + ring * np.pi / 2)


@pytest.mark.parametrize("seed", range(3))
def test_a_ball_ends_a_bend(seed):
    """Half a ball in the place of one straight piece: its sheet ends where the tube does."""
    rng = np.random.default_rng(seed)
    (bend, pipe, _, end, _), _ = bent_rod(rng)
    ring, rod, middle = bend.surface, bend.surface.minor, bend.surface.origin + bend.surface.radius * np.eye(3)[1]
    out = rng.normal(size=(2000, 3))
    out /= np.linalg.norm(out, axis=1)[:, None]
    out[:, 0] = -np.abs(out[:, 0])
    ball = Patch(sphere(middle, rod), 4, middle + rod * out, out, bend.reach, bend.sigma)
    patches = [bend, pipe, end, ball]
    assert np.abs(make_sheet(3, patches, 0.04).limits[2:]).min() < 1e-6  # the equator
    found = arrangement_of(patches)
    _, volume = cell_volumes(found, None)
    arm = np.ptp(pipe.xyz[:, 1])
    expected = np.pi * rod**2 * (arm + ring.radius * np.pi / 2 + 2 / 3 * rod)
    np.testing.assert_allclose(volume, [expected], rtol=0.03)


@pytest.mark.parametrize("seed", range(3))
def test_a_whole_tube_goes_on_in_a_bend(seed):
    """The seam of the torus must not open the cell, wherever its points have their largest gap."""
    patches, volume = bent_rod(np.random.default_rng(seed), 0.001)
    found = arrangement_of(patches)
    assert found.cells == 1
    assert cell_volumes(found, None)[1].sum() == pytest.approx(volume, rel=0.03)


@pytest.mark.parametrize("seed", range(4))
def test_a_whole_boss_stays_whole_where_a_wall_touches_it(seed):
    """Wherever the largest gap between its points lies, beside a wall's line of contact too."""
    rng = np.random.default_rng(seed)
    middle, radius, count = np.full(3, 0.5), 0.2, 2500
    boss, wall = cylinder(middle, np.array([0, 0, 1.0]), radius), plane(middle + radius * np.eye(3)[0], np.eye(3)[0])
    turn = rng.uniform(0, 2 * np.pi, count)
    turn = turn[turn > 0.05]  # the gap beside the contact at turn 0
    out = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(len(turn))])
    xyz = middle + radius * out + rng.uniform(-0.2, 0.2, (len(turn), 1)) * [0, 0, 1]
    flat = wall.origin + rng.uniform([0, 0, -0.2], [0, 0.3, 0.0], (count, 3))
    patches = [
        Patch(boss, 0, xyz, out, 0.04, 0.0),
        Patch(wall, 1, flat, np.tile(wall.axis, (count, 1)), 0.02, 0.0),
    ]
    low, high = make_sheet(0, patches, 0.04).limits[:2]
    assert high - low == pytest.approx(2 * np.pi)


def test_minimum_cut_against_all_labellings():
    rng = np.random.default_rng(5)
    for _ in range(20):
        n = 5
        front, back = rng.integers(0, n + 2, 9), rng.integers(0, n + 2, 9)
        front, back = np.where(front == n, n + 1, front), np.where(back == n, n + 1, back)  # no facet at the source
        pair, inside_cost, outside_cost = rng.random(9), rng.random(n), rng.random(n)

        def energy(label, front=front, back=back, pair=pair, i=inside_cost, o=outside_cost):
            state = np.append(label, [1, 0])
            return (pair * (state[front] != state[back])).sum() + (np.where(label, i, o)).sum()

        found = _cut(front, back, pair, inside_cost, outside_cost, n, n + 1)
        best = min(energy(np.array(labels)) for labels in product([0, 1], repeat=n))
        assert energy(found.astype(int)) == pytest.approx(best, abs=1e-4)


def test_one_body_keeps_the_largest(kit):
    known = kit.block_with_hole()
    found = arrangement_of(make_patches(known.primitives.items, known.points, 0.05))
    _, volume = cell_volumes(found, None)
    both = one_body(found, np.array([True, True]), volume, 1e-3)
    assert both.all()
    assert one_body(found, np.array([False, False]), volume, 1e-3).sum() == 0


def test_structure_knows_convex_concave_and_smooth():
    ell = BRepAlgoAPI_Cut(box((0, 0, 0), (1, 1, 1)), box((0.5, -1, 0.5), (2, 2, 2))).Shape()
    shape = solid.clean(occ.solids(ell)[0])
    surfaces = [
        plane([0, 0, 0], [-1, 0, 0]), plane([1, 0, 0], [1, 0, 0]), plane([0, 0, 0], [0, -1, 0]),
        plane([0, 1, 0], [0, 1, 0]), plane([0, 0, 0], [0, 0, -1]), plane([0, 0, 1], [0, 0, 1]),
        plane([0.5, 0, 0], [-1, 0, 0]), plane([0, 0, 0.5], [0, 0, 1]),
    ]  # fmt: skip
    structure = extract(shape, surfaces)
    assert sorted(f.surface for f in structure.faces) == list(range(8))
    kinds = {tuple(sorted(e.surfaces)): e.convexity for e in structure.edges}
    assert len(structure.edges) == 18
    assert kinds.pop((6, 7)) == "concave"
    assert set(kinds.values()) == {"convex"}
    assert [f.flipped for f in structure.faces if f.surface == 6] == [True]  # given the other way round
    assert sum(v.corner for v in structure.vertices) == 12
    tool = BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(0.5, 0.5, -1), gp_Dir(0, 0, 1)), 0.2, 3).Shape()
    bored = solid.clean(occ.solids(BRepAlgoAPI_Cut(box((0, 0, 0), (1, 1, 1)), tool).Shape())[0])
    structure = extract(bored, [*surfaces[:6], cylinder([0.5, 0.5, 0], [0, 0, 1], 0.2, True)])
    rims = [e for e in structure.edges if 6 in e.surfaces]
    assert len(rims) == 2
    assert all(e.closed and e.kind == "circle" and e.convexity == "convex" for e in rims)
    assert not [f for f in structure.faces if f.flipped]


def test_gate_sees_what_is_wrong(kit):
    known = kit.block_with_hole(sigma=0.002)
    patches = make_patches(known.primitives.items, known.points, 0.05)
    block = box((0, 0.1, 0.25), (1, 0.9, 0.75))
    filled = examine(block, patches, None, BrepSettings())
    assert filled.explained[6] == 0
    assert any("patch 6" in d for d in filled.doubts)
    open_shell = occ.compound(occ.faces(block)[:5])
    assert integrity(open_shell)
    pair = BRepAlgoAPI_Fuse(block, box((2, 2, 2), (3, 3, 3))).Shape()
    assert "2 solids" in integrity(pair)[0]
    assert integrity(block) == ()


@pytest.mark.parametrize(("direction", "moved"), [((0, 0, -1.0), True), ((0, 0, 1.0), False)])
def test_a_label_that_ends_elsewhere_is_a_doubt_about_its_border_only(direction, moved):
    """A fifth of the top's points lie on the wall below its rim; or they stand in the air above it."""
    rng = np.random.default_rng(2)
    corner, across = np.zeros(3), np.eye(3)
    top = np.column_stack([rng.uniform(0.02, 0.98, (800, 2)), np.ones(800)])
    beyond = np.column_stack([np.ones(200), rng.uniform(0.02, 0.98, 200), np.ones(200)])
    beyond += rng.uniform(0.1, 0.3, (200, 1)) * np.array(direction)
    patches = [
        Patch(plane(across[2], across[2]), 0, np.concatenate([top, beyond]), np.tile(across[2], (1000, 1)), 0.05, 1e-3)
    ]
    for k, (origin, normal) in enumerate(
        [
            (corner, -across[2]),
            (across[0], across[0]),
            (corner, -across[0]),
            (across[1], across[1]),
            (corner, -across[1]),
        ],
        start=1,
    ):
        xyz = rng.uniform(0.02, 0.98, (1000, 3))
        xyz += (normal @ (origin - xyz).T)[:, None] * normal
        patches.append(Patch(plane(origin, normal), k, xyz, np.tile(normal, (1000, 1)), 0.05, 1e-3))
    verdict = examine(box((0, 0, 0), (1, 1, 1)), patches, None, BrepSettings())
    assert verdict.doubts == ("patch 0 is explained to 80%",)
    assert verdict.borders == (verdict.doubts if moved else ())
    assert verdict.with_moved_borders().doubts == (() if moved else verdict.doubts)


def test_samples_are_spread_evenly():
    corners = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 0], [0, 1, 0.0]]])
    points, normals, _, weight = sample_triangles(corners, 0.05)
    assert weight.sum() == pytest.approx(1.0)
    np.testing.assert_allclose(normals, np.tile([0, 0, 1.0], (len(points), 1)))
    counts = np.histogram2d(points[:, 0], points[:, 1], bins=5, range=[[0, 1], [0, 1]])[0]
    assert counts.min() > 0.6 * counts.mean()


@pytest.mark.parametrize("with_views", [True, False])
def test_polyhedron_closes(kit, with_views):
    known = kit.block_with_hole(sigma=0.005)
    views = kit.make_views(kit.box_corners(np.array([1.0, 0.8, 0.5])))
    silhouettes = make_silhouettes(views.alpha, views.cameras, 10, 200) if with_views else None
    data, _ = polyhedral(known.points.xyz.astype(float), known.points.normals.astype(float), silhouettes, 200)
    shape = occ.from_bytes(data)
    assert integrity(shape) == ()
    assert occ.volume(shape) == pytest.approx(known.volume, rel=0.25)


def test_drawn_silhouettes_have_the_right_size(kit):
    """Against the convex hull of the projected corners, pixel centre by pixel centre."""
    from scipy.spatial import ConvexHull

    corners = kit.box_corners(np.array([1.0, 0.8, 0.5]))
    views = kit.make_views(corners)
    silhouettes = make_silhouettes(views.alpha, views.cameras, 3, 200)
    for view in range(3):
        drawn = silhouettes.draw(view, corners)
        pixels, _ = silhouettes.cameras.project(view, corners.reshape(-1, 3))
        hull = ConvexHull(pixels)
        rows, columns = np.indices(drawn.shape)
        centres = np.column_stack([columns.ravel() + 0.5, rows.ravel() + 0.5])
        inside = (centres @ hull.equations[:, :2].T + hull.equations[:, 2] <= 0).all(axis=1).reshape(drawn.shape)
        assert not (inside & ~drawn).any()
        assert drawn.sum() - inside.sum() < 0.35 * hull.area  # a sixth of a pixel along the outline
    empty = silhouettes.empty(np.array([[0.5, 0.5, 0.5], [0.5, 0.5, 0.95], [0.02, 0.12, 0.27]]))
    assert empty.tolist() == [False, True, False]
