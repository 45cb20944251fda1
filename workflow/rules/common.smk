# What all rules share: the library's path, the objects, the variants, and where an artifact is kept.
import re
import sys
from pathlib import Path

from snakemake.exceptions import WorkflowError

sys.path.insert(0, str(Path(workflow.basedir) / "workflow"))

from brepgaussian.errors import BrepGaussianError
from brepgaussian.project.code import code_stamp
from brepgaussian.project.environment import export_library
from brepgaussian.project.failures import failure_path, unfinished
from brepgaussian.project.objects import configured_objects, has_truth, source_files
from brepgaussian.project.stages import STAGES, upstream
from brepgaussian.project.variants import read_variants

export_library()  # to the scripts, in conda environments too
RESULTS = config["results"]

try:
    OBJECTS = configured_objects(config)
    VARIANTS = read_variants(
        config.get("settings") or {}, config.get("overlays") or {}, config["variants"]
    )
except BrepGaussianError as error:
    raise WorkflowError(str(error))


def pattern(names):
    """A wildcard's pattern that matches just these names."""
    return "|".join(map(re.escape, names)) or "(?!)"


wildcard_constraints:
    object=pattern(OBJECTS),
    variant=pattern(VARIANTS.names),


def made(file):
    """Pattern of a file that a stage makes."""
    return f"{RESULTS}/{{variant}}/{{object}}/{file}"


def kept(stage, file):
    """An input function: a stage's file, in the folder of the variant that keeps it."""
    return (
        lambda wildcards: f"{RESULTS}/{VARIANTS.owner(wildcards.variant, stage)}/{wildcards.object}/{file}"
    )


def truth(wildcards):
    """The object's truth, where one is known."""
    return (
        kept("views", "truth.h5")(wildcards)
        if has_truth(OBJECTS[wildcards.object])
        else []
    )


def settings(stage):
    """A params function: the stage's settings in the wildcards' variant."""
    return lambda wildcards: VARIANTS.settings(wildcards.variant, stage)


def failure(stage):
    """A params function: where the stage records why it failed."""
    return lambda wildcards: str(
        failure_path(RESULTS, wildcards.variant, wildcards.object, stage)
    )


def code(stage):
    """Stamp of the library code that the stage stands on: changing or touching it reruns the stage."""
    return code_stamp(STAGES[stage].module)


def benchmarks(wildcards):
    """Benchmark files of the stages that lead to an object's solid."""
    return [
        f"benchmarks/{VARIANTS.owner(wildcards.variant, stage)}/{wildcards.object}/{stage}.tsv"
        for stage in upstream("brep")
    ]


def rows():
    """One row of metrics an object and variant."""
    return expand(
        made("metrics.csv"),
        variant=config["variants"],
        object=OBJECTS,
    )


def publish_what_there_is():
    """After a failure: the table with a row for every object all the same, the failed ones with their reason."""
    from brepgaussian.metrics.table import collect

    table = f"{RESULTS}/metrics.csv"
    if workflow.dag is None or table not in map(
        str, workflow.dag.targetfiles | workflow.dag.derived_targetfiles
    ):
        return
    done, failed = unfinished(RESULTS, VARIANTS, config["variants"], OBJECTS)
    collect(done, failed, table)
    print(
        f"{len(failed)} object(s) failed: see the column `reason` of {table}",
        file=sys.stderr,
    )
