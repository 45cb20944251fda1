"""Readers and writers of the files through which stages talk; see docs/artifacts.md.

Import what you need from its module (`artifacts.views`, `artifacts.points`, ...), so that a stage
loads, and is rerun for changes of, the artifacts that it touches only.
"""
