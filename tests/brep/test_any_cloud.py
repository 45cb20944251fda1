"""Any point cloud of the right form ends in one closed valid solid or in a clear error."""

import numpy as np
import pytest
from brepgaussian.artifacts.points import read_points
from brepgaussian.artifacts.primitives import Primitives
from brepgaussian.brep import occ
from brepgaussian.brep.gate import integrity
from brepgaussian.brep.ladder import climb, make_job
from brepgaussian.brep.stage import build_brep
from brepgaussian.brep.worker import Worker
from brepgaussian.errors import ArtifactError, BrepGaussianError
from brepgaussian.primitives.stage import primitives_of
from brepgaussian.settings.brep import BrepSettings
from brepgaussian.settings.primitives import PrimitivesSettings
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

SHAPES = ("cube", "box", "sphere", "plane", "line", "point", "two clusters")


@pytest.fixture(scope="module")
def worker():
    with Worker() as one:
        yield one


def cloud(kit, shape, labels, count, seed, duplicates):
    """Points of some shape, however senseless, with some labels."""
    rng = np.random.default_rng(seed)
    xyz = rng.random((count, 3))
    if shape == "box":  # of a surface
        axis = rng.integers(0, 3, count)
        xyz[np.arange(count), axis] = rng.integers(0, 2, count)
    elif shape == "sphere":
        away = xyz - 0.5
        xyz = 0.5 + 0.5 * away / np.linalg.norm(away, axis=1, keepdims=True)
    elif shape == "plane":
        xyz[:, 2] = 0.5
    elif shape == "line":
        xyz[:, 1:] = 0.5
    elif shape == "point":
        xyz[:] = 0.5
    elif shape == "two clusters":
        xyz = 0.1 * xyz + 0.9 * rng.integers(0, 2, (count, 1))
    if duplicates:
        xyz = xyz[rng.integers(0, max(count // 4, 1), count)]
    normals = rng.normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    label = rng.integers(0, labels, count) if labels else np.full(count, -1)
    return kit.make_points(xyz, normals, np.unique(label, return_inverse=True)[1] if labels else label)


def attempted(make):
    """What a function gives; None for a clear error. Others pass through."""
    try:
        return make()
    except BrepGaussianError:
        return None


@settings(max_examples=7, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    shape=st.sampled_from(SHAPES),
    labels=st.sampled_from([0, 1, 2, 7]),
    count=st.sampled_from([1, 5, 60, 700]),
    seed=st.integers(0, 5),
    duplicates=st.booleans(),
)
def test_any_cloud_ends_in_a_closed_solid_or_a_clear_error(kit, worker, shape, labels, count, seed, duplicates):
    points = cloud(kit, shape, labels, count, seed, duplicates)
    views = kit.make_views(kit.box_corners(np.ones(3)))
    chosen = BrepSettings(refine=False, time_limit_s=20.0, most_solids=8)
    primitives = attempted(lambda: primitives_of(points, PrimitivesSettings())) or Primitives(())
    job = make_job(views, points, primitives, chosen)
    outcome = attempted(lambda: climb(worker, job, points, views))
    assert outcome is None or integrity(occ.from_bytes(outcome.shape)) == ()


def test_points_that_are_not_finite_are_refused(kit, paths, tmp_path):
    known = kit.block_with_hole(count=600)
    files = paths(known)
    known.points.xyz[3, 1] = np.nan
    known.points.write(tmp_path / "points.ply")
    with pytest.raises(ArtifactError, match="finite"):
        read_points(tmp_path / "points.ply")
    with pytest.raises(ArtifactError, match=r"points\.ply"):
        build_brep(**files, settings=BrepSettings())
