import pytest
from brepgaussian.errors import SettingsError
from brepgaussian.project.stages import STAGES, upstream
from brepgaussian.project.variants import read_variants

OVERLAYS = {
    "no_edge": {"stage1": {"edge_loss": False}},
    "other_fit": {"primitives": {"seed": 1}},
    "nothing": {},
    "no_edge_again": {"stage1": {"edge_loss": False}},
}


@pytest.fixture
def variants():
    return read_variants({"masks": {"seed": 3}}, OVERLAYS)


def test_a_stage_that_a_variant_does_not_touch_is_kept_under_full(variants):
    assert [variants.owner("no_edge", s) for s in ("views", "masks", "stage1", "brep")] == [
        "full",
        "full",
        "no_edge",
        "no_edge",
    ]
    assert variants.owner("other_fit", "points") == "full"
    assert variants.owner("other_fit", "primitives") == "other_fit"


def test_variants_with_the_same_settings_share_every_stage(variants):
    assert {variants.owner("nothing", s) for s in STAGES} == {"full"}
    assert variants.owner("no_edge_again", "stage1") == "no_edge"


def test_a_setting_that_is_written_out_though_it_is_the_default_changes_nothing():
    variants = read_variants({"stage1": {"iterations": 90}}, {"same": {"stage1": {"edge_loss": True}}})
    assert variants.owner("same", "brep") == "full"
    assert variants.settings("same", "stage1")["iterations"] == 90


def test_an_overlay_is_laid_over_the_base(variants):
    assert variants.settings("no_edge", "masks") == {"seed": 3}
    assert variants.settings("no_edge", "stage1") == {"edge_loss": False}


@pytest.mark.parametrize(
    ("overlays", "wanted", "message"),
    [
        ({"full": {}}, (), "can't be called full"),
        ({"x": {"stage9": {}}}, (), "x.stage9"),
        ({}, ("absent",), "unknown variant 'absent'"),
    ],
)
def test_faulty_overlays_are_refused(overlays, wanted, message):
    with pytest.raises(SettingsError, match=message):
        read_variants({}, overlays, wanted)


def test_upstream_is_in_the_order_of_the_stages():
    assert upstream("stage1") == ("views", "masks", "stage1")
    assert upstream("views") == ("views",)
    assert set(upstream("report")) == set(STAGES)
