"""The rungs of the ladder: how one attempt at the solid differs from the next."""

from brepgaussian.brep.job import Job, Rung

MENDING = ("open_extended", "caps")  # rungs that make up for missing points


def rungs(job: Job) -> list[Rung]:
    """The attempts in order of preference."""
    settings = job.settings
    result = [Rung("support", settings.margin)]
    some = job.open_patches
    if 0 < len(some) <= settings.max_extended:
        result.append(Rung("open_extended", settings.margin, some))
    if job.caps and len(some) <= settings.max_extended:
        result.append(Rung("caps", settings.margin, some, caps=True))
    result.append(Rung("wide", settings.wide_margin))
    everything = tuple(range(len(job.patches)))
    if len(everything) <= settings.max_extended:
        result.append(Rung("extended", settings.wide_margin, everything))
    result.append(Rung("points_only", settings.margin, silhouettes=False))
    result.append(Rung("lenient", settings.wide_margin, unsupported=0.25))
    return result
