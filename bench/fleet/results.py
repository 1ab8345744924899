"""The stored measurements: those of the curve and of the long run; both files have the form of bench.robots."""

from pathlib import Path

FOLDER = Path(__file__).resolve().parents[2] / "docs/campaign"
CURVE, SOAK = FOLDER / "bench_fleet.jsonl", FOLDER / "bench_fleet_soak.jsonl"
