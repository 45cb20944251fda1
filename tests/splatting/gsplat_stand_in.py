"""The three functions of gsplat 1.5.3 that the cuda backend calls, in plain torch, written from the CUDA sources.

They have gsplat's cut-offs, its order of compositing and its faults, so that the backend is tested without a device.
"""

import torch
from torch import Tensor

WIDTHS = (1, 2, 3, 4, 8, 16, 32, 64, 128, 256, 512)
ALPHA_THRESHOLD, ALPHA_MAX, DONE, FILTER_INV_SQUARE = 1 / 255, 0.999, 1e-4, 2.0


def isect_tiles(
    means2d: Tensor, radii: Tensor, depths: Tensor, tile_size: int, tile_width: int, tile_height: int
) -> tuple[Tensor, Tensor, Tensor]:
    """intersect_tile_kernel and the radix sort: tile | bits of depth, and the surfel of each pair."""
    assert means2d.shape == (*radii.shape[:-1], 2)
    assert radii.dtype == torch.int32
    assert depths.shape == means2d.shape[:-1] == (1, means2d.shape[1])
    limit = torch.tensor([tile_width, tile_height])
    low = ((means2d[0] - radii[0]) / tile_size).floor().long().clamp_min(0).minimum(limit)
    high = ((means2d[0] + radii[0]) / tile_size).ceil().long().clamp_min(0).minimum(limit)
    bits = depths[0].contiguous().view(torch.int32).long()
    pairs = [
        ((y * tile_width + x) << 32 | int(bits[i]), i)
        for i in range(len(low))
        if (radii[0, i] > 0).all()
        for y in range(int(low[i, 1]), int(high[i, 1]))
        for x in range(int(low[i, 0]), int(high[i, 0]))
    ]
    pairs.sort(key=lambda pair: pair[0])
    ids = torch.tensor([p[0] for p in pairs], dtype=torch.int64)
    return (high - low).prod(1)[None], ids, torch.tensor([p[1] for p in pairs], dtype=torch.int32)


def isect_offset_encode(isect_ids: Tensor, n_images: int, tile_width: int, tile_height: int) -> Tensor:
    """intersect_offset_kernel: where each tile's pairs begin."""
    assert n_images == 1
    tiles = torch.arange(tile_width * tile_height)
    return torch.searchsorted(isect_ids >> 32, tiles).int().reshape(1, tile_height, tile_width)


def rasterize_to_pixels_2dgs(
    means2d: Tensor,
    ray_transforms: Tensor,
    colors: Tensor,
    opacities: Tensor,
    normals: Tensor,
    densify: Tensor,
    image_width: int,
    image_height: int,
    tile_size: int,
    isect_offsets: Tensor,
    flatten_ids: Tensor,
) -> tuple[Tensor, Tensor, Tensor, Tensor, Tensor]:
    """rasterize_to_pixels_2dgs_fwd_kernel; autograd stands for the backward kernel, which has the same formulas."""
    count, channels = means2d.shape[1], colors.shape[-1]
    assert means2d.shape == densify.shape == (1, count, 2)
    assert ray_transforms.shape == (1, count, 3, 3)
    assert opacities.shape == (1, count)
    assert normals.shape == (1, count, 3)
    assert channels in WIDTHS, "gsplat fills up with uninitialised memory"
    assert all(t.dtype == torch.float32 for t in (means2d, ray_transforms, colors, opacities, normals))
    rows, columns = isect_offsets.shape[1:]
    bounds = [*isect_offsets.flatten().tolist(), len(flatten_ids)]
    images = []
    for row in range(rows):
        line = []
        for column in range(columns):
            tile = row * columns + column
            rows_in, columns_in = (
                torch.arange(at * tile_size, min((at + 1) * tile_size, size)) + 0.5
                for at, size in ((row, image_height), (column, image_width))
            )
            y, x = torch.meshgrid(rows_in, columns_in, indexing="ij")
            ids = flatten_ids[bounds[tile] : bounds[tile + 1]].long()
            planes = _tile(
                means2d[0, ids], ray_transforms[0, ids], colors[0, ids], opacities[0, ids], normals[0, ids],
                torch.stack([x.flatten(), y.flatten()], dim=1),
            )  # fmt: skip
            line.append(planes.T.reshape(-1, *x.shape))
        images.append(torch.cat(line, dim=2))
    image = torch.cat(images, dim=1).movedim(0, -1)[None]
    color, normal, alpha, median = image.split([channels, 3, 1, 1], dim=-1)
    return color, alpha, normal, torch.zeros_like(alpha), median


def _tile(xy: Tensor, transforms: Tensor, colors: Tensor, opacities: Tensor, normals: Tensor, pixels: Tensor) -> Tensor:
    """(P, channels + 5): colours, normal, alpha, median of the pixels of a tile, from its surfels near to far."""
    if not len(xy):
        return torch.zeros(len(pixels), colors.shape[1] + 5) + 0 * colors.sum()  # keeps its place in the graph
    u, v, w = transforms[:, None].unbind(2)  # (S, 1, 3)
    h_u, h_v = pixels[None, :, :1] * w - u, pixels[None, :, 1:] * w - v  # (S, P, 3)
    cross = torch.linalg.cross(h_u, h_v)
    meets = cross[..., 2] != 0
    s = cross[..., :2] / torch.where(meets, cross[..., 2], torch.ones_like(cross[..., 2]))[..., None]
    in_space, on_screen = (s**2).sum(2), FILTER_INV_SQUARE * ((xy[:, None] - pixels) ** 2).sum(2)
    weight = torch.where(in_space <= on_screen, in_space, on_screen)
    alpha = (opacities[:, None] * torch.exp(-0.5 * weight)).clamp_max(ALPHA_MAX)
    alpha = torch.where(meets & (alpha >= ALPHA_THRESHOLD), alpha, torch.zeros_like(alpha))
    after = torch.cumprod(1 - alpha, dim=0)
    alpha = torch.where(after.detach() > DONE, alpha, torch.zeros_like(alpha))  # exclusive: the last one is left out
    after = torch.cumprod(1 - alpha, dim=0)
    before = torch.cat([torch.ones_like(after[:1]), after[:-1]])
    vis = (alpha * before).T  # (P, S)
    seen = (alpha > 0) & (before > 0.5)
    last = torch.where(seen, torch.arange(len(xy))[:, None], -1).amax(0)
    median = torch.where(last >= 0, colors[last.clamp_min(0), -1], torch.zeros(len(pixels)))
    return torch.cat([vis @ colors, vis @ normals, 1 - after[-1][:, None], median[:, None]], dim=1)
