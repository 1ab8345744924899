"""The documents match the code."""

import re
import textwrap
import tomllib
from pathlib import Path

import pytest

from docs.generate import draw_crash_animation, draw_lab, safety_law
from docs.generate.__main__ import DOCUMENTS as GENERATED
from docs.generate.sections import regenerated
from sim.config import Build
from sim.plant import Plant
from supervisor.config import SupervisorSection
from wire.reasons import StopReason

ROOT = Path(__file__).parents[2]
DOCUMENTS = sorted([ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md")])


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_what_a_document_points_to_exists(document: Path) -> None:
    text = document.read_text()
    targets = [link for link in re.findall(r"\]\(([^)#]+)", text) if not link.startswith("http")]
    assert [target for target in targets if not (document.parent / target).exists()] == []
    named = set(re.findall(r"`(test_\w+)`", text))
    tests = "".join(path.read_text() for path in (ROOT / "tests").rglob("test_*.py"))
    assert [name for name in sorted(named) if f"def {name}(" not in tests] == []


@pytest.mark.parametrize(
    "document",
    [
        pytest.param(name, marks=pytest.mark.proof if name == "docs/safety-law.md" else ())
        for name in GENERATED
    ],
)
def test_the_generated_parts_of_a_document_are_up_to_date(document: str) -> None:
    """`make docs` regenerates them."""
    text = (ROOT / document).read_text()
    assert regenerated(text, GENERATED[document], document) == text


def test_a_folder_for_the_labs_screenshots_that_cannot_be_created_is_refused_before_a_robot_starts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setattr("sys.argv", ["draw_lab", "--out", str(tmp_path / "file/lab-report")])
    with pytest.raises(SystemExit, match="2"):
        draw_lab.main()
    assert "Not a directory; choose another one with --out" in capsys.readouterr().err


def test_the_readme_has_at_most_900_words() -> None:
    assert len((ROOT / "README.md").read_text().split()) <= 900


def test_in_the_film_of_the_readme_only_the_robot_without_lifeline_hits_the_rack() -> None:
    """Both are killed at the same place and speed, far from the rack: the stop is due to SIGKILL only."""
    film = draw_crash_animation
    drives, plant = film.read(), Plant(film.SCENE, options=Build())
    alone, supervised = drives[film.ALONE], drives[film.LIFELINE]
    for one in drives.values():
        killed = one.at(0.0)
        assert killed.x_m == pytest.approx(film.KILL_X_M, abs=0.05)
        assert killed.speed_m_s == pytest.approx(film.SPEED_M_S, abs=0.01)
    crash, rest = film.hit(plant, alone), film.standstill(supervised)
    assert crash.words == "hit the rack at 0.8 m/s"
    assert alone.distance_m(crash.time_s) > 2.0
    assert supervised.distance_m(rest.time_s) < 0.3
    assert max(abs(pose.speed_m_s) for pose in supervised.poses if pose.time_s > rest.time_s) < 0.005
    with pytest.raises(ValueError, match="hit nothing"):
        film.hit(plant, supervised)


@pytest.mark.parametrize("reason", StopReason)
def test_a_stop_reason_without_a_row_in_the_table_is_refused(reason: StopReason) -> None:
    rows = {name: row for name, row in safety_law.REASONS.items() if name is not reason}
    with pytest.raises(ValueError, match=reason.name):
        safety_law.reasons_table(rows)


def test_a_part_without_a_place_in_the_document_is_refused() -> None:
    with pytest.raises(ValueError, match="no place for the part"):
        regenerated("# The safety law\n", safety_law.PARTS, "docs/safety-law.md")


@pytest.mark.proof
def test_the_picture_stays_small_and_nothing_but_neutral_or_a_way_out_sets_the_robot_going() -> None:
    edges = safety_law.transitions()
    assert len(safety_law.NODES) <= 12
    moving = {"Driving", "Limited"}
    into_motion = {before for before, after in edges if after in moving and before not in moving}
    assert into_motion == {"Ready", "Barrier"}
    assert edges["Barrier", "Driving"] == {"back"}


@pytest.mark.parametrize("page", sorted((ROOT / "docs/how-to").glob("*.md")), ids=lambda page: page.stem)
def test_each_configuration_on_a_how_to_page_is_one_that_the_supervisor_accepts(page: Path) -> None:
    for fragment in re.findall(r"```toml\n(.*?)```", page.read_text(), re.DOTALL):
        SupervisorSection.model_validate(tomllib.loads(textwrap.dedent(fragment))["supervisor"])


@pytest.mark.parametrize("page", sorted((ROOT / "docs/how-to").glob("*.md")), ids=lambda page: page.stem)
def test_each_program_on_a_how_to_page_exists(page: Path) -> None:
    for program in re.findall(r"(?:python|bash) ((?:examples|bench|deploy)/\S+\.\w+)", page.read_text()):
        assert (ROOT / program).is_file(), program
    assert page.name in (ROOT / "docs/README.md").read_text()
