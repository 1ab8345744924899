"""`lifeline fault-report`: render files of trials as one page."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from deploy.stack.errors import DeployError
from faults.report.figures import Campaign, campaigns
from faults.report.page import page
from faults.trial import Provenance, Trial
from faults.trial_file import read_records


def read_campaigns(files: Sequence[Path]) -> tuple[list[Campaign], int]:
    """Return the campaigns in the files, and the number of trials of older revisions, which are left out.

    Raises:
        DeployError: a file cannot be read or is damaged, or no file contains a trial.
    """
    found, left_out = campaigns(_records(files))
    if not found:
        names = ", ".join(str(file) for file in files)
        raise DeployError(f"there is no trial in {names}: `lifeline faults --out FILE.jsonl` makes some")
    return found, left_out


class Written(NamedTuple):
    """The page that was written, and the trials on it."""

    page: str
    trials: int
    broken_trials: int
    trials_of_older_revisions: int

    @property
    def sentence(self) -> str:
        verdict = (
            f"{self.broken_trials:,} broke a promise" if self.broken_trials else "every promise was kept"
        )
        return f"{self.page}: {self.trials:,} trials, {verdict}"


def write_report(files: Sequence[Path], out: Path) -> Written:
    """Write the page.

    Raises:
        DeployError: as above, or the page cannot be written.
    """
    found, left_out = read_campaigns(files)
    text = page([file.name for file in files], found, left_out)
    try:
        out.write_text(text, encoding="utf-8")
    except OSError as error:
        raise DeployError(f"cannot write {out}: {error.strerror}") from error
    trials, broken = sum(one.trials for one in found), sum(one.broken_trials for one in found)
    return Written(str(out), trials, broken, left_out)


def _records(files: Sequence[Path]) -> Iterator[Trial | Provenance]:
    for file in files:
        yield from read_records(file)
