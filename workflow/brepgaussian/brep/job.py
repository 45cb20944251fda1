"""What the ladder asks of the geometry kernel, and what comes back. Imports no OCP."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brepgaussian.brep.blends import Blend
from brepgaussian.brep.patches import Patch
from brepgaussian.brep.silhouettes import Silhouettes
from brepgaussian.brep.verdict import Verdict
from brepgaussian.geometry.surfaces import Surface
from brepgaussian.settings.brep import BrepSettings


@dataclass(frozen=True)
class Rung:
    """How one attempt differs from the others.

    Attributes:
        name: for the report.
        margin: of the sheets.
        extend: indices of patches whose sheets go through the whole box.
        caps: whether the job's caps take part.
        silhouettes: whether free space seen by the cameras counts.
        unsupported: factor on the cost of area without points.
    """

    name: str
    margin: float
    extend: tuple[int, ...] = ()
    caps: bool = False
    silhouettes: bool = True
    unsupported: float = 1.0


@dataclass(frozen=True)
class Job:
    """Everything that an attempt needs.

    Attributes:
        patches: primitives with their support.
        caps: faces that were guessed from open borders; they follow the patches where a rung uses them.
        ends: (N, 3) points on open borders; `open_patches`: indices of the patches that have such.
        silhouettes: evidence of the views, None without usable views.
        settings: of the stage.
        left_out: patches that take no part in the solid; their points are still evidence of what lies on it.
        labelling: which one of `points.ply` the patches are from; 0 = the first.
        floors: of bores whose ends no view shows; they follow the patches on every rung, before the caps.
        blends: patches that are fillets: the solid is built without them, and its edges are rounded.
        clear: whether planes are kept clear of the cylinders that they touch in a point.
    """

    patches: tuple[Patch, ...]
    caps: tuple[Patch, ...]
    ends: NDArray[np.float64]
    open_patches: tuple[int, ...]
    silhouettes: Silhouettes | None
    settings: BrepSettings
    left_out: tuple[Patch, ...] = ()
    labelling: int = 0
    floors: tuple[Patch, ...] = ()
    blends: tuple[Blend, ...] = ()
    clear: bool = False

    def guesses(self, rung: Rung) -> tuple[Patch, ...]:
        """Faces without points of their own that take part in a rung, after the patches."""
        return (*self.floors, *self.caps) if rung.caps else self.floors


@dataclass(frozen=True)
class Attempt:
    """The outcome of one rung.

    Attributes:
        rung: its name.
        surfaces: what the structure's indices mean.
        shape: the solid as OCC bytes, None if there is none.
        verdict: of the gate; its faults say why there is no solid.
        primitives: of the patches that the verdict is about, in their order; labelling: that they are from.
        fallback: whether it is the polyhedral last resort.
        notes: on the arrangement, for the report.
    """

    rung: str
    shape: bytes | None
    verdict: Verdict
    surfaces: tuple[Surface, ...] = ()
    primitives: tuple[int, ...] = ()
    labelling: int = 0
    fallback: bool = False
    notes: dict[str, Any] = field(default_factory=dict)
