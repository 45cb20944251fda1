"""The page: self-contained, complete, safe, and really drawn by a browser."""

import base64
import json
import re
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from brepgaussian.artifacts.base import Provenance
from brepgaussian.artifacts.masks import read_masks
from brepgaussian.artifacts.stage2 import Stage2

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
BLINK = "--headless --no-sandbox --disable-gpu --disable-background-networking --virtual-time-budget=4000".split()


def data_of(page):
    return json.loads(re.search(r"const DATA = (.*?);</script>", page.read_text(), re.DOTALL).group(1))


def test_page_loads_nothing_from_elsewhere(made):
    text = made.page.read_text()
    assert not re.findall(r"""(?:src|href)=["'](?!data:)[^"']*""", text)
    assert not re.findall(r"https?://|url\(|@import|fetch\(|XMLHttpRequest", text)


def test_page_holds_all_layers_and_the_step(made):
    layers = {layer["id"]: layer for layer in data_of(made.page)["layers"]}
    assert set(layers) == set("solid curves corners points edge_points surfels edge_cloud truth_curves missed".split())
    assert layers["curves"]["count"] == 14
    assert layers["points"]["count"] == 20_000
    step = re.search(r'download="plate.step" href="data:model/step;base64,([^"]*)"', made.page.read_text()).group(1)
    assert base64.b64decode(step) == made.files.step.read_bytes()


def test_positions_and_errors_survive_the_encoding(made):
    solid = next(layer for layer in data_of(made.page)["layers"] if layer["id"] == "solid")
    steps = np.frombuffer(base64.b64decode(solid["positions"]), "<i2").reshape(-1, 3)
    points = steps / data_of(made.page)["steps"]
    np.testing.assert_allclose(np.abs(points).max(axis=0), [0.5, 0.5, 0.25], atol=1e-4)
    error = np.frombuffer(base64.b64decode(solid["paints"]["error"]), np.uint8).reshape(-1, 3).astype(int)
    on_wall = np.abs(np.hypot(*points[:, :2].T) - 0.204) < 1e-3
    middle = on_wall & (np.abs(points[:, 2]) < 0.2)
    assert (error[middle] != error[~on_wall][0]).any(axis=1).all()  # the wall is coloured, the rest is not
    assert solid["legend"]["end"] == 0.005


def test_without_a_truth_its_layers_are_left_out(made):
    page, _ = made.report("blind", files=replace(made.artifacts, truth=None))
    layers = {layer["id"]: layer for layer in data_of(page)["layers"]}
    assert "missed" not in layers
    assert "error" not in layers["solid"]["paints"]


def test_names_cannot_break_the_page(made):
    page, _ = made.report("nasty", object_name='</script><b onclick="x">&')
    assert "<b onclick" not in page.read_text()


def test_same_bytes_twice(made):
    page, sheet = made.report("again")
    assert page.read_bytes() == made.page.read_bytes()
    assert sheet.read_bytes() == made.sheet.read_bytes()


@pytest.mark.parametrize("consistent", [True, False])
def test_views_carry_detected_repaired_and_true_patches(made, consistent):
    path = made.folder / f"stage2_{consistent}.h5"
    Stage2(np.ones((1, 2), np.float32), read_masks(made.files.masks).patches, consistent).write(path, Provenance())
    page, _ = made.report(f"repaired_{consistent}", files=replace(made.artifacts, stage2=path))
    text = page.read_text()
    for kind, there in (("detected", True), ("repaired", consistent), ("true", True)):
        assert text.count(f'alt="patches, {kind}"') == 3 * there  # views on the page
        assert (f'name="patches" value="{kind}"' in text) == there
    shown = "repaired" if consistent else "detected"
    assert f'value="{shown}" checked' in text
    assert f"hide-{shown}" not in re.search(r'<section id="views" class="([^"]*)"', text).group(1)


@pytest.mark.skipif(BROWSER is None, reason="no Chromium")
@pytest.mark.parametrize("address", ["", "#layer=solid&layer=surfels", "#paint=error&layer=points"])
def test_a_browser_draws_it(made, tmp_path, address):
    picture = tmp_path / "page.png"
    command = [BROWSER, *BLINK, f"--user-data-dir={tmp_path}", f"--screenshot={picture}", "--enable-logging=stderr"]
    command += ["--window-size=1280,700", made.page.as_uri() + address]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert picture.exists(), done.stderr
    assert "CONSOLE" not in done.stderr, done.stderr  # no script error
    import cv2

    view = cv2.imread(str(picture))[90:650, 40:920]  # the 3D view
    assert (view < 250).any(axis=2).mean() > 0.1
