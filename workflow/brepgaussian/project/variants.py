"""Variants: named overlays of settings. What a variant does not touch is taken from `full`."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from brepgaussian.errors import SettingsError
from brepgaussian.project.stages import STAGES, upstream
from brepgaussian.settings.base import build
from brepgaussian.settings.registry import STAGES as SETTINGS

FULL = "full"
Settings = dict[str, dict[str, Any]]  # stage -> setting -> value


@dataclass(frozen=True)
class Variants:
    """Settings of every variant, and the variant under which each stage's artifact is kept.

    Attributes:
        base: settings of `full` by stage, only what differs from the defaults.
        overlays: what each other variant changes, by stage.
    """

    base: Settings
    overlays: dict[str, Settings]
    _owners: dict[tuple[str, str], str] = field(default_factory=dict, compare=False, repr=False)  # asked for often

    @property
    def names(self) -> tuple[str, ...]:
        """All variants that can be asked for."""
        return (FULL, *self.overlays)

    def settings(self, variant: str, stage: str) -> dict[str, Any]:
        """Settings of one stage in one variant."""
        return {**self.base.get(stage, {}), **self._overlay(variant).get(stage, {})}

    def owner(self, variant: str, stage: str) -> str:
        """The variant whose folder holds this stage's artifact: the first with the same settings upstream."""
        if (variant, stage) not in self._owners:
            wanted = self._fingerprint(variant, stage)
            same = (name for name in self.names if self._fingerprint(name, stage) == wanted)
            self._owners[variant, stage] = next(same)
        return self._owners[variant, stage]

    def _fingerprint(self, variant: str, stage: str) -> list[Any]:
        """The settings of a stage and of all upstream, defaults filled in."""
        return [build(SETTINGS[name], self.settings(variant, name), name) for name in upstream(stage)]

    def _overlay(self, variant: str) -> Settings:
        if variant == FULL:
            return {}
        try:
            return self.overlays[variant]
        except KeyError:
            known = ", ".join(self.names)
            raise SettingsError(f"unknown variant {variant!r}", fix=f"use one of: {known}") from None


def read_variants(base: Settings, overlays: dict[str, Settings], wanted: Sequence[str] = ()) -> Variants:
    """Check the stages' names and the wanted variants, and return all variants.

    Raises:
        SettingsError: an overlay is called `full`, names a stage that does not exist, or a wanted variant
            is not defined.
    """
    if FULL in overlays:
        raise SettingsError("a variant can't be called full", fix="put its settings under `settings`")
    for where, settings in (("settings", base), *overlays.items()):
        for stage in settings or {}:
            if stage not in STAGES:
                raise SettingsError(f"unknown stage {where}.{stage}", fix=f"use one of: {', '.join(STAGES)}")
    variants = Variants(base, {name: overlay or {} for name, overlay in overlays.items()})
    for variant in wanted:
        variants.settings(variant, next(iter(STAGES)))
    return variants
