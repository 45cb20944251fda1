import dataclasses
import sys

import numpy as np
import pytest
from brepgaussian.artifacts.base import Provenance
from brepgaussian.artifacts.masks import read_masks
from brepgaussian.errors import InputError, SettingsError, ToolError
from brepgaussian.masks.benchmark import COLUMNS, NOISES, add_noise, benchmark_masks
from brepgaussian.masks.edges import measure_offset, region_edges, shift
from brepgaussian.masks.evaluate import EdgeScore, RegionScore, score_edges, score_regions
from brepgaussian.masks.pictures import draw_comparison
from brepgaussian.masks.sam import paint, prompts
from brepgaussian.masks.stage import detect, make_masks
from brepgaussian.settings.masks import MasksSettings


def total(masks, ids):
    regions = sum((score_regions(p, i) for p, i in zip(masks.patches, ids, strict=True)), RegionScore())
    edges = sum((score_edges(e, i, interior=True) for e, i in zip(masks.edges, ids, strict=True)), EdgeScore())
    return regions, edges


@pytest.mark.parametrize("noise", NOISES)
def test_faces_of_a_box_are_found_under_noise(box, noise):
    views, ids = box
    regions, edges = total(detect(add_noise(views, noise, 4), MasksSettings()), ids)
    assert regions.f_75 >= 0.95
    assert edges.f >= 0.95


def test_file_is_the_same_for_one_and_two_threads(box, tmp_path):
    views, _ = box
    views.write(tmp_path / "views.h5", Provenance())
    for threads in (1, 2):
        make_masks(tmp_path / "views.h5", tmp_path / f"{threads}.h5", MasksSettings(), threads)
    assert (tmp_path / "1.h5").read_bytes() == (tmp_path / "2.h5").read_bytes()
    assert read_masks(tmp_path / "1.h5").patches.dtype == np.int16


def test_an_empty_view_stays_empty(box):
    views, _ = box
    alpha = views.alpha.copy()
    alpha[1] = 0
    masks = detect(dataclasses.replace(views, alpha=alpha), MasksSettings())
    assert not masks.edges[1].any()
    assert not masks.patches[1].any()


def test_truth_detector_and_region_edges(box, box_truth):
    views, ids = box
    masks = detect(views, MasksSettings(patches="truth", edges="regions"), truth=box_truth)
    assert np.array_equal(masks.patches, ids + 1)
    assert np.array_equal(masks.edges[0], region_edges(ids[0], 3))
    with pytest.raises(InputError, match="no known faces"):
        detect(views, MasksSettings(patches="truth"))


def test_shipped_edge_maps_are_moved_onto_the_silhouettes(box):
    views, ids = box
    maps = np.stack([region_edges(i, 3) for i in ids])
    straight = measure_offset(maps, views.alpha)
    moved = shift(maps, 2.0, -1.0)
    assert np.subtract(measure_offset(moved, views.alpha), straight) == pytest.approx([2, -1], abs=0.15)
    masks = detect(dataclasses.replace(views, edge_maps=moved), MasksSettings(edges="dataset"))
    assert total(masks, ids)[1].f > 0.98
    with pytest.raises(InputError, match="without edge maps"):
        detect(views, MasksSettings(edges="dataset"))


def test_user_network(box, tmp_path):
    torch = pytest.importorskip("torch")

    class Threshold(torch.nn.Module):
        def forward(self, image):
            return (image[:, :1] > 0.5).float()

    torch.jit.script(Threshold()).save(str(tmp_path / "net.pt"))
    views, _ = box
    masks = detect(views, MasksSettings(edges="torchscript", weights=str(tmp_path / "net.pt")))
    assert np.array_equal(masks.edges > 0, views.rgb[..., 0] > 127)
    (tmp_path / "bad.pt").write_text("no network")
    for path, fault in (
        ("", "no edge network"),
        (tmp_path / "none.pt", "not exist"),
        (tmp_path / "bad.pt", "TorchScript"),
    ):
        with pytest.raises(InputError, match=fault):
            detect(views, MasksSettings(edges="torchscript", weights=str(path)))


def test_sam_without_its_library_says_so(box, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "transformers", None)
    with pytest.raises(ToolError, match="pip install transformers"):
        detect(box[0], MasksSettings(patches="sam", sam_checkpoint=str(tmp_path)))
    with pytest.raises(InputError, match="no Segment Anything checkpoint"):
        detect(box[0], MasksSettings(patches="sam"))
    with pytest.raises(SettingsError, match="needs edges"):
        detect(box[0], MasksSettings(patches="sam", edges="regions"))


def test_sam_prompts_lie_inside_every_region(box):
    _, ids = box
    points = prompts(region_edges(ids[0], 3), ids[0] >= 0, 60)
    assert sorted(ids[0][y, x] for x, y in points) == sorted(set(ids[0][ids[0] >= 0]))


def test_sam_masks_are_painted_small_over_large():
    masks = np.zeros((3, 40, 40), bool)
    masks[0, :, :30] = masks[1, :, :29] = masks[2, 10:20, 10:20] = True
    ids = paint(masks, np.array([0.9, 0.8, 0.7], np.float32), 20)
    assert ids[15, 15] == 2
    assert ids[5, 5] == 1
    assert set(np.unique(ids)) == {0, 1, 2}  # the second mask repeats the first


def test_benchmark_rows(box, box_truth, tmp_path):
    views, ids = box
    views.write(tmp_path / "views.h5", Provenance())
    box_truth.write(tmp_path / "truth.h5", Provenance())
    rows = benchmark_masks(
        tmp_path / "views.h5",
        tmp_path / "truth.h5",
        MasksSettings(),
        noises=("clean", "sigma5"),
        repair=lambda views, patches: ids + 1,
    )
    assert [list(row) for row in rows] == [COLUMNS] * 4
    assert [row["repaired"] for row in rows] == [False, True, False, True]
    assert rows[3]["region_f_75"] == 1
    with pytest.raises(InputError, match="no noise"):
        add_noise(views, "snow")


def test_picture(box, tmp_path):
    views, ids = box
    draw_comparison(tmp_path / "masks.png", views, {"truth": ids + 1, "edges": views.alpha}, size=64)
    assert (tmp_path / "masks.png").stat().st_size > 1000
