"""Simpler hypotheses: what is proposed, what the gate makes of superfluous patches."""

from dataclasses import replace

import numpy as np
import pytest
from brepgaussian.artifacts.views import Views
from brepgaussian.brep import occ
from brepgaussian.brep.assemble import attempt
from brepgaussian.brep.buildings import Built, buildings
from brepgaussian.brep.gate import examine
from brepgaussian.brep.job import Rung
from brepgaussian.brep.ladder import make_job
from brepgaussian.brep.patches import Patch, make_patches, touch
from brepgaussian.brep.simplify import Change, applied, between_fillets, compatible, complexity, proposals
from brepgaussian.brep.trials import Trials
from brepgaussian.geometry.cameras import Cameras
from brepgaussian.geometry.surfaces import cone, cylinder, plane, torus
from brepgaussian.settings.brep import BrepSettings

SIGMA = 0.002


@pytest.fixture
def block(kit):
    return kit.block_with_hole(sigma=SIGMA, count=12000, seed=5)


def patches_of(block):
    return make_patches(block.primitives.items, block.points, 0.05)


def split(patch, at):
    """One patch in two labels with slightly different planes."""
    left = patch.xyz[:, 0] < at
    tilt = patch.surface.axis + np.array([0.01, 0, 0])
    first = replace(patch, xyz=patch.xyz[left], normals=patch.normals[left])
    other = plane(patch.surface.origin, tilt) if patch.surface.kind == "plane" else patch.surface
    return first, replace(patch, xyz=patch.xyz[~left], normals=patch.normals[~left], surface=other, primitive=90)


def test_nothing_is_proposed_for_the_truth(block):
    assert proposals(patches_of(block), SIGMA, 0) == []


@pytest.mark.parametrize("which", [4, 6])
def test_a_face_in_two_patches_is_merged(block, which):
    patches = patches_of(block)
    kind = patches[which].surface.kind
    patches[which : which + 1] = split(patches[which], 0.45)
    found = proposals(patches, SIGMA, 0)
    assert [c.gone for c in found] == [(which, which + 1)]
    new = found[0].new[0]
    assert new.surface.kind == kind
    assert len(new.xyz) == len(patches[which].xyz) + len(patches[which + 1].xyz)
    assert np.abs(new.surface.signed_distance(new.xyz)).mean() < SIGMA


@pytest.mark.parametrize(
    "bent",
    [
        cone(np.array([0.5, 0.5, 0.75]), np.array([0, 0, -1.0]), 0.2, np.radians(89.0)),
        torus(np.array([0.5, 0.5, -9.3]), np.array([0, 0, 1.0]), 0.4, 10.05),
    ],
)
def test_a_bent_plane_is_straightened(block, bent):
    patches = patches_of(block)
    patches[5] = replace(patches[5], surface=bent)
    found = [c for c in proposals(patches, SIGMA, 0) if c.gone == (5,)]
    assert found[0].new[0].surface.kind == "plane"
    assert abs(found[0].new[0].surface.axis[2]) == pytest.approx(1, abs=1e-4)


@pytest.mark.parametrize("made", [False, True])
def test_points_that_were_made_on_a_narrow_fillet_tell_nothing_about_its_kind(block, made):
    ring = torus(np.array([0.5, 0.5, 0.515]), np.array([0, 0, 1.0]), 0.345, 0.015, flipped=True)
    about, down = (a.ravel() for a in np.meshgrid(np.linspace(0, 2 * np.pi, 90, False), np.linspace(0, np.pi / 2.5, 5)))
    out = 0.345 - 0.015 * np.sin(down)
    xyz = np.column_stack([0.5 + out * np.cos(about), 0.5 + out * np.sin(about), 0.515 - 0.015 * np.cos(down)])
    assert np.abs(ring.signed_distance(xyz)).max() < 1e-9
    strip = Patch(ring, 90, xyz, ring.normals(xyz), 0.02, 0.0, made=made)
    found = [c.new[0].surface.kind for c in proposals([*patches_of(block), strip], 0.004, 0) if c.gone == (7,)]
    assert bool(found) is not made


def test_a_narrow_ring_is_tried_as_a_chamfer_before_a_sphere(block):
    rng = np.random.default_rng(8)
    chamfer = cone(np.array([0.5, 0.5, 0.8]), np.array([0, 0, -1.0]), 0.3, np.radians(45))
    about, down = rng.uniform(0, 2 * np.pi, 600), rng.uniform(0, 0.02, 600)
    xyz = np.column_stack([0.5 + (0.3 + down) * np.cos(about), 0.5 + (0.3 + down) * np.sin(about), 0.8 - down])
    xyz += rng.normal(0, SIGMA / 2, xyz.shape)
    ring = torus(np.array([0.5, 0.5, 0.76]), np.array([0, 0, 1.0]), 0.26, 0.07)
    strip = Patch(ring, 90, xyz, chamfer.normals(xyz), 0.02, SIGMA)
    found = [c.new[0].surface.kind for c in proposals([*patches_of(block), strip], SIGMA, 0) if c.gone == (7,)]
    assert found == ["cone", "sphere"]


@pytest.mark.parametrize(("taper", "kind"), [(0.1, "cylinder"), (3.0, None)])
def test_the_refined_surface_tells_what_rounded_points_do_not(block, taper, kind):
    patches = patches_of(block)
    hole = patches[6]
    bell = cone(hole.surface.origin, hole.surface.axis, hole.surface.radius, np.radians(8), hole.surface.flipped)
    patches[6] = replace(hole, surface=bell, xyz=bell.project(hole.xyz))
    assert [c for c in proposals(patches, SIGMA / 2, 0) if c.gone == (6,)] == []
    drafted = replace(bell, angle=np.radians(taper))
    refined = [*(p.surface for p in patches[:6]), drafted]
    found = [c.new[0].surface for c in proposals(patches, SIGMA / 2, 0, refined) if c.gone == (6,)]
    assert [s.kind for s in found] == ([kind] if kind else [])
    if found:
        assert found[0].radius == pytest.approx(hole.surface.radius, abs=1e-3)


@pytest.mark.parametrize(("apart", "merged"), [(0.0005, True), (0.012, False)])
def test_pieces_that_points_bend_are_one_face_where_the_images_made_them_one_surface(block, apart, merged):
    patches = patches_of(block)
    whole = patches[5]
    lean = plane(whole.surface.origin, whole.surface.axis + np.array([0.3, 0, 0]))
    first, second = split(whole, 0.5)
    patches[5:6] = first, replace(second, xyz=lean.project(second.xyz), surface=lean)
    assert (5, 6) not in [c.gone for c in proposals(patches, SIGMA, 0)]
    shifted = plane(whole.surface.origin + apart * whole.surface.axis, whole.surface.axis)
    refined = [whole.surface if k == 5 else shifted if k == 6 else p.surface for k, p in enumerate(patches)]
    assert ((5, 6) in [c.gone for c in proposals(patches, SIGMA / 2, 0, refined)]) == merged


@pytest.mark.parametrize(("lower", "merged"), [(0.002, True), (0.02, False)])
def test_pieces_of_a_plane_on_either_side_of_a_slot_are_one(block, lower, merged):
    patches = patches_of(block)
    first, second = split(patches[5], 0.35)
    right = second.xyz[:, 0] > 0.65
    floor = plane(patches[5].surface.origin - lower * patches[5].surface.axis, patches[5].surface.axis)
    second = replace(second, xyz=floor.project(second.xyz[right]), normals=second.normals[right], surface=floor)
    patches[5:6] = first, second
    assert ((5, 6) in [c.gone for c in proposals(patches, SIGMA, 0)]) == merged


@pytest.mark.parametrize(("off", "count", "proposed"), [(0.008, 40, True), (0.03, 40, False), (0.008, 400, False)])
def test_only_a_tiny_patch_beside_others_may_be_a_rounded_inner_edge(block, off, count, proposed):
    patches = patches_of(block)
    large = max(range(len(patches)), key=lambda k: len(patches[k].xyz))
    near, axis = patches[large].xyz[:count] + off * patches[large].surface.axis, np.array([0.6, 0.48, 0.64])
    fringe = replace(patches[large], xyz=near, normals=np.tile(axis, (count, 1)), surface=plane(near.mean(0), axis))
    patches.append(replace(fringe, primitive=90))
    assert any(c.name == "without patch 90" for c in proposals(patches, SIGMA, 0)) == proposed


@pytest.mark.parametrize(("turn_deg", "curved", "proposed"), [(9, True, True), (9, False, False), (25, True, False)])
def test_the_flat_start_of_a_fillet_may_be_none(turn_deg, curved, proposed):
    """A plane hardly turned against its neighbour, beside a curved face: where labels tore off a strip of a fillet."""
    turn, radius = np.radians(turn_deg), 0.17
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(0, 1, 50), np.linspace(0.2, 1, 60)))
    floor = np.column_stack([x, y, 0 * x])
    low, high = np.radians(1.5 * turn_deg), np.radians(60)
    angle = np.linspace(low, high, 30)
    axis = np.array([0, 0.2, radius])
    along = np.linspace(0, 1, 50)

    def on_arc(angles, depth=0.0):
        ring = axis + (radius - depth) * np.column_stack([0 * angles, -np.sin(angles), -np.cos(angles)])
        return (ring[None] + along[:, None, None] * np.eye(3)[0]).reshape(-1, 3)

    def patch(number, surface, xyz):
        return Patch(surface, number, xyz, surface.normals(xyz), 0.02, SIGMA)

    lean = plane(on_arc(np.array([turn / 2])).mean(axis=0), [0, np.sin(turn), np.cos(turn)])
    wall = plane(on_arc(angle).mean(axis=0), [0, np.sin(np.radians(35)), np.cos(np.radians(35))])
    round_face = cylinder(axis, [1, 0, 0], radius, flipped=True) if curved else wall
    strip = lean.project(on_arc(np.linspace(0, low, 8), depth=0.004))
    patches = [
        patch(1, plane([0, 0, 0], [0, 0, 1]), floor),
        patch(2, round_face, round_face.project(on_arc(angle))),
        patch(3, lean, strip[::4]),
    ]
    found = [c for c in proposals(patches, SIGMA, 0) if c.name == "without patch 3"]
    assert bool(found) == proposed
    assert all(c.excused == pytest.approx(100 / sum(len(p.xyz) for p in patches)) for c in found)


@pytest.mark.parametrize(("second", "dropped"), [(0.04, False), (0.06, True), (None, True)])
def test_a_short_wall_between_two_alike_fillets_is_not_left_out(second, dropped):
    """Without the end of a pocket its two corners would cross, where views are as blind as in the corners."""
    radius, rng = 0.04, np.random.default_rng(2)

    def corner(side, radius):
        axis = np.array([0.3 + radius, 0.5 + side * (0.05 + radius), 0.5])
        turn, height = rng.uniform(0, np.pi / 2, 300), rng.uniform(-0.02, 0.02, 300)
        xyz = axis + np.column_stack([-radius * np.cos(turn), side * radius * np.sin(turn), height])
        surface = cylinder(axis, np.array([0, 0, 1.0]), radius, flipped=True)
        return Patch(surface, 1, xyz, surface.normals(xyz), 0.02, SIGMA)

    wall = plane(np.array([0.3, 0.5, 0.5]), np.array([1.0, 0, 0]))
    edge = np.column_stack([np.full(80, 0.3), rng.uniform(0.45, 0.55, 80), rng.uniform(0.48, 0.52, 80)])
    far = plane(np.array([0.9, 0.5, 0.5]), np.array([-1.0, 0, 0]))
    rest = np.column_stack([np.full(9000, 0.9), rng.uniform(0, 1, (9000, 2))])
    patches = [Patch(wall, 3, edge, wall.normals(edge), 0.05, SIGMA), corner(1, radius)]
    patches += [corner(-1, second)] if second else []
    patches += [Patch(far, 9, rest, far.normals(rest), 0.02, SIGMA)]
    shallow = [
        replace(p, surface=replace(p.surface, radius=1.0, origin=np.add(p.surface.origin, [1, 0, 0]))) for p in patches
    ]
    assert between_fillets(0, patches) != dropped
    assert not between_fillets(1, patches)
    assert not between_fillets(0, [patches[0], *shallow[1:]])


def test_changes_of_one_patch_are_not_taken_together(block):
    job = make_job(_no_views(), block.points, block.primitives, BrepSettings())
    fringe = replace(job.patches[0], xyz=job.patches[0].xyz[:40], normals=job.patches[0].normals[:40], primitive=77)
    job = replace(job, patches=(*job.patches, fringe), open_patches=(6, 7))
    found = proposals(job.patches, SIGMA, 0)
    assert {7} <= {i for c in found for i in c.gone}
    chosen = compatible(found)
    touched = [i for c in chosen for i in c.gone]
    assert len(touched) == len(set(touched))
    drop = next(c for c in found if not c.new)
    after = applied(job, [drop])
    assert len(after.patches) == 7
    assert after.open_patches == (6,)
    assert [p.primitive for p in after.left_out] == [77]
    merged = applied(job, [next(c for c in found if c.new)])
    assert sum(len(p.xyz) for p in merged.patches) == sum(len(p.xyz) for p in job.patches)


def _no_views():
    cameras = Cameras(np.tile([100.0, 100, 16, 16], (8, 1)), np.tile(np.eye(4), (8, 1, 1)), 32, 32)
    blank = np.zeros((8, 32, 32), np.uint8)
    return Views("none", tuple("abcdefgh"), np.zeros((8, 32, 32, 3), np.uint8), blank, cameras, np.eye(4))


def test_points_of_patches_left_out_still_count(block):
    job = make_job(_no_views(), block.points, block.primitives, BrepSettings())
    solid = attempt(job, Rung("support", 0.04))
    assert solid.verdict.on_solid > 0.98
    away = job.patches[5].xyz - np.array([0, 0, 0.1])
    lost = replace(job.patches[5], xyz=away, surface=plane(away.mean(axis=0), np.array([0.1, 0, 1.0])))
    verdict = examine(occ.from_bytes(solid.shape), job.patches, None, job.settings, left_out=[lost])
    assert verdict.doubts == ()
    assert verdict.on_solid < solid.verdict.on_solid - 0.1


def test_the_noise_of_patches_left_out_still_counts(block):
    """Else a solid without noisy ones would be judged by a stricter limit than the one with them."""
    job = make_job(_no_views(), block.points, block.primitives, BrepSettings())
    solid = attempt(job, Rung("support", 0.04))
    moved = [replace(p, xyz=p.xyz + 0.003 * p.normals, sigma=0.0002) for p in job.patches]
    noisy = [replace(p, sigma=0.002) for p in (*moved, *moved)]
    strict = examine(occ.from_bytes(solid.shape), moved, None, job.settings)
    same = examine(occ.from_bytes(solid.shape), moved, None, job.settings, left_out=noisy)
    assert strict.on_solid < 0.1
    assert same.on_solid > 0.9


def test_complexity_counts_faces_first(block):
    surfaces = [p.surface for p in patches_of(block)]
    assert complexity(surfaces, range(7)) == (7, 1)
    assert complexity(surfaces, [0, 1, 6, 6]) == (4, 1)
    assert complexity(surfaces, [0, -1]) == (2, 0)


def test_simpler_kinds_are_tried_together():
    floor, wall, fringe = Change("floor", (0,), ("plane",)), Change("wall", (1,), ("plane",)), Change("less", (2,), ())
    groups = [[c.name for c in group] for group in Trials._groups([floor, wall, fringe])]
    assert groups == [["floor", "wall", "less"], ["floor", "wall"], ["floor"], ["wall"], ["less"]]
    assert [len(group) for group in Trials._groups([floor, wall])] == [2, 1, 1]
    assert [len(group) for group in Trials._groups([floor, fringe])] == [2, 1, 1]


def test_faces_beside_one_that_is_left_out_are_extended_where_no_solid_closes(block):
    job = make_job(_no_views(), block.points, block.primitives, BrepSettings())
    top = Change("without the top", (5,), ())
    beside = {p.primitive for k, p in enumerate(job.patches) if touch(p, job.patches[5]) and k != 5}
    changed = applied(job, [top])
    plain = Rung("support", 0.04)
    found = list(buildings(job, changed, plain, [top], SIGMA, Built()))
    assert [rung.name for _, rung in found] == ["support", "open_extended"]
    opened, rung = found[-1]
    assert {opened.patches[k].primitive for k in rung.extend} == beside
    assert opened.open_patches == rung.extend
    assert len(list(buildings(job, changed, plain, [top], SIGMA, Built(closed=True)))) == 1
    same = Change("a plane", (5,), (job.patches[5],))
    assert len(list(buildings(job, job, plain, [same], SIGMA, Built()))) == 1


@pytest.mark.parametrize(
    ("hollow", "touching", "dropped"), [(True, True, True), (True, False, False), (False, True, False)]
)
def test_a_flat_chord_of_a_hollow_fillet_may_go(hollow, touching, dropped):
    """A corner of two walls with a fillet of radius .1, flat between 60 and 75 degrees: off by five times the noise."""
    rng = np.random.default_rng(4)
    radius, sigma = 0.1, 0.0005
    middle = np.array([0.1 if touching else 0.13, 0, 0.1])
    around = cylinder(middle, np.array([0, 1.0, 0]), radius, flipped=hollow)
    floor, wall = plane(np.zeros(3), np.array([0, 0, 1.0])), plane(np.zeros(3), np.array([1.0, 0, 0]))

    def patch(surface, number, xyz, count):
        points = xyz + rng.normal(0, sigma, (count, 3))
        return Patch(surface, number, points, surface.normals(points), 0.02, sigma)

    def arc(first, last, count):
        angle = np.radians(rng.uniform(first, last, count))
        return middle + radius * np.column_stack([-np.sin(angle), 5 * rng.random(count), -np.cos(angle)])

    ends = arc(60, 60, 1)[0], arc(75, 75, 1)[0]
    share = rng.random(150)[:, None]
    chord = ends[0] + share * (ends[1] - ends[0])
    chord[:, 1] = 0.5 * rng.random(150)
    way = np.cross([0, 1.0, 0], ends[1] - ends[0])
    flat = plane(ends[0] + 0.0025 * way / np.linalg.norm(way), way)
    patches = [
        patch(floor, 0, np.column_stack([rng.uniform(0.1, 1, 8000), rng.random(8000) / 2, np.zeros(8000)]), 8000),
        patch(wall, 1, np.column_stack([np.zeros(8000), rng.random(8000) / 2, rng.uniform(0.1, 1, 8000)]), 8000),
        patch(around, 2, arc(0, 60, 900), 900),
        patch(flat, 3, chord + 0.0025 * way / np.linalg.norm(way), 150),
    ]
    assert any(c.gone == (3,) and not c.new for c in proposals(patches, sigma, 0)) == dropped
