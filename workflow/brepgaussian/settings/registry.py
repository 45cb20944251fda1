"""All settings: one frozen dataclass per stage, in the order in which data walks through the stages."""

from brepgaussian.settings.brep import BrepSettings
from brepgaussian.settings.masks import MasksSettings
from brepgaussian.settings.metrics import MetricsSettings
from brepgaussian.settings.points import PointsSettings
from brepgaussian.settings.primitives import PrimitivesSettings
from brepgaussian.settings.report import ReportSettings
from brepgaussian.settings.stage1 import Stage1Settings
from brepgaussian.settings.stage2 import Stage2Settings
from brepgaussian.settings.views import ViewsSettings

STAGES = {
    "views": ViewsSettings,
    "masks": MasksSettings,
    "stage1": Stage1Settings,
    "stage2": Stage2Settings,
    "points": PointsSettings,
    "primitives": PrimitivesSettings,
    "brep": BrepSettings,
    "metrics": MetricsSettings,
    "report": ReportSettings,
}
