import os

from brepgaussian.project import code


def names(module):
    return {path.relative_to(code.PACKAGE).as_posix() for path in code._sources(module)}


def test_the_closure_holds_what_is_imported_and_nothing_else():
    found = names("brepgaussian.artifacts.views")
    assert {"artifacts/views.py", "artifacts/base.py", "geometry/cameras.py", "errors.py"} <= found
    assert "artifacts/masks.py" not in found
    assert not any(name.startswith("settings/") for name in found)


def test_a_stage_does_not_depend_on_the_settings_of_another():
    assert "settings/masks.py" in names("brepgaussian.masks.stage")
    assert "settings/brep.py" not in names("brepgaussian.masks.stage")


def test_the_stamp_changes_with_content_and_time_of_the_modules_it_stands_on_only(tmp_path, monkeypatch):
    package = tmp_path / "brepgaussian"
    (package / "room").mkdir(parents=True)
    (package / "room" / "__init__.py").write_text("")
    (package / "room" / "stage.py").write_text("from brepgaussian.shared import f\n")
    (package / "shared.py").write_text("def f(): return 1\n")
    (package / "other.py").write_text("x = 1\n")
    monkeypatch.setattr(code, "PACKAGE", package)

    def fresh():
        code.code_stamp.cache_clear()
        code._imports.cache_clear()
        return code.code_stamp("brepgaussian.room.stage")

    def set_time(path, seconds):
        os.utime(path, (seconds, seconds))

    for path in package.rglob("*.py"):
        set_time(path, 1000)
    before = fresh()
    set_time(package / "other.py", 2000)
    assert fresh() == before
    set_time(package / "shared.py", 1500)  # touched: the same content
    touched = fresh()
    assert touched != before
    assert touched.split()[0] == before.split()[0]
    set_time(package / "shared.py", 1000)
    (package / "other.py").write_text("x = 2\n")
    assert fresh() == before
    (package / "shared.py").write_text("def f(): return 2\n")
    set_time(package / "shared.py", 1000)  # changed, though no newer
    assert fresh() != before
    code.code_stamp.cache_clear()
    code._imports.cache_clear()
