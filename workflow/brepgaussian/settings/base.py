"""How a setting is declared: a frozen dataclass field with its default, meaning, unit and range."""

import dataclasses
import hashlib
import json
import types
import typing
from typing import Any, TypeVar

from brepgaussian.errors import SettingsError

S = TypeVar("S")


def setting(
    default: Any,
    description: str,
    *,
    unit: str = "",
    minimum: float | None = None,
    maximum: float | None = None,
    choices: tuple[Any, ...] | None = None,
) -> Any:
    """Declare one setting. `minimum` and `maximum` are inclusive."""
    metadata = {
        "description": description,
        "unit": unit,
        "minimum": minimum,
        "maximum": maximum,
        "choices": choices,
    }
    return dataclasses.field(default=default, metadata=metadata)


def build(cls: type[S], values: dict[str, Any] | None = None, section: str = "") -> S:
    """Make a settings object from a config mapping; an unknown key or a bad value is an error."""
    values = dict(values or {})
    fields = {f.name: f for f in dataclasses.fields(cls)}  # type: ignore[arg-type]
    unknown = sorted(set(values) - set(fields))
    if unknown:
        raise SettingsError(f"unknown setting {section}.{unknown[0]}", fix=f"use one of: {', '.join(sorted(fields))}")
    checked = {name: _check(fields[name], value, section) for name, value in values.items()}
    return cls(**checked)


def _check(field: dataclasses.Field[Any], value: Any, section: str) -> Any:
    name = f"{section}.{field.name}"
    kinds = _kinds(field)
    if float in kinds and isinstance(value, int) and not isinstance(value, bool):
        value = float(value)
    if isinstance(value, list):
        value = tuple(value)
    if not isinstance(value, kinds) or (isinstance(value, bool) and bool not in kinds):
        wanted = " or ".join(k.__name__ for k in kinds)
        raise SettingsError(f"{name} is {value!r}", fix=f"give a {wanted}")
    low, high = field.metadata.get("minimum"), field.metadata.get("maximum")
    choices = field.metadata.get("choices")
    if low is not None and isinstance(value, (int, float)) and value < low:
        raise SettingsError(f"{name} is {value}", fix=f"give a value of at least {low}")
    if high is not None and isinstance(value, (int, float)) and value > high:
        raise SettingsError(f"{name} is {value}", fix=f"give a value of at most {high}")
    if choices is not None and value not in choices:
        raise SettingsError(f"{name} is {value!r}", fix=f"use one of: {', '.join(map(str, choices))}")
    return value


def _kinds(field: dataclasses.Field[Any]) -> tuple[type, ...]:
    """The Python types that a field accepts (`float | None` gives both)."""
    annotation = field.type
    if isinstance(annotation, types.UnionType):
        return tuple(typing.get_args(annotation))
    origin = typing.get_origin(annotation)
    return (origin or annotation,)  # type: ignore[return-value]


def digest(*settings: Any) -> str:
    """A short, stable hash of settings objects, for artifacts' attributes and rerun triggers."""
    payload = json.dumps([dataclasses.asdict(s) for s in settings], sort_keys=True, default=str)
    return hashlib.sha256(payload.encode()).hexdigest()[:16]
