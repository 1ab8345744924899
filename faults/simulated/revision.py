"""The revision of the code that decides what a seed of the virtual campaign does.

Equal revision, equal trials: a resumed campaign must not mix the results of different code. What decides is found
by following the imports, so that no list can miss a file.
"""

import ast
import hashlib
from collections.abc import Iterable, Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGES = ("deploy", "faults", "lifeline", "sim", "supervisor", "teleop", "virtual", "wire")
DATA_PACKAGES = ("sim", "supervisor", "teleop", "virtual", "wire")
DATA_SUFFIXES = frozenset({".xml", ".toml", ".msg"})
"""Files that these packages read: layouts, models, message definitions."""


def revision(module: str) -> str:
    """Return the revision of a module, of every project module that it imports, and of the data files that these may read."""
    sha = hashlib.sha256()
    for path in sorted({*files_behind(module), *_data()}):
        sha.update(path.relative_to(ROOT).as_posix().encode() + b"\0" + path.read_bytes())
    return sha.hexdigest()[:12]


def files_behind(module: str) -> set[Path]:
    """Return the source files of a module and of all project modules that it imports, directly or indirectly."""
    files, open_ends = set[Path](), [module]
    while open_ends:
        name = open_ends.pop()
        file = _file_of(name)
        if file is None or file in files:
            continue
        files.add(file)
        open_ends.extend(_parents(name))
        open_ends.extend(_imported(ast.parse(file.read_bytes())))
    return files


def _imported(tree: ast.Module) -> Iterator[str]:
    """Return all names that may be imported modules, anywhere in the file."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module is not None:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def _parents(name: str) -> Iterator[str]:
    """Return the packages whose `__init__.py` runs before the module."""
    parts = name.split(".")
    return (".".join(parts[:count]) for count in range(1, len(parts)))


def _file_of(name: str) -> Path | None:
    """Return the source file of a project module; None for any other name."""
    parts = name.split(".")
    if parts[0] not in PACKAGES:
        return None
    place = ROOT.joinpath(*parts)
    return next((file for file in (place.with_suffix(".py"), place / "__init__.py") if file.is_file()), None)


def _data() -> Iterable[Path]:
    return (
        path for name in DATA_PACKAGES for path in (ROOT / name).rglob("*") if path.suffix in DATA_SUFFIXES
    )
