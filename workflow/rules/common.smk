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
from brepgaussian.project.objects import (
    has_truth,
    known_objects,
    selected,
    source_files,
)
from brepgaussian.project.stages import STAGES, upstream
from brepgaussian.project.variants import read_variants

export_library()  # to the scripts, in conda environments too
RESULTS = config["results"]

try:
    KNOWN = known_objects(config)
    OBJECTS = selected(KNOWN, config.get("select") or [])  # those of the targets
    VARIANTS = read_variants(
        config.get("settings") or {}, config.get("overlays") or {}, config["variants"]
    )
except BrepGaussianError as error:
    raise WorkflowError(str(error))

GROUPS = {name: row.group for name, row in OBJECTS.items()}
EXTERNAL = {entry["method"]: entry for entry in config.get("external") or []}


def pattern(names):
    """A wildcard's pattern that matches just these names."""
    return "|".join(map(re.escape, names)) or "(?!)"


wildcard_constraints:
    object=pattern(KNOWN),
    variant=pattern(VARIANTS.names),


def made(file):
    """Pattern of a file that a stage makes."""
    return f"{RESULTS}/{{variant}}/{{object}}/{file}"


def artifact(variant, name, stage, file):
    """A stage's file of an object, in the folder of the variant that keeps it."""
    return f"{RESULTS}/{VARIANTS.owner(variant, stage)}/{name}/{file}"


def kept(stage, file):
    """An input function: a stage's file, in the folder of the variant that keeps it."""
    return lambda wildcards: artifact(wildcards.variant, wildcards.object, stage, file)


def truth(wildcards):
    """The object's truth, where one is known."""
    return (
        kept("views", "truth.h5")(wildcards)
        if has_truth(KNOWN[wildcards.object])
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


def benchmark_file(variant, name, stage):
    """Where Snakemake writes time and memory of a stage of an object."""
    return f"benchmarks/{VARIANTS.owner(variant, stage)}/{name}/{stage}.tsv"


def benchmarks(wildcards):
    """Benchmark files of the stages that lead to an object's solid."""
    return [
        benchmark_file(wildcards.variant, wildcards.object, stage)
        for stage in upstream("brep")
    ]


def of_all(stage, file):
    """A stage's file of every configured variant and object, in this order; shared ones several times."""
    return [
        artifact(variant, name, stage, file)
        for variant in config["variants"]
        for name in OBJECTS
    ]


def other_methods():
    """Tables of the baselines and of other methods on our objects."""
    known = [name for name, row in OBJECTS.items() if has_truth(row)]
    baselines = [f"{RESULTS}/full/{name}/baselines.csv" for name in known]
    return baselines + [f"{RESULTS}/external/{method}.csv" for method in EXTERNAL]
