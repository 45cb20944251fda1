"""A stamp of the library code that a stage stands on, so that changing or touching it reruns the stage.

Snakemake tracks the script of a rule but not the modules that the script imports. The stamp is a parameter and
no input: as inputs, hundreds of jobs would carry some sixty files each, and a touched file whose content
Snakemake still knows by its checksum would count as unchanged.
"""

import ast
import functools
import hashlib
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1]
_NATIVE = (".cpp", ".h", ".html", ".js", ".css")  # belong to the modules beside them


@functools.cache
def code_stamp(module: str) -> str:
    """Content hash and newest modification time of a module and of all modules of this package that it imports.

    Args:
        module: dotted name, e.g. `brepgaussian.masks.stage`.
    """
    digest, newest = hashlib.sha256(), 0
    for path in sorted(_sources(module)):
        digest.update(path.relative_to(PACKAGE).as_posix().encode())
        digest.update(path.read_bytes())
        newest = max(newest, path.stat().st_mtime_ns)
    return f"{digest.hexdigest()[:16]} {newest}"


def _sources(module: str) -> set[Path]:
    """Files of a module's import closure, with the native sources and pages that lie beside them."""
    seen: set[Path] = set()
    queue = [module]
    while queue:
        for path in _files(queue.pop()):
            if path not in seen:
                seen.add(path)
                queue.extend(_imports(path))
    beside = {f for folder in {p.parent for p in seen} for f in folder.iterdir() if f.suffix in _NATIVE}
    return seen | beside


def _files(module: str) -> list[Path]:
    """The file of a module and the `__init__.py` of the packages between it and this package."""
    parts = module.split(".")[1:]
    files = [PACKAGE.joinpath(*parts[: i + 1], "__init__.py") for i in range(len(parts))]
    if parts:
        files.append(PACKAGE.joinpath(*parts).with_suffix(".py"))
    return [file for file in files if file.is_file()]


@functools.cache
def _imports(path: Path) -> tuple[str, ...]:
    """Dotted names of this package that a file imports, wherever in the file."""
    names: list[str] = []
    package = (PACKAGE.name, *path.relative_to(PACKAGE).parent.parts)
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            above = package[: len(package) - node.level + 1] if node.level else ()
            base = ".".join((*above, *([node.module] if node.module else [])))
            names += [base, *(f"{base}.{alias.name}" for alias in node.names)]
        elif isinstance(node, ast.Constant) and _names_sibling(node.value, path):
            # a table of modules that are imported when they are needed
            names.append(".".join((*package, str(node.value))))
    return tuple(name for name in names if name.split(".")[0] == PACKAGE.name)


def _names_sibling(value: object, path: Path) -> bool:
    """Whether a constant is the name of a module beside a file."""
    return isinstance(value, str) and value.isidentifier() and (path.parent / f"{value}.py").is_file()
