"""The columns of `metrics.csv`, in their order; definitions in docs/metrics.md."""

_SEGMENTATION = "precision_008 recall_008 f1_008 f1_002 f1_001 strict_f1_008 strict_f1_002 strict_f1_001".split()

HEAD = tuple("object variant status reason views seconds peak_mb".split())
PATCH = tuple(f"patch_{name}" for name in _SEGMENTATION)
EDGE = tuple(f"edge_{name}" for name in _SEGMENTATION)
SURFACE = tuple(f"surface_{name}" for name in "cd_sum cd_avg cd_exact hd hd99 hd_exact".split())
CURVE = tuple(f"curve_{name}" for name in "cd_sum cd_avg hd hd99".split())
SOLID = tuple(
    "silhouette_px mask_iou valid closed solids fallback faces faces_truth edges edges_truth vertices "
    "vertices_truth topology_match volume_iou normal_consistency".split()
)
COLUMNS = (*HEAD, *PATCH, *EDGE, *SURFACE, *CURVE, *SOLID)

FLAGS = ("valid", "closed", "fallback", "topology_match")  # written as true or false
BASELINES = ("region growing", "RANSAC planes", "Poisson mesh")  # variants of the rows of `metrics.baselines`
OK, FAILED = "ok", "failed"
