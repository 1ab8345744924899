"""The page of a campaign: its content for each class, without external resources."""

import gzip
import re
import resource
from collections.abc import Sequence
from html.parser import HTMLParser
from pathlib import Path
from xml.dom import minidom

import pytest
from typer.testing import CliRunner

from deploy.stack import provenance
from deploy.stack.errors import DeployError
from faults.report.drawing import timeline
from faults.report.figures import campaigns, replay
from faults.report.page import BROKEN_SHOWN, percent, read_campaigns, write_report
from faults.trial import BrokenPromise, Injected, Provenance, Sample, Trial, parse
from faults.trial_file import appending, read_records
from lifeline.cli.app import app

PROVENANCE = Provenance(
    command="lifeline faults --virtual", date="2026-01-02 03:04 UTC", machine="2 cores", commit="abc1234"
)


def fault(
    name: str = "teleop_sigkill",
    *,
    zero_s: float | None = 0.004,
    detector: str | None = "SOURCE_LOST",
    at_s: float = 2.0,
    **parameters: float | str,
) -> Injected:
    return Injected(
        fault=name,
        time_s=at_s,
        parameters=parameters,
        detector=detector,
        speed_m_s=0.5,
        to_zero_s=zero_s,
        to_standstill_s=None if zero_s is None else zero_s + 0.25,
        distance_m=0.08,
    )


def trial(
    *faults: Injected,
    seed: int = 1,
    mode: str = "virtual",
    revision: str = "r",
    broken: Sequence[str] = (),
    with_timeline: bool = False,
    clearance_m: float = 0.5,
) -> Trial:
    return Trial(
        mode="real" if mode == "real" else "virtual",
        revision=revision,
        seed=seed,
        duration_s=10.0,
        faults=faults,
        smallest_clearance_m=clearance_m,
        contacts=0,
        violations=tuple(BrokenPromise(promise=2, time_s=2.5, sentence=one) for one in broken),
        timeline=tuple(sample(0.1 * tick) for tick in range(60)) if with_timeline else (),
    )


def sample(time_s: float) -> Sample:
    speed_m_s = 0.5 if time_s < 2.0 else 0.0
    return Sample(
        time_s=time_s,
        commanded=(0.5, 0.0),
        permitted=(speed_m_s, 0.0),
        true=(speed_m_s, 0.0),
        clearance_m=0.5,
        reasons=() if time_s < 2.0 else ("SOURCE_LOST",),
    )


def file_of(path: Path, *records: Trial | Provenance) -> Path:
    path.write_text("".join(one.line() + "\n" for one in records))
    return path


def page_of(tmp_path: Path, *records: Trial | Provenance) -> str:
    out = tmp_path / "out.html"
    write_report([file_of(tmp_path / "trials.jsonl", *records)], out)
    return out.read_text()


class Texts(HTMLParser):
    """Collects the cells of every row of every table."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.rows: list[list[str]] = []
        self._in_cell = False
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: object) -> None:
        if tag == "tr":
            self.rows.append([])
        if tag in {"td", "th"}:
            self._in_cell = True
            self.rows[-1].append("")

    def handle_endtag(self, tag: str) -> None:
        if tag in {"td", "th"}:
            self._in_cell = False

    def handle_data(self, data: str) -> None:
        if self._in_cell:
            self.rows[-1][-1] += data

    def row(self, name: str) -> list[str]:
        return next(row for row in self.rows if row and row[0] == name)


def test_the_page_has_each_class_with_its_figures(tmp_path: Path) -> None:
    quick = [trial(fault(zero_s=0.001 * (1 + n % 5)), seed=n) for n in range(120)]
    slow = trial(fault(zero_s=0.026), seed=500, clearance_m=0.31)
    hung = trial(fault("teleop_sigstop", zero_s=0.2, detector="COMMAND_TIMEOUT"), seed=600)
    rows = Texts(page_of(tmp_path, *quick, slow, hung, PROVENANCE))
    killed = rows.row("teleop_sigkill")
    assert killed[:8] == [
        "teleop_sigkill",
        "121",
        "SOURCE_LOST 121",
        "10 / 25",
        "3.0",
        "5.0",
        "26.0",
        "1 of 121",
    ]
    assert "31.0" in killed
    assert killed[-2:] == ["0", "2.4 %"]
    assert rows.row("teleop_sigstop")[3:7] == ["220", "200.0", "", "200.0"], "too few for a limit"


def test_the_page_needs_nothing_from_elsewhere_and_its_pictures_are_sound(tmp_path: Path) -> None:
    html = page_of(
        tmp_path,
        trial(fault(), with_timeline=True),
        trial(fault("supervisor_sigkill"), seed=2, mode="real"),
        PROVENANCE,
    )
    assert not re.search(r"https?:|//|<script|<link|<img|@import|url\(", html)
    pictures = re.findall(r"<svg.*?</svg>", html, re.DOTALL)
    assert len(pictures) == 2, "the distribution of the virtual stops, and one timeline"
    for picture in pictures:
        minidom.parseString(picture)
    for theme in ("prefers-color-scheme:dark", "@media print"):
        assert theme in html


def test_the_page_shows_the_provenance_of_the_trials_or_that_it_is_unknown(tmp_path: Path) -> None:
    html = page_of(tmp_path, trial(fault()), PROVENANCE)
    for word in (PROVENANCE.command, PROVENANCE.date, PROVENANCE.machine, PROVENANCE.commit):
        assert word in html
    assert "does not record" not in html
    assert "and commit of these trials" in page_of(tmp_path, trial(fault()))
    assert "and commit of some trials" in page_of(
        tmp_path, trial(fault()), PROVENANCE, trial(fault(), seed=2)
    )


def test_text_of_a_file_is_no_markup(tmp_path: Path) -> None:
    evil = "<script>alert('x')</script>&"
    html = page_of(
        tmp_path,
        trial(fault(evil, detector=evil), broken=[evil], with_timeline=True, revision=evil),
        Provenance(command=evil, machine=evil),
    )
    assert "<script" not in html
    assert "&lt;script&gt;alert(&#x27;x&#x27;)&lt;/script&gt;&amp;" in html


def test_a_broken_promise_is_listed_with_the_command_that_shows_it_again(tmp_path: Path) -> None:
    html = page_of(
        tmp_path,
        trial(fault(), seed=7, broken=["it drove on"]),
        trial(fault("teleop_gil"), seed=8, mode="real", broken=["it drove on, too"]),
    )
    rows = Texts(html)
    (virtual,) = [row for row in rows.rows if "it drove on" in row]
    (real,) = [row for row in rows.rows if "it drove on, too" in row]
    assert virtual[-1] == "lifeline faults --virtual --seed 7"
    assert real[-1] == "lifeline faults --classes teleop_gil --trials 1 --seed 8"
    assert "Broken promises: 1" in html


def test_a_pair_is_replayed_as_a_pair() -> None:
    both = (fault(pair="a and b"), fault("sim_scan_nan", at_s=2.1, pair="a and b"))
    assert replay(trial(*both, seed=3, mode="real")) == "lifeline faults --classes pair --trials 1 --seed 3"
    ((campaign,), _) = campaigns([trial(*both, mode="real")])
    assert [one.name for one in campaign.classes()] == ["pair"]


def test_faults_far_apart_count_for_their_own_classes() -> None:
    ((campaign,), _) = campaigns([trial(fault(), fault("teleop_gil", at_s=6.0))])
    assert [one.name for one in campaign.classes()] == ["teleop_sigkill", "teleop_gil"]


def test_a_stop_for_another_reason_is_reported_beside_and_not_among_the_figures(tmp_path: Path) -> None:
    html = page_of(tmp_path, trial(fault()), trial(fault(detector="OBSTACLE", zero_s=1.5), seed=2))
    row = Texts(html).row("teleop_sigkill")
    assert row[2] == "SOURCE_LOST 1 or first by OBSTACLE 1 (max 1500 ms)"
    assert row[6] == "4.0"


def test_a_real_supervisor_s_death_is_timed_at_the_wheels() -> None:
    dead = fault("supervisor_sigkill", zero_s=1.9, detector="base: SUPERVISOR_LOST", to_wheels_s=0.006)
    ((campaign,), _) = campaigns([trial(dead, mode="real")])
    (figures,) = campaign.classes()
    assert figures.stop is not None
    assert figures.stop.worst == 0.006


def test_a_zero_that_nobody_explained_still_counts_in_a_real_trial() -> None:
    ((campaign,), _) = campaigns([trial(fault(detector=None, zero_s=0.9), mode="real")])
    (figures,) = campaign.classes()
    assert figures.others == [("no reason seen", 1, 0.9)]


def test_a_simulation_that_stood_still_shows_no_way() -> None:
    ((campaign,), _) = campaigns([trial(fault("sim_sigstop", detector="SCAN_STALE"))])
    (figures,) = campaign.classes()
    assert figures.stop is not None
    assert (figures.distance, figures.standstill) == (None, None)


def test_trials_of_older_code_are_left_out_and_counted(tmp_path: Path) -> None:
    file = file_of(
        tmp_path / "trials.jsonl", trial(fault(), revision="old"), PROVENANCE, trial(fault(), revision="new")
    )
    (found,), left_out = read_campaigns([file])
    assert (found.revision, found.trials, found.provenances, left_out) == ("new", 1, [], 1)
    write_report([file], tmp_path / "out.html")
    assert "1 trials of older revisions" in (tmp_path / "out.html").read_text()


def test_the_worst_of_many_timelines_is_found() -> None:
    trials = [trial(fault(zero_s=0.001 * (n % 50 + 1)), seed=n, with_timeline=True) for n in range(200)]
    ((campaign,), _) = campaigns(
        [*trials[:60], trial(fault(zero_s=3.0), seed=999, with_timeline=True), *trials[60:]]
    )
    figures = campaign.find("teleop_sigkill")
    assert figures is not None
    worst = figures.timeline_near(3.0)
    assert worst is not None
    assert worst.seed == 999


@pytest.mark.long
def test_a_large_campaign_makes_a_small_page(tmp_path: Path) -> None:
    line = trial(fault(), broken=["x" * 1000], with_timeline=True).line() + "\n"
    file = tmp_path / "trials.jsonl"
    file.write_text(line * 2000)
    write_report([file], tmp_path / "out.html")
    assert (tmp_path / "out.html").stat().st_size < 1_000_000


@pytest.mark.parametrize("content", ["", PROVENANCE.line() + "\n", '{"format":1'])
def test_a_file_without_a_trial_is_one_sentence(tmp_path: Path, content: str) -> None:
    file = tmp_path / "trials.jsonl"
    file.write_text(content)
    with pytest.raises(DeployError, match="there is no trial in"):
        write_report([file], tmp_path / "out.html")
    assert not (tmp_path / "out.html").exists()


def test_a_damaged_file_is_one_sentence(tmp_path: Path) -> None:
    file = tmp_path / "trials.jsonl"
    file.write_text(trial(fault()).line() + "\nnonsense\n")
    with pytest.raises(DeployError, match=r"trials\.jsonl:2: not a trial"):
        write_report([file], tmp_path / "out.html")
    file.write_text('{"origin":2}\n')
    with pytest.raises(DeployError, match="not a provenance"):
        write_report([file], tmp_path / "out.html")


def test_a_page_that_cannot_be_written_is_one_sentence(tmp_path: Path) -> None:
    file = file_of(tmp_path / "trials.jsonl", trial(fault()))
    with pytest.raises(DeployError, match="cannot write"):
        write_report([file], tmp_path / "none" / "out.html")


def test_a_compressed_file_is_read_and_a_cut_off_one_refused(tmp_path: Path) -> None:
    file = tmp_path / "trials.jsonl.gz"
    data = gzip.compress((trial(fault()).line() + "\n" + PROVENANCE.line() + "\n").encode())
    file.write_bytes(data)
    assert list(read_records(file)) == [trial(fault()), PROVENANCE]
    for damaged in (data[:-12], b"nonsense"):
        file.write_bytes(damaged)
        with pytest.raises(DeployError, match="cannot read the trials"):
            list(read_records(file))


def test_what_is_added_to_a_file_is_signed_and_nothing_is_where_nothing_was_added(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.argv", ["lifeline", "faults", "--out", str(tmp_path / "trials.jsonl")])
    out = tmp_path / "trials.jsonl"
    with appending(out):
        pass
    with appending(None) as append:
        append("a line")
    assert out.read_text() == ""
    with pytest.raises(KeyboardInterrupt), appending(out) as append:  # noqa: PT012 - interrupted after a trial
        append(trial(fault()).line())
        raise KeyboardInterrupt
    last = parse(Provenance, out.read_text().splitlines()[-1])
    assert last.command == "lifeline faults --out trials.jsonl", "no directory of this machine"
    assert "cores" in last.machine


def test_an_appended_line_follows_whole_lines_only_and_a_provenance_follows_it(tmp_path: Path) -> None:
    out = tmp_path / "results" / "trials.jsonl"
    with appending(out) as append:
        append(trial(fault(), seed=1).line())
    first = out.read_text()
    out.write_text(first + trial(fault(), seed=2).line()[:30])
    with appending(out) as append:
        append(trial(fault(), seed=3).line())
    assert out.read_text().startswith(first)
    kinds = [one.seed if isinstance(one, Trial) else "provenance" for one in read_records(out)]
    assert kinds == [1, "provenance", 3, "provenance"]


def test_a_file_that_cannot_be_appended_to_is_refused_in_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(DeployError, match=f"cannot write {tmp_path}: Is a directory"), appending(tmp_path):
        pass


def test_a_disk_that_is_full_is_one_sentence(tmp_path: Path) -> None:
    out = tmp_path / "trials.jsonl"
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1024, before[1]))  # the kernel refuses more, as on a full disk
    try:
        with (
            pytest.raises(DeployError, match=f"cannot write {out}: File too large"),
            appending(out) as append,
        ):
            append(2000 * "x")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_where_git_does_not_know_the_commit_stays_empty(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    assert provenance.commit() == ""


def test_the_command_writes_the_page_and_refuses_in_a_sentence(tmp_path: Path) -> None:
    file, out = file_of(tmp_path / "trials.jsonl", trial(fault()), PROVENANCE), tmp_path / "out.html"
    done = CliRunner().invoke(app, ["fault-report", str(file), "--html", str(out)])
    assert (done.exit_code, out.exists()) == (0, True)
    assert "1 trials, every promise was kept" in done.output
    refused = CliRunner().invoke(app, ["fault-report", str(tmp_path / "none"), "--html", str(out)])
    assert refused.exit_code == 2
    assert "cannot read the trials" in refused.output


def test_of_very_many_broken_promises_the_first_are_shown_and_the_rest_counted(tmp_path: Path) -> None:
    html = page_of(tmp_path, *(trial(fault(), seed=n, broken=["late"]) for n in range(BROKEN_SHOWN + 3)))
    assert "3 more are in the file" in html
    assert len([row for row in Texts(html).rows if "late" in row]) == BROKEN_SHOWN


@pytest.mark.parametrize(
    ("rate", "words"), [(0.0, "0 %"), (1.0, "100 %"), (0.258, "26 %"), (0.00002996, "0.0030 %")]
)
def test_a_rate_has_two_digits_that_count(rate: float, words: str) -> None:
    assert percent(rate) == words


def test_a_timeline_that_says_nothing_of_the_fault_is_not_drawn() -> None:
    one = trial(fault(at_s=50.0), with_timeline=True)
    assert timeline(one, one.faults[0]) == ""


def test_a_stop_too_short_for_its_words_is_drawn_all_the_same() -> None:
    one = trial(fault(at_s=4.0), with_timeline=True)
    brief = tuple(
        s.model_copy(update={"reasons": ("OVERRUN",) if 4.05 < s.time_s < 4.15 else ()}) for s in one.timeline
    )
    picture = timeline(one.model_copy(update={"timeline": brief}), one.faults[0])
    assert "<title>OVERRUN</title>" in picture
    assert ">OVERRUN</text>" not in picture


def test_a_class_that_never_happened_is_not_found() -> None:
    ((campaign,), _) = campaigns([trial(fault()), trial(seed=2)])
    assert campaign.find("teleop_gil") is None
    assert campaign.trials == 2


def test_a_class_without_a_bound_has_no_late_stops_and_its_real_trials_are_done_again_by_name(
    tmp_path: Path,
) -> None:
    pressed = trial(fault("wire_estop", detector="ESTOP", zero_s=9.0), seed=5, mode="real")
    ((campaign,), _) = campaigns([pressed])
    (figures,) = campaign.classes()
    assert (figures.bound_s, figures.late) == (None, 0)
    assert "lifeline faults --classes wire_estop --trials 1 --seed 5" in page_of(tmp_path, pressed)


def test_an_origin_that_comes_twice_stands_once() -> None:
    ((campaign,), _) = campaigns([trial(fault()), PROVENANCE, trial(fault(), seed=2), PROVENANCE, PROVENANCE])
    assert campaign.provenances == [PROVENANCE]
    assert not campaign.unsigned
