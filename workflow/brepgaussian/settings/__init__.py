"""Settings: one frozen dataclass per stage in a module of its own; `registry` lists them all.

Import a stage's settings from its module: a stage is rerun for changes of the modules that it imports.
"""
