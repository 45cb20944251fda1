# From calibrated multi-view images to closed B-Rep solids and a table of metrics.
#   snakemake --cores 2 results/metrics.csv
#   snakemake --cores 2 results/full/hex_nut/brep.step --forcerun primitives
from snakemake.utils import min_version, validate

min_version("9.0")


configfile: "config/config.yaml"


report: "workflow/report/workflow.rst"


# defaults stay out of the config: laid over `full`, a variant's would undo the settings of `full`
validate(config, "workflow/schemas/config.schema.yaml", set_default=False)


include: "workflow/rules/common.smk"
include: "workflow/rules/views.smk"
include: "workflow/rules/masks.smk"
include: "workflow/rules/stage1.smk"
include: "workflow/rules/stage2.smk"
include: "workflow/rules/points.smk"
include: "workflow/rules/primitives.smk"
include: "workflow/rules/brep.smk"
include: "workflow/rules/metrics.smk"
include: "workflow/rules/report.smk"
include: "workflow/rules/benchmark_plan.smk"
include: "workflow/rules/benchmark.smk"
include: "workflow/rules/failures.smk"


rule all:
    default_target: True
    input:
        rules.metrics.output,


onstart:
    tell_what_is_missing()


onerror:
    publish_what_there_is()
