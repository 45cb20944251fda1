# primitives: planes, cylinders, spheres, cones and tori with their support, regularised.
# needs: points.ply.  makes: primitives.h5


rule primitives:
    input:
        points=kept("points", "points.ply"),
    output:
        primitives=ensure(made("primitives.h5"), non_empty=True),
    log:
        "logs/{variant}/{object}/primitives.log",
    benchmark:
        "benchmarks/{variant}/{object}/primitives.tsv"
    conda:
        "../../envs/environment.yaml"
    threads: 1
    resources:
        mem_mb=1500,
    params:
        settings=settings("primitives"),
        failure=failure("primitives"),
        code=code("primitives"),
    script:
        "../scripts/primitives.py"
