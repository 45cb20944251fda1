"""Small pieces: contrastive losses, compositing weights, Adam, densification, the kernel's build."""

import subprocess
from pathlib import Path

import numpy as np
import pytest
import torch
from brepgaussian.errors import ToolError
from brepgaussian.splatting import build
from brepgaussian.splatting.benchmark import COLUMNS, camera_at, measure_cpu, measure_torch, sphere
from brepgaussian.splatting.camera import RenderOptions
from brepgaussian.splatting.contrastive import LOSSES, normalised, positives, through_normalisation
from brepgaussian.splatting.densify import Statistics, densify
from brepgaussian.splatting.library import Cloud, Raster, view_params
from brepgaussian.splatting.parameters import Parameters, quaternions_of, turned


@pytest.mark.parametrize("loss", list(LOSSES))
def test_contrastive_gradients_against_finite_differences(loss: str) -> None:
    rng = np.random.default_rng(0)
    features = rng.standard_normal((12, 4))
    patches = np.repeat([1, 2, 5], 4).astype(np.int16)

    def value(f: np.ndarray) -> float:
        return LOSSES[loss](normalised(f)[0], patches, 0.7, np.random.default_rng(3))[0]

    unit, length = normalised(features)
    gradient = through_normalisation(LOSSES[loss](unit, patches, 0.7, np.random.default_rng(3))[1], unit, length)
    for index in np.ndindex(features.shape):
        step = np.zeros_like(features)
        step[index] = 1e-6
        numeric = (value(features + step) - value(features - step)) / 2e-6
        assert gradient[index] == pytest.approx(numeric, abs=2e-5)


def test_triplet_by_hand() -> None:
    """Two regions at right angles: d(a, p) = 0, d(a, n) = 1, so that the hinge is the margin less one."""
    unit = np.array([[1, 0], [1, 0], [0, 1], [0, 1]], np.float32)
    patches = np.array([1, 1, 2, 2], np.int16)
    rng = np.random.default_rng(0)
    assert LOSSES["triplet"](unit, patches, 0.5, rng)[0] == 0
    assert LOSSES["triplet"](unit, patches, 1.5, rng)[0] == pytest.approx(0.5)


def test_positives_share_the_region() -> None:
    patches = np.array([3, 1, 3, 2, 1, 3, 1], np.int16)
    found = positives(patches, np.random.default_rng(1))
    assert (patches[found] == patches).all()
    assert (found != np.arange(7))[patches != 2].all()
    assert found[3] == 3


def test_compositing_weights_are_those_of_the_image() -> None:
    cloud, camera = sphere(400), camera_at(200)
    raster = Raster()
    planes = raster.forward(cloud, view_params(camera, 2, RenderOptions()))
    y, x = (a.ravel() for a in np.mgrid[: camera.height, : camera.width])
    surfels, weights, counts = raster.weights(np.column_stack([x, y]), 64)
    assert counts.max() < 64
    composited = (weights[..., None] * cloud.channels[surfels]).sum(axis=1)
    expected = planes[:2, : camera.height, : camera.width].reshape(2, -1).T
    np.testing.assert_allclose(composited, expected, atol=1e-4)


@pytest.mark.parametrize("kind", ["centers", "scales", "opacities"])
def test_adam_against_torch(kind: str) -> None:
    rng = np.random.default_rng(2)
    parameters = Parameters(sphere(10))
    raw = torch.tensor(parameters.raw[kind], dtype=torch.float64, requires_grad=True)
    optimiser = torch.optim.Adam([raw], lr=0.01, eps=1e-15)
    activation = {"centers": lambda v: v, "scales": torch.exp, "opacities": torch.sigmoid}[kind]
    for _ in range(5):
        gradients = Cloud(*(rng.standard_normal(a.shape).astype(np.float32) for a in parameters.cloud.arrays()))
        optimiser.zero_grad()
        (activation(raw) * torch.tensor(getattr(gradients, kind), dtype=torch.float64)).sum().backward()
        optimiser.step()
        parameters.update(gradients, {kind: 0.01}, 1)
    expected = activation(raw).detach().numpy()
    np.testing.assert_allclose(getattr(parameters.cloud, kind), expected, rtol=2e-4, atol=1e-5)


def test_densification_splits_the_pulled_and_drops_the_unseen() -> None:
    parameters, statistics = Parameters(sphere(100)), Statistics(100)
    screen, weights = np.zeros((100, 2), np.float32), np.ones(100, np.float32)
    screen[7], weights[3] = 1.0, 0.0
    statistics.add(screen, weights)
    result = densify(parameters, statistics, share=0.01, smallest=0.0, limit=1000)
    assert len(result) == 100  # one dropped, one split into two
    middle = result.cloud.centers[-2:].mean(axis=0)
    np.testing.assert_allclose(middle, parameters.cloud.centers[7], atol=1e-6)
    assert densify(parameters, statistics, share=0.5, smallest=0.0, limit=50).cloud.centers.shape[0] == 99


def test_quaternions_turn_the_z_axis() -> None:
    rng = np.random.default_rng(4)
    normals = rng.standard_normal((50, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    normals[0] = (0, 0, -1)
    cloud = sphere(50)
    cloud.quaternions = quaternions_of(normals)
    surfels = Parameters(cloud).surfels()
    np.testing.assert_allclose(surfels.normals, normals, atol=1e-5)
    cloud.quaternions = turned(cloud.quaternions, surfels.normals, np.roll(surfels.normals, 1, axis=0))
    np.testing.assert_allclose(Parameters(cloud).surfels().normals, np.roll(normals, 1, axis=0), atol=1e-4)


def test_missing_compiler_is_a_clear_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(build.FOLDER_VARIABLE, str(tmp_path))
    monkeypatch.setenv("CXX", "no-such-compiler")
    with pytest.raises(ToolError, match=r"package g\+\+"):
        build.build_kernel()
    assert not list(tmp_path.iterdir())


def test_failing_compiler_leaves_nothing_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(build.FOLDER_VARIABLE, str(tmp_path))
    monkeypatch.setattr(build, "SOURCES", tmp_path / "none")
    (tmp_path / "none").mkdir()
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: subprocess.CompletedProcess([], 1, "", "broken"))
    with pytest.raises(ToolError, match="broken"):
        build.build_kernel()
    assert not list(tmp_path.glob("*.so"))


def test_benchmark_row_has_every_column() -> None:
    row = measure_cpu(200, 100, 1, 1000.0)
    assert len(row.csv().split(",")) == len(COLUMNS)


@pytest.mark.parametrize("side", [100, 160])
def test_benchmark_pixels_are_the_side_of_the_image(side: int) -> None:
    rows = [measure_cpu(200, side, 1, None), measure_torch("reference", 200, side, 1)]
    assert [row.pixels for row in rows] == [side, side]
    assert camera_at(side).width < side  # what is rendered is the object's crop
