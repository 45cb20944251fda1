"""Settings of the `report` stage. Pages, tables, pictures."""

from dataclasses import dataclass

from brepgaussian.settings.base import setting


@dataclass(frozen=True)
class ReportSettings:
    """Pages, tables, pictures."""

    seed: int = setting(0, "Seed of every random choice in this stage.", minimum=0)
    page_views: int = setting(6, "Input views on a page, spread over all of them.", unit="views", minimum=1)
    page_points: int = setting(20_000, "Most points of one cloud on a page.", unit="points", minimum=100)
    page_surfels: int = setting(12_000, "Most surfels on a page.", unit="surfels", minimum=100)
    view_px: int = setting(420, "Longest side of an input view on a page.", unit="px", minimum=64, maximum=2000)
    panel_px: int = setting(420, "Side of a contact sheet's panel.", unit="px", minimum=100, maximum=2000)
    deflection: float = setting(
        1e-3, "Largest distance between the drawn triangles and the solid.", unit="unit frame", minimum=1e-5
    )
