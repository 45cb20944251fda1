"""The cuda backend against the reference.

With a stand-in for gsplat everywhere; where gsplat is installed, with its kernels compiled for the CPU; on a GPU where
there is one.
"""

from dataclasses import replace
from types import SimpleNamespace

import gsplat_on_cpu
import gsplat_stand_in
import numpy as np
import pytest
import torch
from brepgaussian.errors import SettingsError
from brepgaussian.splatting import cuda, reference
from brepgaussian.splatting.camera import Camera, RenderOptions
from brepgaussian.splatting.engine import LossWeights, training_step
from brepgaussian.splatting.library import Cloud, Raster
from brepgaussian.splatting.render import SurfelTensors, render
from brepgaussian.splatting.targets import Target
from brepgaussian.splatting.torch_engine import training_step_torch
from scenes import camera, leaves, surfels

DEVICE = pytest.mark.skipif(not cuda.is_available(), reason="no CUDA device, or no gsplat")
BOTH_SIDES = RenderOptions(cull=False)


@pytest.fixture(scope="session")
def kernels_on_cpu(tmp_path_factory: pytest.TempPathFactory) -> SimpleNamespace:
    """gsplat's own kernels, compiled once for the CPU."""
    cuda_code = gsplat_on_cpu.sources()
    if cuda_code is None:
        pytest.skip("gsplat, whose kernels would be compiled for the CPU, or g++ is not installed")
    return gsplat_on_cpu.build(cuda_code, tmp_path_factory.mktemp("gsplat"))


@pytest.fixture(params=["stand-in", "kernels-on-cpu", pytest.param("device", marks=DEVICE)], autouse=True)
def _kernels(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    if request.param == "device":
        return
    stand_in = gsplat_stand_in if request.param == "stand-in" else request.getfixturevalue("kernels_on_cpu")
    monkeypatch.setattr(cuda, "load", lambda: (stand_in, "cpu"))


def distant(view: Camera, times: float = 20.0) -> Camera:
    """The same picture from further away, where perspective within a surfel is of no account."""
    pose = view.cam_from_unit.copy()
    pose[:3, 3] += np.array([0, 0, 3.0 * (times - 1)])
    return replace(view, cam_from_unit=pose, fx=view.fx * times, fy=view.fy * times)


def facing(scene: SurfelTensors, view: Camera, seed: int, most_deg: float = 70.0) -> SurfelTensors:
    """Turn all surfels to within an angle of the viewing direction, either side up."""
    rng = np.random.default_rng(seed)
    count = len(scene.centers)
    angle, around = np.deg2rad(rng.uniform(0, most_deg, count)), rng.uniform(0, 2 * np.pi, count)
    side = rng.choice([-1.0, 1.0], count)
    normal = np.column_stack([np.sin(angle) * np.cos(around), np.sin(angle) * np.sin(around), np.cos(angle)])
    normal = (side[:, None] * normal) @ view.cam_from_unit[:3, :3]
    half = np.column_stack([1 + normal[:, 2], -normal[:, 1], normal[:, 0], np.zeros(count)])  # from z to the normal
    with torch.no_grad():
        scene.quaternions.copy_(torch.as_tensor(half))
    return scene


def gradients(planes: torch.Tensor, scene: SurfelTensors, seed: int, skip: tuple[int, ...] = (-1,)) -> list:
    """Gradients of a random weighting of planes."""
    weights = torch.randn(planes.shape, dtype=planes.dtype, generator=torch.Generator().manual_seed(seed))
    for plane in skip:
        weights[plane] = 0
    return list(torch.autograd.grad((planes * weights).sum(), leaves(scene), materialize_grads=True))


def assert_same(
    scene: SurfelTensors, view: Camera, options: RenderOptions, close: float = 1e-3, skip: tuple[int, ...] = (-1,)
) -> None:
    """All planes but the median (and others to skip), and all gradients, relative to the largest."""
    truth, fast = reference.planes(scene, view, options), cuda.planes(scene, view, options)
    assert fast.shape == truth.shape
    assert fast.dtype == truth.dtype
    kept = [k for k in range(len(truth)) if k - len(truth) not in skip]
    torch.testing.assert_close(fast[kept], truth[kept], rtol=0, atol=close)
    for a, b in zip(gradients(fast, scene, 0, skip), gradients(truth, scene, 0, skip), strict=True):
        scale = float(b.abs().max()) if b.numel() else 0.0
        torch.testing.assert_close(a, b, rtol=0, atol=5 * close * scale + 1e-6)


@pytest.mark.parametrize("count", [1, 2, 7, 40, 150])
def test_agrees_with_the_reference(count: int) -> None:
    view = distant(camera(40, 33))
    assert_same(facing(surfels(count, count, size=0.08), view, count), view, BOTH_SIDES)


@pytest.mark.parametrize("size", [0.005, 0.08])
def test_the_filter_agrees_but_for_depths(size: float) -> None:
    """Off its disk a filtered surfel has the depth of its centre, which no affine function can follow."""
    view = distant(camera(40, 33))
    scene = facing(surfels(60, 8, size=size), view, 8)
    assert_same(scene, view, replace(BOTH_SIDES, low_pass_px=0.5**0.5), skip=(-4, -3, -1))
    truth, fast = (m.planes(scene, view, replace(BOTH_SIDES, low_pass_px=0.71))[-4] for m in (reference, cuda))
    torch.testing.assert_close(fast, truth, rtol=0, atol=0.05)


@pytest.mark.parametrize(("cx", "cy"), [(-3.0, 4.5), (70.0, 16.0), (20.0, -40.0)])
def test_off_centre_principal_points_agree(cx: float, cy: float) -> None:
    view = distant(camera(40, 33, cx=cx, cy=cy))
    scene = facing(surfels(40, 3, size=0.15), view, 3)
    assert_same(scene, view, BOTH_SIDES)


def test_deep_stack_is_opaque_and_agrees() -> None:
    view = distant(camera())
    scene = facing(surfels(400, 7, size=0.2), view, 7, most_deg=5)
    assert_same(scene, view, BOTH_SIDES, close=1e-2)  # gsplat leaves out the surfel that closes a pixel
    assert float(render(scene, view, BOTH_SIDES, "cuda").alpha.detach()[9, 10]) > 0.999


@pytest.mark.parametrize("channels", [(1, 0), (3, 0), (3, 2), (3, 16), (1, 33)])
def test_every_number_of_channels(channels: tuple[int, int]) -> None:
    view = distant(camera())
    scene = facing(surfels(12, 3, colors=channels[0], features=channels[1], size=0.1), view, 3)
    assert_same(scene, view, BOTH_SIDES)


def test_culled_surfels_agree() -> None:
    view = distant(camera())
    assert_same(facing(surfels(40, 5, size=0.1), view, 5), view, RenderOptions(cull=True))


def test_nothing_to_see() -> None:
    view = camera()
    behind, beside = surfels(5, 1), surfels(5, 1)
    with torch.no_grad():
        behind.centers.sub_(10 * torch.as_tensor(view.cam_from_unit[2, :3]))
        beside.centers.add_(10 * torch.as_tensor(view.cam_from_unit[0, :3]))
    for scene in (surfels(0, 1), behind, beside):
        image = render(scene, view, BOTH_SIDES, "cuda")
        assert float(image.alpha.detach().abs().sum()) == 0
        assert float(image.depth.detach().abs().sum()) == 0
        planes = cuda.planes(scene, view, BOTH_SIDES)
        assert all(float(g.abs().sum()) == 0 for g in gradients(planes, scene, 0, ()))


@pytest.mark.parametrize("low_pass", [0.0, 0.71])
def test_edge_on_and_huge_surfels_stay_finite(low_pass: float) -> None:
    view = camera()
    scene = facing(surfels(3, 2), view, 2)
    side = np.cross(view.cam_from_unit[2, :3], [0.0, 1.0, 0.0])
    with torch.no_grad():
        scene.centers[:] = 0.5
        scene.quaternions[0] = torch.tensor([1 + side[2], -side[1], side[0], 0.0])  # normal across the ray
        scene.scales[1] = 50.0
    planes = cuda.planes(scene, view, replace(BOTH_SIDES, low_pass_px=low_pass))
    assert torch.isfinite(planes).all()
    assert all(torch.isfinite(g).all() for g in gradients(planes, scene, 0, ()))


def test_a_disk_larger_than_its_distance_fills_the_view() -> None:
    """It faces the camera, so that it does not reach the camera's plane, but the ball around it does."""
    scene, view = one_disk(0.0, 5.0), frontal(100.0, 40)
    truth, fast = (module.planes(scene, view, RenderOptions()) for module in (reference, cuda))
    assert (truth[-2] > 0.7).all()
    torch.testing.assert_close(fast, truth, rtol=0, atol=1e-4)


def test_median_depth_is_that_of_the_centre_that_makes_a_pixel_half_opaque() -> None:
    view = distant(camera(40, 33))
    scene = facing(surfels(40, 4, size=0.2), view, 4, most_deg=0.1)
    truth, fast = reference.planes(scene, view, BOTH_SIDES)[-1], cuda.planes(scene, view, BOTH_SIDES)[-1]
    assert (truth > 0).any()
    assert (truth == 0).any()
    wrong = (truth - fast).abs() > 2e-3  # 0.1 degrees on a disk
    assert float(wrong.double().mean()) < 0.002
    assert all(torch.isfinite(g).all() for g in torch.autograd.grad(fast.sum(), leaves(scene)[:3]))


def one_disk(tilt: float, scale: float) -> SurfelTensors:
    """A disk at the centre of the unit cube, turned by `tilt` about y from facing -z."""
    one = torch.ones(1, dtype=torch.float64)
    q = torch.tensor([[np.cos((np.pi + tilt) / 2), 0.0, np.sin((np.pi + tilt) / 2), 0.0]], dtype=torch.float64)
    centers = torch.full((1, 3), 0.5, dtype=torch.float64)
    return SurfelTensors(centers, q, scale * torch.ones(1, 2).double(), 0.8 * one, one[:, None], 0.5 * one)


def frontal(focal: float, size: int) -> Camera:
    pose = np.eye(4)
    pose[:3, 3] = [-0.5, -0.5, 2.5]
    return Camera(pose, focal, focal, size / 2, size / 2, size, size)


def test_one_disk_against_arithmetic() -> None:
    """A disk 3 away that faces the camera: Gaussian alpha, plane depth, its own normal, no filter."""
    image = render(one_disk(0.0, 0.1), frontal(100.0, 31), RenderOptions(), "cuda")
    y, x = np.mgrid[:31, :31]
    u, v = (x - 15) * 3 / 100 / 0.1, (y - 15) * 3 / 100 / 0.1
    alpha = 0.8 * np.exp(-(u**2 + v**2) / 2)
    alpha[alpha < 1 / 255] = 0
    np.testing.assert_allclose(image.alpha, alpha, atol=1e-5)
    np.testing.assert_allclose(image.depth[alpha > 0], 3, atol=1e-5)
    np.testing.assert_allclose(image.median_depth, np.where(alpha >= 0.5, 3, 0), atol=1e-5)
    np.testing.assert_allclose(image.edges, 0.5 * alpha, atol=1e-5)
    np.testing.assert_allclose(image.normals[15, 15], [0, 0, -0.8], atol=1e-5)
    np.testing.assert_allclose(image.distortion, 0, atol=1e-5)


@pytest.mark.parametrize("tilt", [-1.0, 0.3, 0.6, 1.2])
def test_a_tilted_disk_has_the_depth_of_its_plane_to_the_second_order(tilt: float) -> None:
    scale, size = 0.02, 32
    image = render(one_disk(tilt, scale), frontal(900.0, size), RenderOptions(), "cuda")
    normal = np.array([-np.sin(tilt), 0, -np.cos(tilt)])
    x = (np.arange(size) + 0.5 - size / 2) / 900
    truth = 3 * normal[2] / (normal[0] * x + normal[2])
    seen = image.alpha[size // 2].numpy() > 0
    assert seen.any()
    error, offset = image.depth[size // 2].numpy()[seen] - truth[seen], truth[seen] - 3
    assert (np.abs(error) <= 1.1 * offset**2 / 3 + 1e-5).all()
    np.testing.assert_allclose(image.distortion, 0, atol=1e-6)


def test_a_filter_that_gsplat_does_not_have_is_refused() -> None:
    with pytest.raises(SettingsError, match="low_pass_px"):
        cuda.planes(surfels(3, 0), camera(), RenderOptions(low_pass_px=0.3))


def test_a_training_step_agrees_with_the_reference() -> None:
    """Losses, gradients of the cloud and of the projected centres: what densification and Adam are given."""
    view = distant(camera(32, 32))
    scene = facing(surfels(60, 6, colors=1, features=0, size=0.1), view, 6)
    arrays = (scene.centers, scene.quaternions, scene.scales, scene.opacities, scene.channels())
    cloud = Cloud(*(np.ascontiguousarray(a.detach().numpy(), np.float32) for a in arrays))
    rng = np.random.default_rng(0)
    target = Target(view, *(rng.random(s, np.float32) for s in ((1, 32, 32), (32, 32), (32, 32))))
    weights = LossWeights(dssim=0.2, alpha=0.5, edge=0.1, normal=0.1, distortion=1.0)
    truth, fast = (training_step_torch(b, cloud, target, weights, BOTH_SIDES) for b in ("reference", "cuda"))
    for name, value in truth.losses.items():
        assert fast.losses[name] == pytest.approx(value, rel=2e-3, abs=1e-5), name
    for a, b in zip((*fast.gradients.arrays(), fast.screen), (*truth.gradients.arrays(), truth.screen), strict=True):
        np.testing.assert_allclose(a, b, atol=1e-2 * np.abs(b).max())
    kernels = training_step(Raster(), cloud, target, weights, BOTH_SIDES)
    np.testing.assert_allclose(fast.screen, kernels.screen, atol=0.05 * np.abs(kernels.screen).max())
    np.testing.assert_array_equal(fast.weights > 0, kernels.weights > 0)
