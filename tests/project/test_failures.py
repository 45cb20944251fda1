from brepgaussian.project.failures import Failure, failure_path, find_failure, record, unfinished
from brepgaussian.project.variants import read_variants

VARIANTS = read_variants({}, {"other_fit": {"primitives": {"seed": 1}}})


def test_a_failure_upstream_is_found_for_every_variant_that_shares_the_stage(tmp_path):
    record(failure_path(tmp_path, "full", "a", "masks"), Failure("masks", "masks: empty"))
    assert find_failure(tmp_path, VARIANTS, "other_fit", "a") == Failure("masks", "masks: empty")
    assert find_failure(tmp_path, VARIANTS, "full", "b") is None


def test_a_failure_of_one_variant_does_not_spoil_another(tmp_path):
    record(failure_path(tmp_path, "other_fit", "a", "brep"), Failure("brep", "brep: x"))
    assert find_failure(tmp_path, VARIANTS, "full", "a") is None


def test_every_object_has_a_row_or_a_reason(tmp_path):
    (tmp_path / "full" / "good").mkdir(parents=True)
    (tmp_path / "full" / "good" / "metrics.csv").write_text("x\n")
    record(failure_path(tmp_path, "full", "bad", "views"), Failure("views", "views: no images"))
    rows, failed = unfinished(tmp_path, VARIANTS, ["full"], ["good", "bad", "killed"])
    assert [(row.parent.name, variant) for row, variant in rows] == [("good", "full")]
    assert [f["object"] for f in failed] == ["bad", "killed"]
    assert failed[0]["reason"] == "views: no images"
    assert "logs" in failed[1]["reason"]


def test_a_variant_that_changes_nothing_has_a_row_of_its_own_name(tmp_path):
    variants = read_variants({}, {"same": {"primitives": {}}})
    (tmp_path / "full" / "good").mkdir(parents=True)
    row = tmp_path / "full" / "good" / "metrics.csv"
    row.write_text("x\n")
    assert unfinished(tmp_path, variants, ["full", "same"], ["good"]) == ([(row, "full"), (row, "same")], [])


def test_a_damaged_record_still_gives_a_reason(tmp_path):
    path = failure_path(tmp_path, "full", "a", "brep")
    record(path, Failure("brep", "x"))
    path.write_text("{")
    assert "can't be read" in find_failure(tmp_path, VARIANTS, "full", "a").reason
