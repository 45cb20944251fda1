"""Speed of the renderer's backends and of a training step: the rows of `results/benchmark/splatting.csv`."""

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from brepgaussian.artifacts.base import atomic
from brepgaussian.splatting.camera import Camera, RenderOptions
from brepgaussian.splatting.engine import LossWeights, plane_gradients, training_step
from brepgaussian.splatting.library import TILE, Cloud, Raster, view_params
from brepgaussian.splatting.parameters import Parameters, quaternions_of
from brepgaussian.splatting.targets import Target

COLUMNS = "backend threads surfels pixels forward_ms backward_ms loss_ms step_ms ratio_to_reference".split()
COUNTS = (2_000, 10_000, 50_000, 200_000)
SIZES = (200, 400, 800, 1600)
_REFERENCE_LIMIT = (10_000, 400)  # the reference is measured up to here: it takes seconds a pass
_REPEATS = 7  # the fastest is reported: other load on the machine only ever adds
_WEIGHTS = LossWeights(dssim=0.2, alpha=0.5, edge=0.1, normal=0.1, distortion=1.0)
_RADIUS = 0.35  # of the benchmark's sphere, unit frame
_COVER = 0.6  # standard deviation of a surfel in mean distances between surfels


@dataclass(frozen=True)
class Row:
    """One row of the table; empty where a figure does not exist.

    Attributes:
        backend: `reference`, `cpu` or `cuda`.
        threads: CPU threads.
        surfels: their number.
        pixels: side of the square image in px, before it is cropped to the object as in training.
        forward_ms: rendering; `backward_ms` its gradients; `loss_ms` losses and their gradients.
        step_ms: a training step: rendering, losses, gradients and Adam.
        ratio_to_reference: the reference's forward + backward over this backend's.
    """

    backend: str
    threads: int
    surfels: int
    pixels: int
    forward_ms: float
    backward_ms: float
    loss_ms: float | None
    step_ms: float | None
    ratio_to_reference: float | None

    def csv(self) -> str:
        """The row as text."""
        values = [getattr(self, c) for c in COLUMNS]
        return ",".join("" if v is None else f"{v:.3f}" if isinstance(v, float) else str(v) for v in values)


def sphere(count: int, seed: int = 0) -> Cloud:
    """Surfels spread over a sphere of radius 0.35 at the centre (a Fibonacci lattice), grey and edge channels."""
    rng = np.random.default_rng(seed)
    i = np.arange(count) + 0.5
    z, angle = 1 - 2 * i / count, i * np.pi * (1 + 5**0.5)
    normals = np.column_stack([np.sqrt(1 - z * z) * np.cos(angle), np.sqrt(1 - z * z) * np.sin(angle), z])
    spacing = np.sqrt(4 * np.pi / count) * _RADIUS
    return Cloud(
        (0.5 + _RADIUS * normals).astype(np.float32),
        quaternions_of(normals),
        np.full((count, 2), _COVER * spacing, np.float32),
        np.full(count, 0.9, np.float32),
        rng.random((count, 2), dtype=np.float32),
    )


def camera_at(size: int) -> Camera:
    """A camera 4 away whose `size` x `size` image holds the unit cube, as in ABC-NEF, cropped to the sphere."""
    pose = np.eye(4)
    pose[:3, 3] = [-0.5, -0.5, 3.5]
    focal = 1111.111 * size / 800
    crop = int(2 * focal * _RADIUS / 3.9) + 2 * TILE
    return Camera(pose, focal, focal, crop / 2, crop / 2, crop, crop)


def measure(action: Callable[[], object], repeats: int = _REPEATS) -> float:
    """Fastest time of an action in milliseconds, after one run that is not counted."""
    action()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        action()
        times.append(time.perf_counter() - start)
    return 1e3 * min(times)


def measure_cpu(count: int, size: int, threads: int, reference_ms: float | None) -> Row:
    """The kernels: rendering, losses, and a whole training step with Adam."""
    cloud, camera, raster = sphere(count), camera_at(size), Raster()
    options = RenderOptions(threads=threads)
    view = view_params(camera, 2, options)
    planes = raster.forward(cloud, view)
    target = Target(camera, np.ascontiguousarray(planes[:1] * 0.9), planes[7] * 1.0, planes[1] * 0.5)
    gradients, _ = plane_gradients(planes, target, _WEIGHTS, threads)
    parameters = Parameters(cloud)
    rates = dict.fromkeys(("centers", "quaternions", "scales", "opacities", "channels"), 1e-9)

    def step() -> None:
        trained = training_step(raster, parameters.cloud, target, _WEIGHTS, options)
        parameters.update(trained.gradients, rates, threads)

    forward = measure(lambda: raster.forward(cloud, view, planes))
    backward = measure(lambda: raster.backward(cloud, planes, gradients))
    into = raster.scratch("into", planes.shape)
    loss = measure(lambda: plane_gradients(planes, target, _WEIGHTS, threads, into))
    ratio = reference_ms / (forward + backward) if reference_ms else None
    return Row("cpu", threads, count, size, forward, backward, loss, measure(step), ratio)


def measure_torch(backend: str, count: int, size: int, threads: int) -> Row:
    """The reference or the cuda backend through autograd."""
    import torch

    from brepgaussian.splatting.render import SurfelTensors, render

    torch.set_num_threads(threads)
    device = "cuda" if backend == "cuda" else "cpu"
    arrays = [torch.tensor(a, device=device, requires_grad=True) for a in sphere(count).arrays()]
    camera = camera_at(size)
    surfels = SurfelTensors(arrays[0], arrays[1], arrays[2], arrays[3], arrays[4][:, :1], arrays[4][:, 1])

    def forward() -> torch.Tensor:
        image = render(surfels, camera, RenderOptions(threads=threads), backend)
        parts = (image.colors, image.alpha, image.depth, image.normals, image.edges, image.distortion)
        value = torch.stack([p.mean() for p in parts]).sum()
        if device == "cuda":
            torch.cuda.synchronize()
        return value

    def both() -> None:
        value = forward()
        torch.autograd.grad(value, arrays)
        if device == "cuda":
            torch.cuda.synchronize()

    repeats = 3 if backend == "reference" else _REPEATS
    with torch.no_grad():
        ahead = measure(forward, repeats)
    total = measure(both, repeats)
    return Row(backend, threads, count, size, ahead, max(total - ahead, 0.0), None, None, None)


def run(
    out_csv: str | Path,
    counts: Iterable[int] = COUNTS,
    sizes: Iterable[int] = SIZES,
    threads: Iterable[int] = (1, 2),
    reference: bool = True,
) -> list[Row]:
    """Measure every combination and write the table.

    Args:
        out_csv: where the table goes.
        counts: numbers of surfels.
        sizes: sides of the square image in px: the column `pixels`.
        threads: CPU threads.
        reference: also measure the torch reference (up to 10,000 surfels at 400 px) and the ratios to it.
    """
    from brepgaussian.splatting import cuda

    rows = []
    for count in counts:
        for size in sizes:
            slow = None
            if reference and count <= _REFERENCE_LIMIT[0] and size <= _REFERENCE_LIMIT[1]:
                row = measure_torch("reference", count, size, 1)
                slow = row.forward_ms + row.backward_ms
                rows.append(row)
            rows += [measure_cpu(count, size, t, slow if t == 1 else None) for t in threads]
            if cuda.is_available():
                rows.append(measure_torch("cuda", count, size, 1))
    with atomic(out_csv) as temporary:
        temporary.write_text("\n".join([",".join(COLUMNS), *(row.csv() for row in rows)]) + "\n")
    return rows


if __name__ == "__main__":
    for row in run("results/benchmark/splatting.csv"):
        print(row.csv())
