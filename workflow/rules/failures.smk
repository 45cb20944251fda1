# What is told before a run, and what is published after one with failures: every table with what there is.


def tell_what_is_missing():
    """Before a run: the objects that lack something. They fail, or are not scored; the others run."""
    from brepgaussian.project.check import tell

    said = tell(OBJECTS.values())
    if said:
        print(f"Some objects lack something:\n{said}", file=sys.stderr)


def publish_what_there_is():
    """Write the tables all the same; a failed object has a row with its reason."""
    publish_metrics()
    publish_tables()
    publish_benchmarks()


def planned(path):
    """Whether a file was to be made in this run."""
    return workflow.dag is not None and any(
        path in map(str, job.output) for job in workflow.dag.jobs
    )


def publish_metrics():
    """The table of metrics."""
    from brepgaussian.metrics.table import collect, read_rows
    from brepgaussian.report.runs import summary_line

    table = f"{RESULTS}/metrics.csv"
    if planned(table):
        done, failed = unfinished(RESULTS, VARIANTS, config["variants"], OBJECTS)
        collect(done, failed, table)
        print(summary_line(read_rows(table)), file=sys.stderr)
        if failed:
            print(f"why: see the column `reason` of {table}", file=sys.stderr)


def publish_tables():
    """The paper's tables, from the table of metrics and the other methods' rows that there are."""
    import shutil

    from brepgaussian.report.tables import make_tables

    folder = f"{RESULTS}/tables"
    if planned(folder):
        shutil.rmtree(folder, ignore_errors=True)
        others = [path for path in other_methods() if Path(path).exists()]
        make_tables(f"{RESULTS}/metrics.csv", GROUPS, folder, others)


def publish_benchmarks():
    """The benchmarks' tables: objects that failed have a row without figures."""
    from brepgaussian.report.benchmark import join

    for table in ("stage1", "masks", "labels", "brep"):
        joined = f"{RESULTS}/benchmark/{table}.csv"
        if not planned(joined):
            continue
        objects = MEASURED_PARTS if table == "brep" else MEASURED
        files = {n: f"{RESULTS}/benchmark/{table}/{n}.csv" for n in objects}
        failed = [
            {"object": name, "group": KNOWN[name].group}
            for name, file in files.items()
            if not Path(file).exists()
        ]
        join([f for f in files.values() if Path(f).exists()], joined, failed)
        print(f"{joined}: {len(failed)} object(s) failed", file=sys.stderr)
