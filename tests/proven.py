"""Record for which sources of the law its proofs last passed, so that they run again only after a change.

    python -m tests.proven                  exit 0 if proofs and mutants passed for the present sources, else 1
    python -m tests.proven --passed PART    record that a part (proofs or mutants) passed; only the Makefile does this

The sources are the tests of the law and the mutation tests, every module of the project that they import, directly or
through others, the lock file, and the settings of the tools in pyproject.toml.
"""

import argparse
import ast
import hashlib
import json
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
RECORD = Path("tests") / "proven.json"
PARTS = ("proofs", "mutants")
STARTS = (
    "supervisor/law/*.py",
    "tests/unit/supervisor/law/*.py",
    "tests/unit/wire/test_freshness.py",
    "tests/unit/wire/test_lease.py",
    "tests/conftest.py",
    "tests/mutation.py",
    "tests/proven.py",
)
TOOLS = ("pytest", "mutmut")


def sources(root: Path) -> set[Path]:
    """Return the files of the project that the proofs depend on, relative to its root."""
    found: set[Path] = set()
    waiting = [path for pattern in STARTS for path in root.glob(pattern)]
    while waiting:
        path = waiting.pop()
        if path.relative_to(root) not in found:
            found.add(path.relative_to(root))
            waiting += [file for name in _imported(path) for file in _files(root, name)]
    return found


def digest(root: Path = ROOT) -> str:
    """Return the hash of all sources of the proofs."""
    hashed = hashlib.sha256()
    for path in (*sorted(sources(root)), Path("uv.lock")):
        content = (root / path).read_bytes()
        hashed.update(f"{path} {len(content)}\n".encode() + content)
    tools = tomllib.loads((root / "pyproject.toml").read_text("utf-8"))["tool"]
    hashed.update(json.dumps([tools[name] for name in TOOLS]).encode())
    return hashed.hexdigest()


def _imported(path: Path) -> Iterator[str]:
    """Yield the dotted names that a file imports; some of them name a value in a module."""
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def _files(root: Path, name: str) -> Iterator[Path]:
    """Yield the files of a module in the project: its own and those of its packages."""
    parts = name.split(".")
    for count in range(1, len(parts) + 1):
        place = root.joinpath(*parts[:count])
        yield from (file for file in (place.with_suffix(".py"), place / "__init__.py") if file.is_file())


def _passed(root: Path) -> dict[str, str]:
    record = root / RECORD
    return json.loads(record.read_text("utf-8")) if record.is_file() else {}


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m tests.proven",
        description="Compare the sources of the law with those for which its proofs and mutation tests last passed.",
        epilog="exit code: 0 if they are the same, 1 if not",
    )
    parser.add_argument(
        "--passed", choices=PARTS, metavar="PART", help="record that proofs or mutants passed"
    )
    part = parser.parse_args().passed
    now = digest()
    if part is not None:
        (ROOT / RECORD).write_text(json.dumps(_passed(ROOT) | {part: now}, indent=2, sort_keys=True) + "\n")
        return 0
    changed = [part for part in PARTS if _passed(ROOT).get(part) != now]
    if changed:
        print(f"the sources of the law have changed since these passed: {', '.join(changed)}")
        return 1
    print(f"proofs and mutants passed for these sources of the law ({now[:12]})")
    return 0


if __name__ == "__main__":
    sys.exit(main())
