"""gsplat's functions that the cuda backend calls, over its own kernels (their CUDA text) compiled for the CPU.

Needs the package gsplat (its sources: no GPU, no compiled extension) and g++. What this leaves out of a real run: nvcc
with fast arithmetic, atomic sums in any order, and the device's sort.
"""

import ctypes
import importlib.util
import math
import shutil
import subprocess
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import torch
from torch import Tensor

_SIZES = "channels count pairs width height tile columns rows".split()
_INPUTS = "xy transforms colors opacities normals offsets order".split()
_OUTPUTS = "color alpha normal distortion median last_ids median_ids".split()
_UPSTREAM = "v_color v_alpha v_normal v_distortion v_median".split()
_GRADIENTS = "g_xy g_transforms g_colors g_opacities g_normals g_densify".split()


class _Call(ctypes.Structure):
    """Mirror of `Call` in gsplat_on_cpu.cpp."""

    _fields_ = [
        *((name, ctypes.c_uint32) for name in _SIZES),
        *((name, ctypes.c_void_p) for name in (*_INPUTS, *_OUTPUTS, *_UPSTREAM, *_GRADIENTS)),
    ]


def sources() -> Path | None:
    """The folder of gsplat's CUDA code, if it and a compiler are installed."""
    spec = importlib.util.find_spec("gsplat")
    if spec is None or not spec.submodule_search_locations or shutil.which("g++") is None:
        return None
    return Path(spec.submodule_search_locations[0]) / "cuda"


def build(cuda: Path, folder: Path) -> SimpleNamespace:
    """Compile the kernels into a folder; returns a stand-in for the module gsplat."""
    utils = (cuda / "include" / "Utils.cuh").read_text()
    tiles = (cuda / "csrc" / "IntersectTile.cu").read_text()
    for rounding in ("floor", "ceil"):  # negative numbers become 0 on a device only
        tiles = tiles.replace(f"(uint32_t){rounding}(tile", f"saturated_{rounding}(tile")
    template = "template <uint32_t CDIM, typename scalar_t>\n__global__"
    launch = "template <uint32_t CDIM>\nvoid launch"
    parts = [
        _between(
            utils, "template <uint32_t DIM, class WarpT>", "template <class WarpT> inline __device__ void warpMax"
        ),
        _between(tiles, "template <typename scalar_t>\n__global__", "void launch_intersect_tile"),
        _between(tiles, "__global__ void intersect_offset_kernel", "void launch_intersect_offset"),
        *(
            _between((cuda / "csrc" / f"RasterizeToPixels2DGS{way}.cu").read_text(), template, launch)
            for way in ("Fwd", "Bwd")
        ),
    ]
    (folder / "kernels.inc").write_text("\n".join(parts))
    library = folder / "gsplat_on_cpu.so"
    code, glm = Path(__file__).with_suffix(".cpp"), cuda / "csrc" / "third_party" / "glm"
    flags = ["-O2", "-std=c++17", "-fPIC", "-shared", "-w", f"-I{folder}", f"-I{glm}"]
    subprocess.run(["g++", *flags, str(code), "-o", str(library)], check=True)
    return _functions(ctypes.CDLL(str(library)))


def _between(text: str, start: str, end: str) -> str:
    begin = text.index(start)
    return text[begin : text.index(end, begin)]


def _pointer(tensor: Tensor | None) -> ctypes.c_void_p | None:
    assert tensor is None or tensor.is_contiguous()
    return None if tensor is None else ctypes.c_void_p(tensor.data_ptr())


def _functions(library: ctypes.CDLL) -> SimpleNamespace:
    def isect_tiles(
        means2d: Tensor, radii: Tensor, depths: Tensor, tile_size: int, tile_width: int, tile_height: int
    ) -> tuple[Tensor, Tensor, Tensor]:
        assert radii.dtype == torch.int32
        kept = [a.contiguous() for a in (means2d, radii, depths)]  # alive as long as their addresses are
        arrays = [_pointer(a) for a in kept]
        each = torch.empty_like(depths, dtype=torch.int32)
        grid = [ctypes.c_uint32(v) for v in (tile_size, tile_width, tile_height, _bits(tile_width * tile_height))]
        count = ctypes.c_uint32(depths.numel())
        library.tiles(count, *arrays, None, *grid, _pointer(each), None, None)
        before = torch.cumsum(each.view(-1), 0)
        ids, order = torch.empty(int(before[-1]), dtype=torch.int64), torch.empty(int(before[-1]), dtype=torch.int32)
        library.tiles(count, *arrays, _pointer(before), *grid, None, _pointer(ids), _pointer(order))
        by_id = torch.argsort(ids, stable=True)  # the radix sort
        return each, ids[by_id], order[by_id]

    def isect_offset_encode(isect_ids: Tensor, n_images: int, tile_width: int, tile_height: int) -> Tensor:
        assert n_images == 1
        out, tiles = torch.zeros(1, tile_height, tile_width, dtype=torch.int32), tile_width * tile_height
        sizes = [ctypes.c_uint32(v) for v in (len(isect_ids), tiles, _bits(tiles))]
        library.offsets(sizes[0], _pointer(isect_ids), *sizes[1:], _pointer(out))
        return out

    def rasterize_to_pixels_2dgs(*args: Any) -> tuple[Tensor, ...]:
        return tuple(_Rasterise.apply(library, *args)[:5])

    return SimpleNamespace(
        isect_tiles=isect_tiles,
        isect_offset_encode=isect_offset_encode,
        rasterize_to_pixels_2dgs=rasterize_to_pixels_2dgs,
    )


def _bits(tiles: int) -> int:
    return math.floor(math.log2(tiles)) + 1


class _Rasterise(torch.autograd.Function):
    @staticmethod
    def forward(
        ctx: Any, library: ctypes.CDLL, xy: Tensor, transforms: Tensor, colors: Tensor, opacities: Tensor,
        normals: Tensor, densify: Tensor, width: int, height: int, tile: int, offsets: Tensor, order: Tensor,
    ) -> tuple[Tensor, ...]:  # fmt: skip
        rows, columns = offsets.shape[1:]
        sizes = [colors.shape[-1], xy.shape[1], len(order), width, height, tile, columns, rows]
        inputs = [t.detach().contiguous() for t in (xy, transforms, colors, opacities, normals, offsets, order)]
        widths = [colors.shape[-1], 1, 3, 1, 1]
        outputs = [torch.full((1, height, width, w), torch.nan) for w in widths]  # unwritten pixels are found out
        outputs += [torch.zeros((1, height, width), dtype=torch.int32) for _ in range(2)]
        ctx.library, ctx.sizes, ctx.arrays = library, sizes, [*inputs, *outputs]
        _run(library, sizes, ctx.arrays, [], differentiate=False)
        ctx.mark_non_differentiable(*outputs[5:])
        return tuple(outputs)

    @staticmethod
    def backward(ctx: Any, *upstream: Tensor) -> tuple[Tensor | None, ...]:
        xy, transforms, colors, opacities, normals = ctx.arrays[:5]
        gradients = [torch.zeros_like(t) for t in (xy, transforms, colors, opacities, normals, xy)]
        above = [u.contiguous() for u in upstream[:5]]
        _run(ctx.library, ctx.sizes, ctx.arrays, [*above, *gradients], differentiate=True)
        return (None, *gradients, None, None, None, None, None)


def _run(library: ctypes.CDLL, sizes: list[int], arrays: list[Tensor], more: list[Tensor], differentiate: bool) -> None:
    pointers = [_pointer(t) for t in (*arrays, *more)]
    pointers += [None] * (len(_UPSTREAM) + len(_GRADIENTS) - len(more))
    assert library.rasterise(ctypes.byref(_Call(*sizes, *pointers)), int(differentiate)) == 0
