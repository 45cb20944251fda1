"""Walls of concavities that are drawn as sections: straight, one for both ends, and the surfels on them."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from brepgaussian.splatting.concave import walls
from brepgaussian.splatting.concave.draw import fitted
from brepgaussian.splatting.concave.prism import Prism
from brepgaussian.splatting.concave.sections import Rounded, Section
from brepgaussian.splatting.concave.walls import Walls, agreed
from drawings import CENTER, GRID, PITCH, SECTIONS, SHAPE, basis_of, chewed, opened, placed, prism_of, raster, rim_seen


def test_a_prism_with_a_section_has_straight_walls():
    section = SECTIONS["slot"]
    rough = prism_of(section)
    prism = replace(rough, section=fitted(rough.outline, opened))
    below = placed(prism, section.border(300), 0.1)
    exact = np.abs(prism.signed_distance(below, 0.0))
    assert exact.mean() < 0.5 * np.abs(rough.signed_distance(below, 0.0)).mean()
    assert exact.max() < 0.001


def test_surfels_are_put_on_the_piece_of_the_wall_that_they_lie_next_to():
    section = SECTIONS["slot"]
    prism = replace(prism_of(section), section=section)
    cells = section.border(400)
    rng = np.random.default_rng(3)
    xyz = placed(prism, cells, rng.uniform(0.02, 0.18, 400))
    normals = -section.gradient(cells) @ basis_of(prism)
    noisy = xyz + rng.normal(0, 0.001, (400, 1)) * normals
    found = Walls([prism], PITCH).under(noisy, normals)
    assert np.array_equal(found.piece, section.pieces(cells))
    assert np.abs(found.foot - xyz).max() < 2e-4
    assert np.einsum("nc,nc->n", found.normal, normals).min() > 0.9999
    # what faces another way, or lies below the floor, is not on it
    other = Walls([prism], PITCH).under(noisy, -normals)
    assert (other.piece == -1).all()
    assert np.array_equal(other.foot, noisy)
    assert (Walls([prism], PITCH).under(noisy - 0.3 * prism.lattice.normal, normals).piece == -1).all()


def around(prism: Prism, narrower: float, depth: float) -> tuple[np.ndarray, np.ndarray]:
    """(50, 3) places on a round hole's wall, `narrower` than its opening, and (50, 3) directions out of its axis."""
    turn = np.linspace(0, 2 * np.pi, 50, endpoint=False)
    out = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(50)])
    radius = PITCH * prism.section.shape.radius - narrower
    return placed(prism, np.array([CENTER]), depth) + radius * out, out


def test_the_wall_of_a_countersunk_hole_is_its_throat_not_its_rim():
    prism = replace(prism_of(SECTIONS["circle"]), section=SECTIONS["circle"], draft=1.0, sink=0.03)
    rim, out = around(prism, 0.015, 0.015)
    throat, _ = around(prism, 0.03, 0.1)
    leaning = (np.array([0, 0, 1.0]) - out) / np.sqrt(2)
    noisy = throat + 0.001 * out
    found = Walls([prism], PITCH).under(np.concatenate([rim, noisy]), np.concatenate([leaning, -out]))
    assert (found.piece[:50] == -1).all()
    assert np.array_equal(found.foot[:50], rim)
    assert len(np.unique(found.piece[50:])) == 1
    assert found.piece[50] >= 0
    assert np.allclose(found.foot[50:], throat, atol=1e-6)
    assert np.allclose(found.normal[50:], -out, atol=1e-6)


def test_the_wall_of_a_tapered_hole_leans():
    prism = replace(prism_of(SECTIONS["circle"]), section=SECTIONS["circle"], draft=0.25)
    places, out = around(prism, 0.025, 0.1)
    leaning = (0.25 * np.array([0, 0, 1.0]) - out) / np.sqrt(1 + 0.25**2)
    found = Walls([prism], PITCH).under(places, leaning)
    assert len(np.unique(found.piece)) == 1
    assert found.piece[0] >= 0
    assert np.allclose(found.foot, places, atol=1e-6)
    assert np.allclose(found.normal, leaning, atol=1e-6)


def test_both_ends_of_a_hole_get_one_wall():
    section = replace(SECTIONS["slot"], misfit=0.1, at_rim=True)
    near = replace(prism_of(section), section=section)
    # the far end's lattice is the mirror image: rows along x, columns along -y
    center = (CENTER[0], -1.0 - CENTER[1])
    mirrored = Section(center, -section.angle, Rounded((31.0, 9.4), 9.4), misfit=0.01)  # but told by cells
    far = replace(prism_of(section, flipped=True), section=mirrored)
    one, other = agreed([near, far])
    assert one.section == section
    assert np.allclose(other.section.shape.half, section.shape.half)
    assert np.allclose(other.section.center, center)
    exact = replace(mirrored, shape=section.shape)
    assert np.abs(exact.signed_distance(other.section.border(64))).max() < 0.05
    cells = section.border(100)
    xyz, normals = placed(near, cells, 0.1), -section.gradient(cells) @ basis_of(near)
    assert np.array_equal(Walls([one, other], PITCH).under(xyz, normals).piece, section.pieces(cells))
    swapped = Walls([other, one], PITCH).under(xyz, normals).piece  # whichever end comes first
    assert len(np.unique(np.column_stack([swapped, section.pieces(cells)]), axis=0)) == 4


def far_end(prism: Prism, outline: np.ndarray) -> Prism:
    """The other end of a hole with an outline (R, C) on the near end's lattice: columns run the other way."""
    lattice, (_, columns) = prism.lattice, SHAPE
    origin = lattice.origin + columns * PITCH * lattice.second - prism.depth * lattice.normal
    flipped = replace(lattice, origin=origin, second=-lattice.second, normal=-lattice.normal)
    return replace(prism, lattice=flipped, outline=outline[:, ::-1], section=None)


def test_an_end_that_no_rim_tells_goes_along_the_walls_of_the_other():
    section = replace(SECTIONS["slot"], at_rim=True)
    near = replace(prism_of(section), section=section)
    far = far_end(near, chewed(near.outline, 5))
    one, other = agreed([near, far])
    assert one.section == section
    xyz = placed(near, section.border(100), 0.1)
    assert np.abs(other.lateral(other.lattice.coordinates(xyz)[0])).max() < 0.01 * PITCH
    # not if cells alone have told the near one, nor if the far one's outline is another
    assert agreed([replace(near, section=replace(section, at_rim=False)), far])[1].section is None
    assert agreed([near, far_end(near, raster(section.grown(4.0)))])[1].section is None


def test_a_recess_about_a_hub_does_not_get_the_walls_of_the_hubs_bore():
    """The bore is open wherever the recess is looked into, so that it borders the recess's outline, too."""
    bore = Section(CENTER, 0.0, Rounded((8.0, 8.0), 8.0), at_rim=True)
    near = replace(prism_of(bore), section=bore)
    recess = raster(bore.grown(25.0)) & ~raster(bore.grown(6.0)) | raster(bore)
    assert agreed([near, replace(near, outline=recess, section=None)])[1].section is None
    assert agreed([near, far_end(near, recess)])[1].section is None


def test_a_round_opening_of_which_parts_look_like_the_face_is_the_circle_that_its_rim_tells(monkeypatch):
    """In a dome, two pieces of a hole's outline are missing."""
    bore = Section(CENTER, 0.0, Rounded((14.2, 14.2), 14.2))
    stack, centers = rim_seen(bore, 0.0)
    away = GRID - np.array(CENTER)
    bitten = raster(bore) & (away @ [0.8, 0.6] < 10.5) & (away @ [-0.6, 0.8] < 9.5) & (away @ [-0.9, -0.44] < 11.5)
    views = SimpleNamespace(cameras=SimpleNamespace(centers=centers))
    images = SimpleNamespace(views=views, tolerance=1.5)
    monkeypatch.setattr(walls, "rectify", lambda *_: stack)
    prism = replace(prism_of(bore), outline=bitten)
    monkeypatch.setattr(walls, "fitted", lambda *_: replace(SECTIONS["pocket"], misfit=0.3))  # so it seems to the cells
    found = walls.drawn(images, None, None, prism, 0.0)
    assert found.section is not None
    assert np.abs(found.section.signed_distance(bore.border(100))).max() < 0.25
    blind = replace(stack, grey=np.full_like(stack.grey, 90.0))
    monkeypatch.setattr(walls, "rectify", lambda *_: blind)
    assert walls.drawn(images, None, None, prism, 0.0).section is None


@pytest.mark.parametrize(("told", "alike"), [(True, True), (False, False)])
def test_a_round_end_that_cells_draw_as_a_square_is_round_if_views_show_the_others_rim(told, alike):
    bore = Section(CENTER, 0.0, Rounded((8.4, 8.4), 8.4), misfit=0.05, at_rim=told)
    near = replace(prism_of(bore), section=bore)
    square = Section((CENTER[0] + 0.5, -1.0 - CENTER[1] - 0.6), 0.0, Rounded((7.4, 7.4), 0.0), misfit=0.1)
    far = replace(prism_of(square, flipped=True), section=square)
    one, other = agreed([near, far])
    assert one.section == bore
    assert (other.section.shape.radius == pytest.approx(8.4)) == alike


def test_the_ragged_mouth_of_a_hole_gets_the_walls_of_the_mouth_that_views_show():
    bore = Section(CENTER, 0.0, Rounded((11.4, 11.4), 11.4), at_rim=True)
    near = replace(prism_of(bore), section=bore)
    turn = np.arctan2(*np.moveaxis(GRID - np.array(CENTER), -1, 0))
    ragged = bore.signed_distance(GRID) < 1.8 * np.sin(5 * turn)
    assert bore.signed_distance(np.argwhere(ragged).astype(float)).max() > 1.2
    ragged |= raster(Section((CENTER[0] + 9.5, CENTER[1]), 0.0, Rounded((5.0, 5.0), 5.0)))  # and one corner too much
    assert agreed([near, far_end(near, ragged)])[1].section is not None
    blind = replace(far_end(near, ragged), through=False)  # it may be something else
    assert agreed([near, blind])[1].section is None
