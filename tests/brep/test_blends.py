"""Fillets rolled on solids with sharp edges, against analytic volumes and solids of the kernel."""

from dataclasses import replace

import numpy as np
import pytest
from brepgaussian.brep.blends import Blend, blended, exact_blends, levels, spare
from brepgaussian.brep.job import Job, Rung
from brepgaussian.brep.patches import make_patches
from brepgaussian.brep.simplify import Change, applied
from brepgaussian.geometry.surfaces import cone, cylinder, plane, sphere
from brepgaussian.settings.brep import BrepSettings

SIZE = np.array([1.0, 0.8, 0.5])
INNER = SIZE / 2


def on_rounded_box(radius, rng, count=12000):
    """Points, normals and labels of a box with all edges rounded: 0..5 planes, 6..17 fillets, 18..25 balls.

    A point of the sharp box's skin goes to the nearest place of the smaller box inside, and out again by the radius.
    """
    core = INNER - radius
    side = rng.choice(3, count, p=1 / SIZE / (1 / SIZE).sum())
    xyz = rng.uniform(-1, 1, (count, 3)) * INNER
    xyz[np.arange(count), side] = np.copysign(INNER[side], rng.uniform(-1, 1, count))
    inner = np.clip(xyz, -core, core)
    normals = xyz - inner
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    out = np.abs(xyz) > core  # along which axes a point is rounded
    sign = xyz > 0
    label = np.empty(count, int)
    for k in range(count):
        axes = np.flatnonzero(out[k])
        if len(axes) == 1:
            label[k] = 2 * axes[0] + sign[k, axes[0]]
        elif len(axes) == 2:
            label[k] = 6 + 4 * (axes.sum() - 1) + 2 * sign[k, axes[0]] + sign[k, axes[1]]
        else:
            label[k] = 18 + 4 * sign[k, 0] + 2 * sign[k, 1] + sign[k, 2]
    return inner + radius * normals + 0.5, normals, label


def surfaces_of(kit, radius, rng, error=0.0):
    """The surfaces of the labels, fillets and balls off by an error in radius and place."""
    core = INNER - radius
    found = kit.box_planes(SIZE)
    for axis in (0, 1, 2)[::-1]:
        others = [a for a in (0, 1, 2) if a != axis]
        for first in (-1, 1):
            for second in (-1, 1):
                middle = np.full(3, 0.5)
                middle[others[0]] += first * core[others[0]]
                middle[others[1]] += second * core[others[1]]
                off = error * rng.normal(size=3)
                found.append(cylinder(middle + off, np.eye(3)[axis], radius * (1 + error * rng.normal())))
    # labels of fillets: those along z first (axes 0, 1), then along y (0, 2), then along x (1, 2)
    for x in (-1, 1):
        for y in (-1, 1):
            for z in (-1, 1):
                found.append(sphere(0.5 + core * [x, y, z] + error * rng.normal(size=3), radius))
    return found


def rounded_box(kit, radius=0.1, seed=0, balls=True, error=0.0, sigma=0.0005):
    """Patches of the rounded box; without `balls` their points carry the label of a fillet beside them."""
    from brepgaussian.artifacts.primitives import Primitive

    rng = np.random.default_rng(seed)
    xyz, normals, label = on_rounded_box(radius, rng)
    surfaces = surfaces_of(kit, radius, rng, error)
    if not balls:  # a point goes to the fillet whose axis it is least turned along
        turned = np.abs(normals[label >= 18])
        axis, sign = turned.argmin(axis=1), normals[label >= 18] > 0
        others = np.array([[1, 2], [0, 2], [0, 1]])[axis]
        rows = np.arange(len(axis))
        label[label >= 18] = 6 + 4 * (2 - axis) + 2 * sign[rows, others[:, 0]] + sign[rows, others[:, 1]]
        surfaces = surfaces[:18]
    points = kit.make_points(xyz + sigma * rng.normal(size=xyz.shape), normals, label)
    items = [Primitive(s, i, np.flatnonzero(label == i), sigma) for i, s in enumerate(surfaces)]
    return make_patches(items, points, 0.05)


def volume_of_rounded_box(r):
    """Steiner's formula: the smaller box, its faces, edges and corners grown by the radius."""
    a, b, c = SIZE - 2 * r
    return a * b * c + 2 * r * (a * b + b * c + c * a) + np.pi * r**2 * (a + b + c) + 4 / 3 * np.pi * r**3


def job_of(patches, blends=()):
    return Job(tuple(patches), (), np.zeros((0, 3)), (), None, BrepSettings(), blends=tuple(blends))


@pytest.mark.parametrize(("balls", "error", "seed"), [(True, 0.0, 0), (False, 0.0, 1), (True, 0.015, 2)])
def test_a_box_with_all_edges_rounded(kit, balls, error, seed):
    from brepgaussian.brep.assemble import attempt

    patches, blends = blended(rounded_box(kit, seed=seed, balls=balls, error=error), 0.002)
    assert sum(len(b.faces) == 2 for b in blends) == 12
    assert sum(len(b.faces) == 3 for b in blends) == 8
    assert len(patches) == 26
    result = attempt(job_of(patches, blends), Rung("support", 0.04))
    assert result.verdict.faults == ()
    assert result.verdict.doubts == ()
    assert (result.verdict.faces, result.verdict.edges, result.verdict.vertices) == (26, 48, 24)
    radius = patches[blends[0].patch].surface.radius
    assert radius == pytest.approx(0.1, abs=0.002)
    assert result.verdict.volume == pytest.approx(volume_of_rounded_box(radius), rel=1e-6)


@pytest.mark.parametrize("radius", [-0.07, 0.12])
def test_fillets_touch_their_faces_exactly(kit, radius):
    """Signed: convex and concave."""
    planes = rounded_box(kit)[:6]
    fillet = replace(rounded_box(kit)[6], surface=cylinder(np.full(3, 0.3), np.eye(3)[2], abs(radius), radius < 0))
    corner = replace(fillet, surface=sphere(np.full(3, 0.3), abs(radius), radius < 0))
    blends = (Blend(6, (0, 2)), Blend(7, (0, 2, 4)))
    found = exact_blends([*planes, fillet, corner], blends)
    for blend in blends:
        surface = found[blend.patch].surface
        for face in blend.faces:
            assert planes[face].surface.signed_distance(surface.origin[None])[0] == pytest.approx(-radius, abs=1e-12)


def test_radii_that_points_know_badly_are_one_and_others_are_not(kit):
    patches = rounded_box(kit, error=0.02, seed=3)
    found, blends = blended(patches, 0.002)
    assert len({found[b.patch].surface.radius for b in blends}) == 1
    wide = [replace(p, surface=replace(p.surface, radius=0.15)) if k == 1 else p for k, p in enumerate(found[6:8])]
    left = exact_blends([*found[:6], *wide], (Blend(6, (0, 2)), Blend(7, (0, 3))))
    assert [round(p.surface.radius, 3) for p in left[6:]] == [round(found[6].surface.radius, 3), 0.15]


def test_a_hole_or_a_shaft_is_no_fillet(kit):
    known = kit.block_with_hole()
    patches, blends = blended(make_patches(known.primitives.items, known.points, 0.05), 0.002)
    assert blends == ()
    assert len(patches) == known.faces


def test_pieces_that_labels_tore_off_are_spare(kit):
    patches = rounded_box(kit)
    piece = patches[5].xyz[:, 0] > 0.7
    torn = replace(patches[5], primitive=99, xyz=patches[5].xyz[piece], normals=patches[5].normals[piece])
    every, blends = blended([*patches, torn], 0.002)
    assert spare(every, blends, 0.002) == [len(patches)]


@pytest.mark.parametrize(("share", "gone"), [(0.5, True), (1.0, False)])
def test_chords_of_fillets_are_spare_and_chamfers_are_not(kit, share, gone):
    """A plane across half of a fillet's turn, as reconstructions have them, and one across all of it."""
    patches = rounded_box(kit)
    fillet = patches[6]
    rng = np.random.default_rng(4)
    turn = share * np.pi / 2
    middle = fillet.surface.origin * [1, 1, 0] + [0, 0, 0.5]
    ends = [middle - 0.1 * np.array([np.cos(a), np.sin(a), 0.0]) for a in (0.0, turn)]
    along = np.array([0.0, 0.0, 0.2]) * rng.uniform(-1, 1, (300, 1))
    xyz = ends[0] + rng.uniform(0, 1, (300, 1)) * (ends[1] - ends[0]) + along
    normal = middle - (ends[0] + ends[1]) / 2
    flat = plane((ends[0] + ends[1]) / 2, -normal)
    chord = replace(fillet, primitive=99, surface=flat, xyz=xyz, normals=np.tile(flat.axis, (300, 1)), sigma=0.0005)
    every, blends = blended([*patches, chord], 0.002)
    assert (spare(every, blends, 0.002) == [len(patches)]) == gone


@pytest.mark.parametrize("seed", [4, 5])
def test_a_fillet_that_was_taken_for_a_cone_is_told_by_the_others(kit, seed):
    """A short one, under one label with a part of both its balls."""
    patches = rounded_box(kit, seed=seed)
    fillet, *balls = patches[6], patches[18], patches[19]  # the edge along z at the least x and y
    xyz, normals = (np.concatenate([getattr(p, what) for p in (fillet, *balls)]) for what in ("xyz", "normals"))
    leaning = cone(fillet.surface.origin, np.array([0.1, 0.1, 1.0]) / np.sqrt(1.02), 0.1, 0.05)
    taken = replace(fillet, surface=leaning, xyz=xyz, normals=normals)
    left = [taken if i == 6 else p for i, p in enumerate(patches) if i not in (18, 19)]
    found, blends = blended(left, 0.002)
    assert [b.faces for b in blends if b.patch == 6] == [(0, 2)]
    assert sum(len(b.faces) == 3 for b in blends) == 8
    assert len(found) == 26


@pytest.mark.parametrize(("count", "seed"), [(26, 8), (10, 9)])
def test_a_fillet_whose_middle_was_taken_for_a_plane_is_told_by_the_others(kit, count, seed):
    """Its sides went to the faces beside it; the others are all edges of the box, or the three parallel ones alone."""
    patches = rounded_box(kit, seed=seed)[:count]
    fillet = patches[6]  # the edge along z at the least x and y
    middle = -np.array([1.0, 1.0, 0.0]) / np.sqrt(2)
    kept = fillet.normals @ middle > np.cos(np.radians(18))
    xyz, normals = fillet.xyz[kept], fillet.normals[kept]
    flat = replace(fillet, surface=plane(xyz.mean(axis=0), middle), xyz=xyz, normals=normals)
    _, blends = blended([flat if i == 6 else p for i, p in enumerate(patches)], 0.002)
    assert [b.faces for b in blends if b.patch == 6] == [(0, 2)]
    assert sum(len(b.faces) == 2 for b in blends) == (12 if count == 26 else 4)


def test_a_sharp_edge_between_rounded_ones_stays_sharp(kit):
    """What lies beside it is a chamfer, not a part of a fillet."""
    patches = rounded_box(kit, seed=6)
    chamfer = plane(patches[6].xyz.mean(axis=0), -np.array([1.0, 1.0, 0.0]) / np.sqrt(2))
    flat = replace(patches[6], surface=chamfer, xyz=chamfer.project(patches[6].xyz))
    flat = replace(flat, normals=chamfer.normals(flat.xyz))
    _, blends = blended([flat if i == 6 else p for i, p in enumerate(patches)], 0.002)
    assert 6 not in {b.patch for b in blends}
    assert sum(len(b.faces) == 2 for b in blends) == 11


def test_fillets_along_which_others_run_go_first():
    upright, along, around = Blend(5, (0, 1)), Blend(6, (0, 2)), Blend(7, (5, 2))
    assert levels([along, upright, around]) == [[upright], [along, around]]
    assert levels([along]) == [[along]]


def test_changes_keep_the_fillets_that_they_do_not_concern(kit):
    patches, blends = blended(rounded_box(kit), 0.002)
    job = applied(job_of(patches, blends), [Change("without a ball", (blends[-1].patch,), ())])
    assert len(job.blends) == len(blends) - 1
    for blend in job.blends:
        surface = job.patches[blend.patch].surface
        for face in blend.faces:
            assert abs(job.patches[face].surface.signed_distance(surface.origin[None])[0]) == pytest.approx(
                surface.radius, abs=1e-9
            )


def test_a_fillet_that_rounds_off_no_edge_is_a_fault(kit):
    from brepgaussian.brep.assemble import attempt

    patches, blends = blended(rounded_box(kit), 0.002)
    fillet = next(b for b in blends if b.faces == (0, 2))
    elsewhere = next(b for b in blends if b.faces == (1, 3))
    job = job_of(patches, [*(b for b in blends if b is not fillet), Blend(fillet.patch, elsewhere.faces)])
    result = attempt(job, Rung("support", 0.04))
    assert result.shape is None
    assert "rounds off no edge" in result.verdict.faults[0]
