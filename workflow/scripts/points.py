"""Rule `points`: files and settings from Snakemake to one call of the library."""

from brepgaussian.jobs import job

with job("points", snakemake.log[0], snakemake.threads, snakemake.params.failure, snakemake.params.settings):
    from brepgaussian.points.stage import make_points
    from brepgaussian.settings.base import build
    from brepgaussian.settings.points import PointsSettings

    make_points(
        views_path=snakemake.input.views,
        masks_path=snakemake.input.masks,
        stage1_ply=snakemake.input.surfels,
        stage1_h5=snakemake.input.evidence,
        stage2_path=snakemake.input.stage2,
        out_path=snakemake.output.points,
        settings=build(PointsSettings, snakemake.params.settings, "points"),
        threads=snakemake.threads,
    )
