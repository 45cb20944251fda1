"""Backends against each other, against finite differences, and in scenes that break careless rasterisers."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from brepgaussian.errors import SettingsError, ToolError
from brepgaussian.splatting import cpu, reference
from brepgaussian.splatting.camera import Camera, RenderOptions
from brepgaussian.splatting.render import SurfelTensors, choose_backend, render
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import SMOOTH, camera, leaves, surfels


def gradients(planes: torch.Tensor, scene: SurfelTensors, seed: int) -> list[torch.Tensor]:
    """Gradients of a random weighting of all planes."""
    generator = torch.Generator().manual_seed(seed)
    weights = torch.randn(planes.shape, dtype=planes.dtype, generator=generator)
    weights[-1] = 0  # the median depth is compared on its own
    return list(torch.autograd.grad((planes * weights).sum(), leaves(scene), materialize_grads=True))


def assert_same(scene: SurfelTensors, view: Camera, options: RenderOptions, seed: int = 0) -> None:
    """Reference (float64) and kernels (float32) agree, gradients too."""
    truth, fast = reference.planes(scene, view, options), cpu.planes(scene, view, options)
    torch.testing.assert_close(fast, truth, rtol=1e-4, atol=2e-5)
    for a, b in zip(gradients(fast, scene, seed), gradients(truth, scene, seed), strict=True):
        scale = float(b.detach().abs().max()) if b.numel() else 0.0
        torch.testing.assert_close(a, b, rtol=1e-3, atol=1e-4 * scale + 1e-6)


@settings(max_examples=15, deadline=None)
@given(
    count=st.sampled_from([0, 1, 2, 7, 40]),
    seed=st.integers(0, 10_000),
    low_pass=st.sampled_from([0.0, 0.3, 0.71]),
    cull=st.booleans(),
    cx=st.floats(-5, 30),
    size=st.sampled_from([0.005, 0.05, 0.3]),
)
def test_backends_agree(count: int, seed: int, low_pass: float, cull: bool, cx: float, size: float) -> None:
    options = replace(SMOOTH, low_pass_px=low_pass, cull=cull)
    assert_same(surfels(count, seed, size=size), camera(cx=cx, cy=4.5), options, seed)


@pytest.mark.parametrize("channels", [(1, 0), (1, 1), (3, 0), (3, 16)])
def test_every_number_of_channels(channels: tuple[int, int]) -> None:
    scene = surfels(12, 3, colors=channels[0], features=channels[1])
    assert_same(scene, camera(), replace(SMOOTH, cull=False))


def test_default_cut_offs_agree() -> None:
    """Forward only: the cut-offs are steps, where a gradient says little."""
    scene = surfels(200, 5, size=0.08)
    view, options = camera(40, 30), RenderOptions(low_pass_px=0.3)
    truth, fast = reference.planes(scene, view, options), cpu.planes(scene, view, options)
    wrong = ((truth - fast).abs() > 1e-3).double().mean()
    assert wrong < 0.002  # pixels where rounding decides whether alpha > 1 / 255


def test_deep_stack_is_opaque_and_agrees() -> None:
    scene = surfels(300, 7, size=0.2)
    with torch.no_grad():
        scene.quaternions[:] = torch.tensor([0.0, 1.0, 0.0, 0.0])  # all face the camera side
    assert_same(scene, camera(), replace(SMOOTH, cull=False))
    image = render(scene, camera(), RenderOptions(cull=False), "cpu")
    assert float(image.alpha.detach()[9, 10]) > 0.999


@pytest.mark.parametrize("backend", ["reference", "cpu"])
def test_nothing_to_see(backend: str) -> None:
    view = camera()
    forward = torch.tensor(view.cam_from_unit[2, :3])
    behind = surfels(5, 1)
    with torch.no_grad():
        behind.centers.sub_(10 * forward)
    for scene in (surfels(0, 1), behind):
        image = render(scene, view, RenderOptions(cull=False), backend)
        assert float(image.alpha.abs().sum()) == 0
        assert float(image.depth.abs().sum()) == 0


@pytest.mark.parametrize("backend", ["reference", "cpu"])
def test_edge_on_and_huge_surfels_stay_finite(backend: str) -> None:
    view = camera()
    scene = surfels(3, 2)
    forward = view.cam_from_unit[2, :3]
    with torch.no_grad():
        scene.centers[:] = 0.5
        side = np.cross(forward, [0.0, 1.0, 0.0])
        # normal across the viewing direction: z axis turned into `side`
        w = 1 + side[2]
        scene.quaternions[0] = torch.tensor([w, -side[1], side[0], 0.0])
        scene.scales[1] = 50.0
    planes = (reference if backend == "reference" else cpu).planes(scene, view, replace(SMOOTH, cull=False))
    assert torch.isfinite(planes).all()
    assert all(torch.isfinite(g).all() for g in gradients(planes, scene, 0))


def one_disk(tilt: float = 0.0) -> SurfelTensors:
    """A disk at the centre of the unit cube, turned by `tilt` about y from facing -z."""
    q = torch.tensor([[np.cos((np.pi + tilt) / 2), 0.0, np.sin((np.pi + tilt) / 2), 0.0]], dtype=torch.float64)
    one = torch.ones(1, dtype=torch.float64)
    return SurfelTensors(
        torch.full((1, 3), 0.5, dtype=torch.float64), q, 0.1 * torch.ones(1, 2), 0.8 * one, one[:, None], 0.5 * one
    )


@pytest.mark.parametrize("backend", ["reference", "cpu"])
def test_one_disk_against_arithmetic(backend: str) -> None:
    """A disk 3 away that faces the camera: Gaussian alpha, plane depth, its own normal."""
    pose = np.eye(4)
    pose[:3, 3] = [-0.5, -0.5, 2.5]
    view = Camera(pose, 100.0, 100.0, 15.5, 10.5, 31, 21)
    image = render(one_disk(), view, RenderOptions(), backend)
    y, x = np.mgrid[:21, :31]
    u, v = (x - 15) * 3 / 100 / 0.1, (y - 10) * 3 / 100 / 0.1
    alpha = 0.8 * np.exp(-(u**2 + v**2) / 2)
    alpha[alpha < 1 / 255] = 0
    np.testing.assert_allclose(image.alpha.detach(), alpha, atol=1e-5)
    seen = alpha > 0
    np.testing.assert_allclose(image.depth.detach()[seen], 3, atol=1e-5)
    np.testing.assert_allclose(image.median_depth.detach()[alpha > 0.5], 3, atol=1e-5)
    np.testing.assert_allclose(image.edges.detach(), 0.5 * alpha, atol=1e-5)
    np.testing.assert_allclose(image.normals.detach()[10, 15], [0, 0, -0.8], atol=1e-5)
    np.testing.assert_allclose(image.distortion.detach(), 0, atol=1e-5)


@pytest.mark.parametrize("backend", ["reference", "cpu"])
def test_tilted_disk_has_the_depth_of_its_plane(backend: str) -> None:
    pose = np.eye(4)
    pose[:3, 3] = [-0.5, -0.5, 2.5]
    view = Camera(pose, 200.0, 200.0, 16.0, 16.0, 32, 32)
    tilt = 0.6
    image = render(one_disk(tilt), view, RenderOptions(), backend)
    normal = np.array([-np.sin(tilt), 0, -np.cos(tilt)])
    x = (np.arange(32) + 0.5 - 16) / 200
    expected = 3 * normal[2] / (normal[0] * x + normal[2])
    seen = image.alpha.detach()[16].numpy() > 0
    np.testing.assert_allclose(image.depth.detach()[16].numpy()[seen], expected[seen], rtol=1e-5)


def test_gradients_against_finite_differences() -> None:
    """Central differences in float64 on the reference, compared with the kernels' analytic gradients."""
    scene, view, options = surfels(6, 11, size=0.1), camera(13, 12), replace(SMOOTH, cull=False)
    weights = torch.randn(reference.planes(scene, view, options).shape, dtype=torch.float64)
    weights[-1] = 0
    loss = (cpu.planes(scene, view, options) * weights).sum()
    analytic = torch.autograd.grad(loss, leaves(scene))
    rng = np.random.default_rng(0)
    for leaf, gradient in zip(leaves(scene), analytic, strict=True):
        scale = float(gradient.abs().max())
        for index in rng.choice(leaf.numel(), min(6, leaf.numel()), replace=False):
            flat, step = leaf.detach().view(-1), 1e-5
            before = float(flat[index])
            values = []
            for sign in (1, -1):
                flat[index] = before + sign * step
                values.append(float((reference.planes(scene, view, options) * weights).sum().detach()))
            flat[index] = before
            numeric = (values[0] - values[1]) / (2 * step)
            assert abs(numeric - float(gradient.reshape(-1)[index])) < 1e-3 * scale + 1e-5


def test_median_depth_gradient() -> None:
    scene, view, options = surfels(20, 4, size=0.2), camera(), replace(SMOOTH, cull=False)
    grads = []
    for module in (reference, cpu):
        median = module.planes(scene, view, options)[-1]
        assert (median > 0).any()
        grads.append(torch.autograd.grad(median.sum(), leaves(scene)[:3]))
    for a, b in zip(*grads, strict=True):
        torch.testing.assert_close(a, b, rtol=1e-3, atol=1e-3 * float(a.abs().max()))


def test_one_and_two_threads_give_the_same_bytes() -> None:
    scene, view = surfels(400, 9, size=0.05), camera(90, 70)
    results = []
    for threads in (1, 2):
        planes = cpu.planes(scene, view, RenderOptions(low_pass_px=0.3, threads=threads))
        results.append([planes.detach(), *gradients(planes, scene, 1)])
    assert all(torch.equal(a, b) for a, b in zip(*results, strict=True))


def test_culling_leaves_out_surfels_that_face_away() -> None:
    scene, view = surfels(30, 8), camera()
    both = render(scene, view, RenderOptions(cull=False)).alpha.detach()
    front = render(scene, view, RenderOptions(cull=True)).alpha.detach()
    assert (front <= both + 1e-6).all()
    assert front.sum() < both.sum()


def test_device_is_never_replaced() -> None:
    assert choose_backend("cpu") == "cpu"
    with pytest.raises(SettingsError):
        choose_backend("tpu")
    if not torch.cuda.is_available():
        with pytest.raises(ToolError, match=r"gsplat|CUDA"):
            render(surfels(1, 0), camera(), backend="cuda")
