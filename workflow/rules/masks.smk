# masks: an edge map and patch ids per view.
# needs: views.h5 (truth.h5 for the `truth` detector).  makes: masks.h5


rule masks:
    input:
        views=kept("views", "views.h5"),
        truth=lambda wildcards: (
            truth(wildcards)
            if VARIANTS.settings(wildcards.variant, "masks").get("patches") == "truth"
            else []
        ),
    output:
        masks=ensure(made("masks.h5"), non_empty=True),
    log:
        "logs/{variant}/{object}/masks.log",
    benchmark:
        "benchmarks/{variant}/{object}/masks.tsv"
    conda:
        "../../envs/environment.yaml"
    threads: 1
    resources:
        mem_mb=2000,
    params:
        settings=settings("masks"),
        failure=failure("masks"),
        code=code("masks"),
    script:
        "../scripts/masks.py"
