"""Rule `brep`: files and settings from Snakemake to one call of the library."""

from brepgaussian.jobs import job

with job("brep", snakemake.log[0], snakemake.threads, snakemake.params.failure, snakemake.params.settings):
    from brepgaussian.brep.stage import build_brep
    from brepgaussian.settings.base import build
    from brepgaussian.settings.brep import BrepSettings

    build_brep(
        views_path=snakemake.input.views,
        points_path=snakemake.input.points,
        primitives_path=snakemake.input.primitives,
        out_step=snakemake.output.step,
        out_glb=snakemake.output.glb,
        out_h5=snakemake.output.brep,
        settings=build(BrepSettings, snakemake.params.settings, "brep"),
        threads=snakemake.threads,
    )
