import pytest
from brepgaussian.errors import InputError
from brepgaussian.project.objects import known_objects, read_objects, selected

HEAD = "object\tsource\tpath\ttruth\tgroup\n"


def table(tmp_path, text):
    path = tmp_path / "objects.tsv"
    path.write_text(HEAD + text)
    return path


def test_rows_are_read_in_order(tmp_path):
    rows = read_objects(table(tmp_path, "# a comment\nb\tpart\thex_nut\t\ttuned\n\na\tstep\ta.step\t\t\n"))
    assert list(rows) == ["b", "a"]
    assert rows["b"].group == "tuned"
    assert rows["a"].group == "holdout"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a b\tpart\tx\t\t\n", "object name 'a b'"),
        ("a\tpart\tx\t\tbest\n", "group is 'best'"),
        ("a\tpart\t\t\t\n", "path is empty"),
        ("a\tpart\tx\t\t\na\tpart\tx\t\t\n", "lists a twice"),
    ],
)
def test_faulty_rows_are_refused_with_their_reason(tmp_path, text, message):
    with pytest.raises(InputError, match=message):
        read_objects(table(tmp_path, text))


def test_a_missing_table_and_wrong_columns_are_named(tmp_path):
    with pytest.raises(InputError, match=r"absent\.tsv"):
        read_objects(tmp_path / "absent.tsv")
    path = tmp_path / "wrong.tsv"
    path.write_text("name\tpath\n")
    with pytest.raises(InputError, match="columns"):
        read_objects(path)


def test_select_narrows_the_table(tmp_path):
    known = known_objects({"objects": str(table(tmp_path, "a\tpart\tx\t\t\nb\tpart\ty\t\t\n"))})
    assert list(selected(known, ["b"])) == ["b"]
    assert list(selected(known, [])) == ["a", "b"]
    with pytest.raises(InputError, match=r"benchmark\.objects names 'c'"):
        selected(known, ["c"], "benchmark.objects")


def test_a_table_and_a_folder_of_abc_nef_stand_together(tmp_path):
    for name in ("00000001", "00000002"):
        (tmp_path / "nef" / name / "train_img").mkdir(parents=True)
    path = table(tmp_path, "a\tpart\tx\t\t\n")
    config = {"objects": str(path), "abc_nef": {"root": str(tmp_path / "nef"), "tuned": ["00000002"]}}
    groups = {name: row.group for name, row in known_objects(config).items()}
    assert groups == {"a": "holdout", "00000001": "holdout", "00000002": "tuned"}
    path.write_text(HEAD + "00000001\tpart\tx\t\t\n")
    with pytest.raises(InputError, match="00000001 stands in"):
        known_objects(config)
    with pytest.raises(InputError, match="no objects"):
        known_objects({"objects": ""})


def test_the_shipped_table_lists_every_bundled_part():
    from pathlib import Path

    from brepgaussian.views.parts import PARTS

    rows = read_objects(Path(__file__).parents[2] / "config" / "objects.tsv")
    assert {name: row.group for name, row in rows.items()} == {name: part.group for name, part in PARTS.items()}
