from dataclasses import dataclass

import pytest
from brepgaussian.errors import SettingsError
from brepgaussian.settings import schema
from brepgaussian.settings.base import build, digest, setting
from brepgaussian.settings.registry import STAGES


@dataclass(frozen=True)
class Example:
    """An example."""

    rate: float = setting(0.5, "A rate.", minimum=0, maximum=1)
    kind: str = setting("a", "A kind.", choices=("a", "b"))
    on: bool = setting(True, "A switch.")
    count: int = setting(2, "A count.", minimum=1)


def test_values_are_checked_and_converted():
    assert build(Example, {"rate": 1}).rate == 1.0
    assert build(Example).kind == "a"


@pytest.mark.parametrize(
    "values", [{"rat": 1}, {"rate": 2}, {"rate": "x"}, {"kind": "c"}, {"on": 1}, {"count": 0}, {"count": True}]
)
def test_bad_values_are_refused_by_name(values):
    with pytest.raises(SettingsError, match=f"example.{next(iter(values))}"):
        build(Example, values, "example")


def test_the_digest_follows_the_values():
    assert digest(Example()) == digest(Example())
    assert digest(Example()) != digest(Example(count=3))


def test_the_schema_and_the_readme_are_up_to_date():
    hint = "run python -m brepgaussian.settings.schema"
    assert schema.SCHEMA_PATH.read_text() == schema.schema_text(), hint
    assert schema.README_PATH.read_text() == schema.readme(), hint


@pytest.mark.parametrize("stage", STAGES)
def test_every_setting_is_described_and_every_default_passes_its_own_check(stage):
    import dataclasses

    cls = STAGES[stage]
    for field in dataclasses.fields(cls):
        assert field.metadata["description"]
    build(cls, dataclasses.asdict(cls()))
