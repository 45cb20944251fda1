"""Rule `stage2`: files and settings from Snakemake to one call of the library."""

from brepgaussian.jobs import job

with job("stage2", snakemake.log[0], snakemake.threads, snakemake.params.failure, snakemake.params.settings):
    from brepgaussian.settings.base import build
    from brepgaussian.settings.stage2 import Stage2Settings
    from brepgaussian.splatting.stage2 import train_stage2

    train_stage2(
        views_path=snakemake.input.views,
        masks_path=snakemake.input.masks,
        stage1_ply=snakemake.input.surfels,
        out_h5=snakemake.output.stage2,
        settings=build(Stage2Settings, snakemake.params.settings, "stage2"),
        threads=snakemake.threads,
    )
