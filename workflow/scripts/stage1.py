"""Rule `stage1`: files and settings from Snakemake to one call of the library."""

from brepgaussian.jobs import job

with job("stage1", snakemake.log[0], snakemake.threads, snakemake.params.failure, snakemake.params.settings):
    from brepgaussian.settings.base import build
    from brepgaussian.settings.stage1 import Stage1Settings
    from brepgaussian.splatting.stage1 import train_stage1

    train_stage1(
        views_path=snakemake.input.views,
        masks_path=snakemake.input.masks,
        out_ply=snakemake.output.surfels,
        out_h5=snakemake.output.evidence,
        settings=build(Stage1Settings, snakemake.params.settings, "stage1"),
        threads=snakemake.threads,
    )
