"""Update the generated parts of README.md and docs/*.md: `python -m docs.generate`; tests/unit/test_docs.py compares them."""

from docs.generate import (
    access,
    benches,
    commands,
    crash_safety,
    fresh_runs,
    lab,
    readme,
    safety_law,
    sections,
    station,
)

DOCUMENTS: dict[str, sections.Parts] = {
    "README.md": readme.PARTS,
    "docs/access.md": access.PARTS,
    "docs/bench.md": benches.BENCH_PARTS,
    "docs/commands.md": commands.PARTS,
    "docs/crash-safety.md": crash_safety.PARTS,
    "docs/fleet.md": benches.FLEET_PARTS,
    "docs/lab.md": lab.PARTS,
    "docs/link.md": benches.LINK_PARTS,
    "docs/passport.md": fresh_runs.PARTS,
    "docs/safety-law.md": safety_law.PARTS,
    "docs/station.md": station.PARTS,
}


def main() -> None:
    for document, parts in DOCUMENTS.items():
        path = sections.ROOT / document
        path.write_text(sections.regenerated(path.read_text(), parts, document))


if __name__ == "__main__":
    main()
