"""What the workflow asks before it runs anything: which objects, which variants, which code a stage stands on.

Imported while the Snakefile is parsed, once for every job: light imports only.
"""
