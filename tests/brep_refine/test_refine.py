"""The whole refinement on rendered parts whose truth is known, and on the real nut."""

import dataclasses

import numpy as np
import pytest
from brepgaussian.brep.refine import acceptance, from_solid, refine, visibility
from brepgaussian.brep.structure import extract
from brepgaussian.geometry.cameras import Cameras
from brepgaussian.settings.brep import BrepSettings
from brepgaussian.settings.views import ViewsSettings
from refine_support import NUT, abc_views, nut_solid, start_of, surface_error, surfaces_of

VIEWS, SIZE = 16, 400


def rendered(name: str, **settings):
    """Views and exact solid of a bundled part."""
    from brepgaussian.views.parts import build_part, parse_part
    from brepgaussian.views.source_rendered import load_part
    from brepgaussian.views.truth import transformed, unit_from_world

    world = build_part(*parse_part(name)).wrapped
    options = {"rendered_views": VIEWS, "image_size": SIZE, "interreflection": 0.0} | settings
    views = load_part(name, name, "", False, ViewsSettings(**options), 1).views
    solid = transformed(world, unit_from_world(world))
    return views, solid, surfaces_of(solid)


@pytest.fixture(scope="module")
def block():
    return rendered("block_hole:3")


@pytest.fixture(scope="module")
def bracket():
    return rendered("fillet_bracket:2", noise=5.0, jpeg_quality=85)


@pytest.mark.parametrize("seed", [11, 12])
def test_perturbed_parameters_are_recovered(block, seed):
    views, solid, surfaces = block
    structure, mesh, moved, truth = start_of(solid, surfaces, seed)
    result = refine(structure, mesh, moved, views, BrepSettings())
    assert surface_error(mesh, truth) > 1e-3
    assert surface_error(result.mesh, truth) < 5e-5
    assert result.accepted
    assert result.silhouette_px < 0.1 < result.before.silhouette_px
    assert result.mask_iou > 0.998 > result.before.mask_iou


def test_noise_compression_and_fillets(bracket):
    views, solid, surfaces = bracket
    structure, mesh, moved, truth = start_of(solid, surfaces, 5)
    result = refine(structure, mesh, moved, views, BrepSettings())
    assert surface_error(result.mesh, truth) < 2e-4
    assert result.report["image_noise"] > 1  # compression smooths it


def test_truth_is_accepted_and_an_offset_is_not(block):
    views, solid, surfaces = block
    structure, mesh = extract(solid, surfaces), from_solid(solid)
    assert acceptance(mesh, structure, surfaces, views, BrepSettings()).accepted
    structure, mesh, moved, _ = start_of(solid, surfaces, 1, 0.1, 0.002)
    verdict = acceptance(mesh, structure, moved, views, BrepSettings())
    assert not verdict.accepted
    assert verdict.silhouette_px > 0.2
    assert len(verdict.faces) == len(structure.faces)


def test_a_notch_that_only_the_masks_show_is_missed(block):
    from build123d import Box, Pos, Solid

    views, solid, _ = block
    top = Solid(solid).bounding_box().max.Z
    notched = (Solid(solid) - Pos(0.5, 0.5, top) * Box(2, 0.04, 0.1)).solid().wrapped
    surfaces = surfaces_of(notched)
    structure, mesh = extract(notched, surfaces), from_solid(notched)
    lost = acceptance(mesh, structure, surfaces, views, BrepSettings())
    surfaces = surfaces_of(solid)
    right = acceptance(from_solid(solid), extract(solid, surfaces), surfaces, views, BrepSettings())
    assert right.astray == 0 < BrepSettings().accept_astray < lost.astray
    assert not lost.accepted


def test_a_sliver_of_background_thinner_than_a_pixel_is_a_border():
    alpha = np.full((20, 20), 255, np.uint8)
    alpha[4] = 180  # through a slot seen askance
    rows, columns = np.array([4, 5, 12]), np.array([10, 10, 10])
    assert visibility._clear_of_borders(alpha, rows, columns) == 1  # what is missing from the middle of the object
    assert visibility._clear_of_borders(255 - alpha, rows, columns) == 1
    alpha[10:15, 8:13] = 0  # a hole that the views show
    assert visibility._clear_of_borders(alpha, rows, columns) == 1
    assert visibility._clear_of_borders(alpha, rows, columns - 3) == 0


def test_imprecise_poses_are_corrected(block):
    views, solid, surfaces = block
    rng, poses = np.random.default_rng(4), views.cameras.cam_from_unit.copy()
    shift = 0.6 * rng.normal(size=(VIEWS, 2)) / views.cameras.intrinsics[:, :2]  # half a pixel
    poses[:, :2, 3] += shift * poses[:, 2:3, 3]
    cameras = Cameras(views.cameras.intrinsics, poses, SIZE, SIZE)
    wrong = dataclasses.replace(views, cameras=cameras)
    structure, mesh, moved, truth = start_of(solid, surfaces, 8)
    fixed = refine(structure, mesh, moved, wrong, BrepSettings(refine_poses=False))
    freed = refine(structure, mesh, moved, wrong, BrepSettings())
    assert freed.report["poses_freed"]
    assert freed.silhouette_px < 0.5 * fixed.silhouette_px
    # What all views share is a shift of the object: no residual shows it.
    assert surface_error(freed.mesh, truth) < surface_error(fixed.mesh, truth) + 5e-4


def test_a_hopeless_start_is_never_made_worse(block):
    views, solid, surfaces = block
    structure, mesh, moved, _ = start_of(solid, surfaces, 2)
    blank = dataclasses.replace(views, alpha=np.zeros_like(views.alpha), rgb=np.zeros_like(views.rgb))
    result = refine(structure, mesh, moved, blank, BrepSettings())
    assert not result.accepted
    assert np.isfinite(result.mesh.vertices).all()
    assert np.abs(result.mesh.vertices - mesh.vertices).max() < 1e-3


def test_same_inputs_same_bytes(block):
    views, solid, surfaces = block
    structure, mesh, moved, _ = start_of(solid, surfaces, 3)
    first, second = (refine(structure, mesh, moved, views, BrepSettings()) for _ in range(2))
    assert first.mesh.vertices.tobytes() == second.mesh.vertices.tobytes()
    assert {k: v for k, v in first.report.items() if k != "seconds"} == {
        k: v for k, v in second.report.items() if k != "seconds"
    }


def test_a_surface_without_a_face_follows_its_twin(block):
    views, solid, surfaces = block
    structure, mesh, moved, _ = start_of(solid, surfaces, 3)
    result = refine(structure, mesh, (*moved, moved[0].flip()), views, BrepSettings())
    points = np.random.default_rng(0).uniform(0, 1, (9, 3))
    np.testing.assert_allclose(
        result.surfaces[-1].signed_distance(points), -result.surfaces[0].signed_distance(points), atol=1e-12
    )


@pytest.mark.shared
@pytest.mark.skipif(not NUT.exists(), reason="needs ../shared/data")
@pytest.mark.parametrize("views", [50, 20])
def test_the_real_nut_is_exact_to_a_hundredth_of_a_pixel(views):
    solid, surfaces = nut_solid()
    structure, mesh, moved, truth = start_of(solid, surfaces, 21)
    result = refine(structure, mesh, moved, abc_views(NUT, views), BrepSettings())
    assert result.accepted
    assert surface_error(result.mesh, truth) < 3e-5
