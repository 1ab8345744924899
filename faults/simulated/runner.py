"""Many seeds of the virtual campaign on several cores: progress, file, table, exit code; and the revision of its code.

Equal revisions give equal trials: a resumed campaign must not mix the results of different code. The revision
covers all files that the trials import, directly or through others, so no list of files can be incomplete.
"""

import hashlib
import os
import signal
import threading
from collections.abc import Generator, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from modulefinder import ModuleFinder
from multiprocessing import active_children, get_context, parent_process
from pathlib import Path

from rich.console import Console

from deploy.stack import errors
from deploy.stack.errors import DeployError
from deploy.stack.takedown import Say
from faults.report.table import Progressing, print_results, story
from faults.simulated.trial_run import run_trial
from faults.trial import Trial, parse
from faults.trial_file import appending, known_trials

DECIDES = "faults.simulated.trial_run"
"""This module and its imports determine what a seed does."""
ROOT = Path(__file__).parents[2]
DATA_PACKAGES = ("sim", "supervisor", "teleop", "virtual", "wire")
DATA_SUFFIXES = frozenset({".xml", ".toml", ".msg"})
"""Files that these packages read: layouts, models, message definitions."""
BATCH = 4
"""Seeds in one batch for a worker; Ctrl-C loses those that are not finished."""


def replay(seed: int, say: Say, *, as_json: bool = False) -> int:
    """Run one seed and print every event, or the trial as JSON; return 1 if it broke a promise."""
    trial = run_trial(seed, revision(DECIDES), with_timeline=True)
    if as_json:
        print(trial.line())
    else:
        for line in story(trial):
            say(line)
    return int(bool(trial.violations))


def campaign(seeds: int, jobs: int, out: Path | None, say: Say, *, as_json: bool = False) -> int:
    """The seeds from 0 on; 1 if any broke a promise, 130 if it was interrupted and none did.

    Args:
        seeds: how many.
        jobs: processes that work on them.
        out: a line for each trial is added here; those that are there already are not run again.
        say: takes a sentence for the operator.
        as_json: print the results as JSON, and the progress on standard error.

    Raises:
        DeployError: the file cannot be used, or a trial could not be run.
    """
    code = revision(DECIDES)
    interrupted = False
    with errors.interrupts(), appending(out) as append:
        trials = {trial.seed: trial for trial in known_trials(out, "virtual", code) if trial.seed < seeds}
        if trials:
            say(f"{len(trials)} of {seeds} seeds are in {out} already")
        missing = [seed for seed in range(seeds) if seed not in trials]
        try:
            for line in _lines(missing, jobs, code, Console(stderr=as_json)):
                append(line)
                trial = parse(Trial, line)
                trials[trial.seed] = trial
        except KeyboardInterrupt:
            interrupted = True
            say("interrupted: what has been run counts")
    done = [trials[seed] for seed in sorted(trials)]
    print_results(done, as_json=as_json)
    broken = [trial for trial in done if trial.violations]
    hours = sum(trial.duration_s for trial in done) / 3600
    say(f"{len(done)} seeds, {hours:.1f} virtual hours: {len(broken)} broke a promise")
    return 1 if broken else 130 if interrupted else 0


def default_jobs() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _lines(seeds: Sequence[int], jobs: int, code: str, console: Console) -> Iterator[str]:
    """Yield one line for each seed, in their order."""
    if not seeds:
        return
    # Spawned, not forked: a child must not inherit this process's threads half way.
    pool = ProcessPoolExecutor(jobs, mp_context=get_context("spawn"), initializer=_end_with_parent)
    progress = Progressing(console, len(seeds))
    try:
        with _interrupts_held_back():
            batches = [
                pool.submit(run_lines, seeds[first : first + BATCH], code)
                for first in range(0, len(seeds), BATCH)
            ]
        with progress.shown():
            progress.begin("virtual faults")
            for batch in batches:
                for line in batch.result():
                    progress.end(broken='"violations":' in line)
                    yield line
    except BaseException:
        # No batch is cancelled: a pool whose workers died prints a traceback for each one that is, in Python 3.11.
        for worker in active_children():
            worker.kill()  # do not wait for the end of its batch
        raise
    finally:
        pool.shutdown()


def run_lines(seeds: Sequence[int], code: str) -> list[str]:
    """Run one batch in a worker."""
    return [run_line(seed, code) for seed in seeds]


def run_line(seed: int, code: str) -> str:
    """Run one trial in a worker; return its line.

    Raises:
        DeployError: naming the seed.
    """
    try:
        return run_trial(seed, code).line()
    except Exception as error:
        raise DeployError(
            f"seed {seed} could not be run: {type(error).__name__}: {error}; "
            f"see it with `lifeline faults --virtual --seed {seed}`"
        ) from error


@contextmanager
def _interrupts_held_back() -> Generator[None]:
    """Block SIGINT; a worker that starts here inherits this for its lifetime, and this process gets the signal afterwards.

    Ctrl-C reaches the whole process group, but only the main process may handle it.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _end_with_parent() -> None:
    """In a worker: end as soon as the campaign's process has ended."""

    def wait() -> None:
        if (parent := parent_process()) is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=wait, daemon=True).start()


# --- the revision


def revision(module: str) -> str:
    """Return the revision of a module, of every project module that it imports, and of the data files that these may read."""
    sha = hashlib.sha256()
    for path in sorted({*files_behind(module), *_data()}):
        sha.update(path.relative_to(ROOT).as_posix().encode() + b"\0" + path.read_bytes())
    return sha.hexdigest()[:12]


def files_behind(module: str) -> set[Path]:
    """Return the source files of a module and of all project modules that it imports, anywhere in a file or indirectly."""
    finder = ModuleFinder([str(ROOT)])
    finder.import_hook(module)
    files = (vars(found)["__file__"] for found in finder.modules.values())
    return {Path(file) for file in files if file is not None}


def _data() -> Iterable[Path]:
    return (
        path for name in DATA_PACKAGES for path in (ROOT / name).rglob("*") if path.suffix in DATA_SUFFIXES
    )
