# views: the images, silhouettes and cameras of an object in the unit frame, and its truth where one is known.
# needs: a row of the object table.  makes: views.h5, truth.h5


rule views:
    input:
        files=lambda wildcards: source_files(KNOWN[wildcards.object]),
    output:
        views=ensure(made("views.h5"), non_empty=True),
        truth=ensure(made("truth.h5"), non_empty=True),
    log:
        "logs/{variant}/{object}/views.log",
    benchmark:
        "benchmarks/{variant}/{object}/views.tsv"
    wildcard_constraints:
        object=pattern(name for name, row in KNOWN.items() if has_truth(row)),
    conda:
        "../../envs/environment.yaml"
    threads: 1
    resources:
        mem_mb=3000,
    params:
        row=lambda wildcards: vars(KNOWN[wildcards.object]),
        settings=settings("views"),
        failure=failure("views"),
        code=code("views"),
    script:
        "../scripts/views.py"


use rule views as views_without_truth with:
    output:
        views=ensure(made("views.h5"), non_empty=True),
    wildcard_constraints:
        object=pattern(name for name, row in KNOWN.items() if not has_truth(row)),
