"""The gate's findings about one solid. Imports no OCP."""

from dataclasses import dataclass, field

from brepgaussian.brep.structure import Structure


@dataclass(frozen=True)
class Verdict:
    """What the gate found.

    Attributes:
        faults: why the solid cannot be published at all (empty if it can).
        doubts: why another rung should be tried.
        explained: share of each patch's points that lie on a face of its surface.
        explained_all: the same over all points.
        iou: mean silhouette IoU, None without views.
        bare: share of the area that no point supports.
        faces, edges, vertices, volume: of the solid.
        structure: its faces, edges and vertices by surface.
    """

    faults: tuple[str, ...]
    doubts: tuple[str, ...] = ()
    explained: tuple[float, ...] = ()
    explained_all: float = 0.0
    iou: float | None = None
    bare: float = 1.0
    faces: int = 0
    edges: int = 0
    vertices: int = 0
    volume: float = 0.0
    structure: Structure | None = field(default=None, compare=False)

    @property
    def score(self) -> float:
        """For choosing among solids with doubts."""
        return self.explained_all + (1.0 if self.iou is None else self.iou) - self.bare
