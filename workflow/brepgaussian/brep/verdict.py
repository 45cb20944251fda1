"""The gate's findings about one solid. Imports no OCP."""

from dataclasses import dataclass, field, replace

from brepgaussian.brep.structure import Structure

IOU_WEIGHT = 5.0  # a silhouette that is off by one percent weighs as five percent of the points
ENDS_WEIGHT = 0.3
CAP_COST = 0.05  # a guessed face must pay


@dataclass(frozen=True)
class Verdict:
    """What the gate found.

    Attributes:
        faults: why the solid cannot be published at all (empty if it can).
        doubts: why another rung must be tried.
        borders: doubts about patches all of whose points lie on the solid, some of them on the faces beside: their
            labels end elsewhere than their faces.
        hints: why a rung that makes up for missing points may be better.
        explained: share of each patch's points that lie on a face of its surface.
        explained_all: the same over all points.
        on_solid: share of all points, those of patches that were left out included, that lie on the solid.
        iou: mean silhouette IoU, None without views.
        bare: share of the area that no point supports.
        ends: share of the points on open borders that lie at an edge of the solid.
        caps: number of faces on guessed surfaces.
        faces, edges, vertices, volume: of the solid.
        structure: its faces, edges and vertices by surface.
    """

    faults: tuple[str, ...]
    doubts: tuple[str, ...] = ()
    borders: tuple[str, ...] = ()
    hints: tuple[str, ...] = ()
    explained: tuple[float, ...] = ()
    explained_all: float = 0.0
    on_solid: float = 0.0
    iou: float | None = None
    bare: float = 1.0
    ends: float = 1.0
    caps: int = 0
    faces: int = 0
    edges: int = 0
    vertices: int = 0
    volume: float = 0.0
    structure: Structure | None = field(default=None, compare=False)

    def with_moved_borders(self) -> "Verdict":
        """Without doubts about borders: where faces end, images know better than labels."""
        return replace(self, doubts=tuple(d for d in self.doubts if d not in self.borders), borders=())

    @property
    def score(self) -> float:
        """For choosing among solids with doubts."""
        return (
            self.explained_all
            + IOU_WEIGHT * (self.iou or 0.0)
            + ENDS_WEIGHT * self.ends
            - self.bare
            - CAP_COST * self.caps
        )
