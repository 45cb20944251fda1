"""Relations: found where they hold, kept by their rows, tangency to first order."""

from dataclasses import replace

import numpy as np
import pytest
from brepgaussian.brep.refine.constraints import Tie, Tolerances, detect, tie_rows, value
from brepgaussian.brep.refine.parameters import COUNT, update
from brepgaussian.brep.refine.tangency import tangent_rows
from brepgaussian.brep.structure import extract
from brepgaussian.geometry.surfaces import cylinder, plane, unit
from refine_support import perturbed, surfaces_of, unit_solid

build123d = pytest.importorskip("build123d")


def tolerances(surfaces, sigma=1e-9, **limits):
    start = np.concatenate([[0], np.cumsum([COUNT[s.kind] for s in surfaces])])
    fixed = {"angle": 1e-3, "cone_angle": 2e-3, "length": 2e-4, "most_angle": 0.02, "most_length": 2e-3, "trust": 10.0}
    return Tolerances(**(fixed | limits), covariance=sigma**2 * np.eye(start[-1]), start=start)


@pytest.fixture(scope="module")
def filleted():
    """A box with one rounded edge and two bores of one size."""
    b = build123d
    box = b.Solid.make_box(1, 0.8, 0.5)
    edge = box.edges().filter_by(b.Axis.Z).sort_by(b.Axis.X)[-1]
    body = (
        box.fillet(0.2, [edge])
        - b.Pos(0.3, 0.3, 0.25) * b.Cylinder(0.1, 1)
        - b.Pos(0.3, 0.6, 0.25) * b.Cylinder(0.1, 1)
    )
    solid = unit_solid(body)
    surfaces = surfaces_of(solid)
    return extract(solid, surfaces), surfaces


def test_relations_of_an_exact_solid_are_found(filleted):
    structure, surfaces = filleted
    ties = detect(structure, surfaces, tolerances(surfaces))
    kinds = [t.kind for t in ties]
    assert kinds.count("parallel") == 2 + 1 + 3  # two pairs of sides, the two ends, three cylinders to these
    assert kinds.count("perpendicular") == 3
    assert kinds.count("equal_radius") == 1
    assert all(np.abs(value(t, surfaces)).max() < 1e-12 for t in ties)


def test_relations_far_off_are_not_found(filleted):
    structure, surfaces = filleted
    moved = perturbed(surfaces, 1, 1.0, 0.01)
    found, true = (detect(structure, x, tolerances(x)) for x in (moved, surfaces))
    assert len(found) < len(true) / 3  # by chance
    assert all(np.abs(value(t, moved)).max() <= 1e-3 for t in found)


def test_what_is_hardly_known_is_tied_within_limits(filleted):
    structure, surfaces = filleted
    moved = perturbed(surfaces, 1, 0.2, 1e-4)
    assert len(detect(structure, moved, tolerances(moved, sigma=0.01))) > len(
        detect(structure, moved, tolerances(moved))
    )
    far = perturbed(surfaces, 1, 5.0, 0.05)
    assert all(np.abs(value(t, far)).max() <= 0.02 for t in detect(structure, far, tolerances(far, sigma=0.1)))


@pytest.mark.parametrize("seed", range(3))
def test_rows_restore_relations_and_tangency(filleted, seed):
    structure, surfaces = filleted
    ties = detect(structure, surfaces, tolerances(surfaces))
    now = list(perturbed(surfaces, seed, 0.3, 0.002))
    start = np.concatenate([[0], np.cumsum([COUNT[s.kind] for s in surfaces])])
    for _ in range(6):
        rows = [*tie_rows(ties, now), *tangent_rows(structure, now)]
        matrix, right = np.zeros((len(rows), start[-1])), np.zeros(len(rows))
        for i, (columns, off) in enumerate(rows):
            for index, slope in columns.items():
                matrix[i, start[index] : start[index + 1]] += slope
            right[i] = -off
        delta = np.linalg.lstsq(matrix, right, rcond=1e-9)[0]
        now = [update(s, delta[a:b]) for s, a, b in zip(now, start[:-1], start[1:], strict=True)]
    assert max(np.abs(value(t, now)).max() for t in ties) < 1e-9
    fillet = next(s for s in now if s.kind == "cylinder" and not s.flipped)
    sides = [s for s in now if s.kind == "plane" and abs(s.axis @ fillet.axis) < 0.1]
    gaps = sorted(abs(abs(s.signed_distance(fillet.origin[None])[0]) - fillet.radius) for s in sides)
    assert gaps[1] < 1e-9  # the two sides that the fillet joins


@pytest.fixture(scope="module")
def hinge():
    """A leaf whose lower face touches the barrel that it ends in."""
    b = build123d
    barrel = b.Rot(90, 0, 0) * b.Cylinder(0.2, 1)
    leaf = b.Pos(0.5, 0, -0.1) * b.Box(1, 0.6, 0.2)
    solid = unit_solid(barrel + leaf)
    surfaces = surfaces_of(solid)
    return extract(solid, surfaces), surfaces


@pytest.mark.parametrize("off", [1e-4, -1e-4])
def test_a_face_that_nearly_touches_a_barrel_does(hinge, off):
    structure, surfaces = hinge
    lower = next(i for i, s in enumerate(surfaces) if s.kind == "plane" and s.axis[2] < -0.5)
    barrel = next(i for i, s in enumerate(surfaces) if s.kind == "cylinder")
    now = list(surfaces)
    now[lower] = update(now[lower], np.array([0, 0, off]))
    (tie,) = [t for t in detect(structure, now, tolerances(now)) if t.kind == "touching"]
    assert tie.members == (lower, barrel)
    assert abs(value(tie, now)[0]) == pytest.approx(1e-4, rel=1e-6)
    (columns, gap), *rest = tie_rows([tie], now)
    assert not rest
    for index, slope in columns.items():  # the linear prediction of the gap holds
        step = 1e-5 * np.arange(1, len(slope) + 1)
        moved = list(now)
        moved[index] = update(now[index], step)
        assert value(tie, moved)[0] == pytest.approx(gap + slope @ step, abs=1e-8)
    now[lower] = update(now[lower], np.array([0, 0, 100 * off]))
    assert not [t for t in detect(structure, now, tolerances(now)) if t.kind == "touching"]


@pytest.fixture(scope="module")
def rounded():
    """A disc with a rounded rim: its torus touches the top and the side."""
    b = build123d
    disc = b.Cylinder(20, 12)
    solid = unit_solid(b.fillet(disc.edges().sort_by(b.Axis.Z)[-1], 4))
    surfaces = surfaces_of(solid)
    return extract(solid, surfaces), surfaces


@pytest.mark.parametrize(("off", "count"), [(5e-4, 2), (0.005, 0)])
def test_faces_that_nearly_touch_a_fillet_do(rounded, off, count):
    """A top that crosses the fillet leaves a lip, and has been drawn down beside it."""
    structure, surfaces = rounded
    torus = next(i for i, s in enumerate(surfaces) if s.kind == "torus")
    moved = list(surfaces)
    moved[torus] = replace(surfaces[torus], minor=surfaces[torus].minor + off)
    ties = [t for t in detect(structure, moved, tolerances(moved, sigma=1e-4)) if t.kind == "touching"]
    assert sorted(surfaces[t.members[0]].kind for t in ties) == ["cylinder", "plane"][:count]
    for tie in ties:
        assert value(tie, surfaces)[0] == pytest.approx(0.0, abs=1e-12)
        assert abs(value(tie, moved)[0]) == pytest.approx(off)


def test_a_circle_that_touches_planes_is_found():
    from refine_support import nut_solid

    solid, surfaces = nut_solid()
    structure = extract(solid, surfaces)
    ties = detect(structure, surfaces, tolerances(surfaces))
    assert {t.members for t in ties if t.kind == "inscribed"} == {(8, 7, k) for k in range(6)}
    wide = list(surfaces)
    wide[0] = update(wide[0], np.array([0, 0, 0.001]))
    assert value(Tie("inscribed", (8, 7, 0)), wide)[0] == pytest.approx(-0.001, abs=1e-12)


@pytest.fixture(scope="module")
def chamfered():
    """A box whose upper edges are chamfered: chamfers and sides meet in corners of four."""
    b = build123d
    box = b.Solid.make_box(1, 0.8, 0.5)
    solid = unit_solid(b.chamfer(b.Part(box.wrapped).faces().sort_by(b.Axis.Z)[-1].edges(), 0.05))
    surfaces = surfaces_of(solid)
    return extract(solid, surfaces), surfaces


def test_corners_of_four_faces_are_tied(chamfered):
    structure, surfaces = chamfered
    corners = [t for t in detect(structure, surfaces, tolerances(surfaces)) if t.kind == "corner"]
    assert len(corners) == 4
    assert all({len(t.members) for t in corners} == {4} for t in corners)
    assert all(abs(value(t, surfaces)[0]) < 1e-12 for t in corners)
    for tie in corners:  # a face that moves along its normal leaves the corner
        for place, index in enumerate(tie.members):
            moved = list(surfaces)
            moved[index] = update(moved[index], np.array([0, 0, 1e-4]))
            assert 1e-5 < abs(value(tie, moved)[0]) < 1e-4, place


@pytest.mark.parametrize("seed", range(3))
def test_a_corner_torn_apart_is_one_again(chamfered, seed):
    structure, surfaces = chamfered
    now = list(perturbed(surfaces, seed, 0.02, 2e-4))
    ties = [t for t in detect(structure, now, tolerances(now)) if t.kind == "corner"]
    assert len(ties) == 4
    start = np.concatenate([[0], np.cumsum([COUNT[s.kind] for s in surfaces])])
    for _ in range(4):
        rows = tie_rows(ties, now)
        matrix = np.zeros((len(rows), start[-1]))
        for i, (columns, _) in enumerate(rows):
            for index, slope in columns.items():
                matrix[i, start[index] : start[index + 1]] += slope
        delta = np.linalg.lstsq(matrix, -np.array([off for _, off in rows]), rcond=1e-9)[0]
        now = [update(s, delta[a:b]) for s, a, b in zip(now, start[:-1], start[1:], strict=True)]
    for tie in ties:  # an independent look: the point of three planes lies on the fourth
        planes = [now[i] for i in tie.members]
        normals, offsets = np.array([p.axis for p in planes]), np.array([p.axis @ p.origin for p in planes])
        for left_out in range(4):
            rest = [k for k in range(4) if k != left_out]
            if abs(np.linalg.det(normals[rest])) > 0.05:
                point = np.linalg.solve(normals[rest], offsets[rest])
                assert abs(normals[left_out] @ point - offsets[left_out]) < 1e-9


def test_a_narrow_chamfer_is_no_torn_corner():
    b = build123d
    box = b.Solid.make_box(1, 0.8, 0.5)
    edge = box.edges().filter_by(b.Axis.Y).sort_by(b.Axis.Z)[-1]
    solid = unit_solid(box.chamfer(0.006, None, [edge]))
    surfaces = surfaces_of(solid)
    assert not [t for t in detect(extract(solid, surfaces), surfaces, tolerances(surfaces)) if t.kind == "corner"]


@pytest.mark.parametrize("seed", range(4))
def test_rows_of_a_corner_are_the_derivative_of_its_value(seed):
    rng = np.random.default_rng(seed)
    place = rng.normal(size=3)
    members = [plane(place + 1e-3 * rng.normal(size=3), rng.normal(size=3)) for _ in range(4)]
    if seed % 2:
        axis = unit(rng.normal(size=3))
        members[1] = cylinder(place + 0.3 * unit(np.cross(axis, rng.normal(size=3))), axis, 0.3)
    tie = Tie("corner", (0, 1, 2, 3), tuple(place))
    ((row, start),) = tie_rows([tie], members)
    assert start == value(tie, members)[0]
    for index, slopes in row.items():
        for k, slope in enumerate(slopes):
            delta = np.zeros(len(slopes))
            delta[k] = 1e-6
            moved = [*members[:index], update(members[index], delta), *members[index + 1 :]]
            assert (value(tie, moved)[0] - start) / 1e-6 == pytest.approx(slope, abs=0.02)
