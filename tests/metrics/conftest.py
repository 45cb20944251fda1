"""The example object's module as a fixture (test folders are no packages)."""

import importlib.util
import sys
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def example():
    path = Path(__file__).parent / "example.py"
    spec = importlib.util.spec_from_file_location("metrics_example", path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module
