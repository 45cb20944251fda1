"""Rule `primitives`: files and settings from Snakemake to one call of the library."""

from brepgaussian.jobs import job

with job("primitives", snakemake.log[0], snakemake.threads, snakemake.params.failure, snakemake.params.settings):
    from brepgaussian.primitives.stage import fit_primitives
    from brepgaussian.settings.base import build
    from brepgaussian.settings.primitives import PrimitivesSettings

    fit_primitives(
        points_path=snakemake.input.points,
        out_path=snakemake.output.primitives,
        settings=build(PrimitivesSettings, snakemake.params.settings, "primitives"),
        threads=snakemake.threads,
    )
