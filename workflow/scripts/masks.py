"""Rule `masks`: files and settings from Snakemake to one call of the library."""

from brepgaussian.jobs import job

with job("masks", snakemake.log[0], snakemake.threads, snakemake.params.failure, snakemake.params.settings):
    from brepgaussian.masks.stage import make_masks
    from brepgaussian.settings.base import build
    from brepgaussian.settings.masks import MasksSettings

    make_masks(
        views_path=snakemake.input.views,
        out_path=snakemake.output.masks,
        truth_path=snakemake.input.truth or None,
        settings=build(MasksSettings, snakemake.params.settings, "masks"),
        threads=snakemake.threads,
    )
