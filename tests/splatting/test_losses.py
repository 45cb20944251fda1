"""The fused losses and their gradients against torch's autograd."""

import numpy as np
import pytest
import torch
from brepgaussian.splatting.benchmark import camera_at, sphere
from brepgaussian.splatting.camera import RenderOptions
from brepgaussian.splatting.engine import LossWeights, plane_gradients, training_step
from brepgaussian.splatting.library import Raster, view_params
from brepgaussian.splatting.losses import dssim
from brepgaussian.splatting.targets import Target
from brepgaussian.splatting.torch_engine import plane_losses
from scenes import camera

NONE = LossWeights(dssim=0.0, alpha=0.0, edge=0.0, normal=0.0, distortion=0.0)


def case(colors: int, seed: int = 0) -> tuple[np.ndarray, Target]:
    """Planes that are no multiple of a tile in size, covered in part, and a target."""
    rng = np.random.default_rng(seed)
    view = camera(37, 29)
    rows, stride = 32, 40
    planes = np.zeros((colors + 8, rows, stride), np.float32)
    image = planes[:, :29, :37]
    image[:] = rng.random(image.shape)
    image[colors + 1 : colors + 4] -= 0.5
    image[colors + 4] = 0.2 * rng.random((29, 37)) - 0.1
    image[colors + 5] = 0.1 * rng.random((29, 37))
    image[colors + 6, :, :8] = 0.0  # nothing there
    image[colors + 6, :, 12:] = 0.6 + 0.4 * rng.random((29, 25))

    def plane(*shape: int) -> np.ndarray:
        result = np.zeros((*shape, rows, stride), np.float32)
        result[..., :29, :37] = rng.random((*shape, 29, 37))
        return result

    return planes, Target(view, plane(colors), plane(), plane())


@pytest.mark.parametrize("colors", [1, 3])
@pytest.mark.parametrize("term", ["l1", "dssim", "alpha", "edge", "normal", "distortion"])
def test_fused_losses_match_torch(colors: int, term: str) -> None:
    planes, target = case(colors)
    weights = NONE if term == "l1" else LossWeights(**{**vars(NONE), term: 0.7})
    fused, losses = plane_gradients(planes, target, weights, 1)
    leaf = torch.tensor(planes[:, :29, :37], dtype=torch.float64, requires_grad=True)
    total, truth = plane_losses(leaf, target, weights)
    (gradient,) = torch.autograd.grad(total, leaf)
    assert losses.keys() == truth.keys()
    for name, value in truth.items():
        assert losses[name] == pytest.approx(value, rel=1e-4)
    expected = gradient.numpy()
    scale = np.abs(expected).max()
    np.testing.assert_allclose(fused[:, :29, :37], expected, rtol=2e-3, atol=2e-4 * scale)


def test_two_threads_give_the_same_bytes() -> None:
    planes, target = case(1)
    weights = LossWeights(dssim=0.2, alpha=0.5, edge=0.1, normal=0.1, distortion=1.0)
    one, two = (plane_gradients(planes, target, weights, threads) for threads in (1, 2))
    assert one[0].tobytes() == two[0].tobytes()
    assert one[1] == two[1]


def test_dssim_against_scikit_image() -> None:
    """Away from the border, where scikit-image mirrors and we see zeros."""
    from skimage.metrics import structural_similarity

    rng = np.random.default_rng(1)
    x = rng.random((64, 64))
    y = np.clip(x + 0.1 * rng.standard_normal(x.shape), 0, 1)
    x, y = np.pad(x, 16), np.pad(y, 16)
    options = {"gaussian_weights": True, "sigma": 1.5, "use_sample_covariance": False, "data_range": 1.0}
    ours = float(dssim(torch.tensor(x), torch.tensor(y)))
    # scikit-image's window is cut at 3.5 sigma: 11 pixels, as ours
    _, image = structural_similarity(x, y, full=True, **options)
    assert ours == pytest.approx(float((1 - image).mean()), abs=1e-4)


def test_a_step_leaves_nothing_of_the_last_one() -> None:
    """Steps share memory: views of different sizes in any order give what fresh memory gives."""
    cloud, shared = sphere(300), Raster()
    weights = LossWeights(dssim=0.2, alpha=0.5, edge=0.1, normal=0.1, distortion=1.0)
    for size in (60, 120, 60, 90):
        view = camera_at(size)
        planes = Raster().forward(cloud, view_params(view, 2, RenderOptions()))
        target = Target(view, np.ascontiguousarray(planes[:1] * 0.5), planes[7] * 0.9, planes[1] * 0.5)
        again, fresh = (training_step(r, cloud, target, weights, RenderOptions()) for r in (shared, Raster()))
        assert again.losses == fresh.losses
        for a, b in zip(again.gradients.arrays(), fresh.gradients.arrays(), strict=True):
            np.testing.assert_array_equal(a, b)
