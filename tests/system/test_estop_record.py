"""A pressed e-stop survives every process: nothing moves until a reset, whichever process died."""

import os
import subprocess
import tempfile
from collections.abc import Callable, Generator
from pathlib import Path

import pytest

from faults.real.real_faults import fill
from supervisor.estop_record import record_path
from tests.system.harness import Robot, is_zero, robot
from wire import topics
from wire.messages import Bool, SafetyStatus

pytestmark = pytest.mark.timeout(180)

ESTOP, UNRECORDED = "ESTOP", "ESTOP_UNRECORDED"
TRY_S = 0.5
"""Time for which the operator requests motion."""


async def press(subject: Robot) -> None:
    """Press the e-stop, and wait for a status that shows it as recorded."""
    assert subject.bus is not None
    subject.bus.publisher(topics.ESTOP).put(Bool(data=True))
    await subject.until(
        lambda: ESTOP in subject.status.reasons and not subject.status.estop_record_problem,
        "a recorded e-stop",
    )


async def restart_supervisor(subject: Robot) -> None:
    """Kill and restart it, and wait for a status of the new process that has received the operator's commands."""
    subject.restart_supervisor()
    await subject.until(lambda: any(s.accepted for s in subject.status.sources), "a new supervisor")


async def nothing_moves(subject: Robot, reason: str = ESTOP) -> None:
    """Send neutral, then motion: the commands are received, and the reason remains."""
    await subject.press("s", lambda: _heard(subject.status, neutral=True), "a neutral teleop")
    subject.outputs.clear()
    await subject.press("www", lambda: _heard(subject.status, neutral=False), "a teleop that asks for motion")
    await subject.never(lambda: reason not in subject.status.reasons, f"released from {reason}", TRY_S)
    assert subject.outputs
    assert all(is_zero(twist) for _, twist in subject.outputs)
    subject.type("s")


def _heard(status: SafetyStatus, *, neutral: bool) -> bool:
    return any(
        s.name == topics.TELEOP and s.accepted > 0 and s.age_s < 0.2 and s.neutral is neutral
        for s in status.sources
    )


@pytest.mark.smoke
async def test_a_killed_supervisor_comes_back_with_the_estop_latched_until_the_operator_resets_it(
    tmp_path: Path,
) -> None:
    async with robot(tmp_path) as subject:
        await subject.drive()
        await press(subject)
        await restart_supervisor(subject)
        assert ESTOP in subject.status.reasons
        await nothing_moves(subject)
        await subject.press("r", lambda: ESTOP not in subject.status.reasons, "a reset")
        await subject.until(lambda: not subject.status.estop_record_problem, "a recorded reset")
        await restart_supervisor(subject)
        await subject.drive()


@pytest.mark.parametrize("victim", [topics.TELEOP, topics.SIM])
async def test_the_estop_stays_latched_when_another_process_is_killed(tmp_path: Path, victim: str) -> None:
    async with robot(tmp_path) as subject:
        await subject.drive()
        await press(subject)
        subject.kill(victim)
        if victim == topics.TELEOP:
            subject.start_teleop()
        else:
            subject.start(victim)
        await nothing_moves(subject)


def without_space(disk: Path) -> None:
    fill(disk / "filler")


def without_inodes(disk: Path) -> None:
    for number in range(INODES):
        try:
            (disk / str(number)).touch()
        except OSError:
            return


def read_only(disk: Path) -> None:
    subprocess.run(["mount", "-o", "remount,ro", str(disk)], check=True)


def repair(disk: Path) -> None:
    subprocess.run(["mount", "-o", "remount,rw,size=1m,nr_inodes=1000", str(disk)], check=True)


def cover(disk: Path) -> None:
    """Mount a read-only disk over it. While the supervisor has a file open for writing, only the kernel can make its own disk read-only."""
    subprocess.run(["mount", "-t", "tmpfs", "-o", "ro,mode=700", "lifeline", str(disk)], check=True)


def uncover(disk: Path) -> None:
    subprocess.run(["umount", str(disk)], check=True)


INODES = 32


@pytest.fixture
def disk(tmp_path: Path) -> Generator[Path]:
    """A small disk of its own."""
    path = tmp_path / "disk"
    path.mkdir()
    options = f"size=256k,mode=700,nr_inodes={INODES}"
    mounted = os.geteuid() == 0 and subprocess.run(
        ["mount", "-t", "tmpfs", "-o", options, "lifeline", str(path)],
        capture_output=True,
        check=False,
    )
    if not mounted or mounted.returncode:
        pytest.skip("needs the right to mount a disk")
    yield path
    while os.path.ismount(path):
        subprocess.run(["umount", "-l", str(path)], check=True)


@pytest.mark.parametrize(
    "spoil",
    [
        without_space,
        without_inodes,
        read_only,
    ],
)
async def test_a_robot_on_a_disk_that_holds_no_record_moves_neither_before_an_estop_nor_after_a_restart(
    spoil: Callable[[Path], None], tmp_path: Path, disk: Path
) -> None:
    spoil(disk)
    async with robot(tmp_path, state=disk) as subject:
        await subject.until(
            lambda: UNRECORDED in subject.status.reasons or ESTOP in subject.status.reasons, "a stop"
        )
        assert subject.bus is not None
        subject.bus.publisher(topics.ESTOP).put(Bool(data=True))
        await subject.until(lambda: ESTOP in subject.status.reasons, "the e-stop")
        await restart_supervisor(subject)
        assert ESTOP in subject.status.reasons
        await nothing_moves(subject)
        await subject.press("r", lambda: ESTOP not in subject.status.causes, "a reset")
        await nothing_moves(subject, UNRECORDED)
        repair(disk)
        await subject.until(lambda: UNRECORDED not in subject.status.causes, "a disk that works")
        await subject.drive()


@pytest.mark.parametrize("spoil", [without_space, without_inodes])
async def test_an_estop_on_a_disk_that_became_full_while_the_robot_drove_outlives_the_supervisor(
    spoil: Callable[[Path], None], tmp_path: Path, disk: Path
) -> None:
    async with robot(tmp_path, state=disk) as subject:
        await subject.drive()
        spoil(disk)
        assert subject.bus is not None
        subject.bus.publisher(topics.ESTOP).put(Bool(data=True))
        await subject.until(lambda: ESTOP in subject.status.reasons, "the e-stop")
        await restart_supervisor(subject)
        assert ESTOP in subject.status.reasons
        await nothing_moves(subject)
        repair(disk)
        await nothing_moves(subject)
        await subject.press("r", lambda: ESTOP not in subject.status.causes, "a reset")
        await subject.until(lambda: UNRECORDED not in subject.status.causes, "a disk that works")
        await subject.drive()


async def test_a_driving_robot_stops_when_its_disk_becomes_read_only_until_the_disk_is_repaired(
    tmp_path: Path, disk: Path
) -> None:
    async with robot(tmp_path, state=disk) as subject:
        await subject.drive()
        cover(disk)
        await subject.until(lambda: UNRECORDED in subject.status.causes, "a stop")
        assert "Read-only file system" in subject.status.estop_record_problem
        await nothing_moves(subject, UNRECORDED)
        uncover(disk)
        await subject.until(lambda: UNRECORDED not in subject.status.causes, "a disk that works")
        await subject.drive()


@pytest.fixture
def pinned() -> Generator[Callable[[Path], None]]:
    """Mount a file on itself, so that no program can rename or remove it; every other change of the disk succeeds."""
    mounted: list[Path] = []

    def pin(file: Path) -> None:
        command = ["mount", "--bind", str(file), str(file)]
        if os.geteuid() != 0 or subprocess.run(command, capture_output=True, check=False).returncode:
            pytest.skip("needs the right to mount a file")
        mounted.append(file)

    yield pin
    for file in mounted:
        subprocess.run(["umount", "-l", str(file)], check=True)


async def test_an_estop_outlives_the_supervisor_on_a_disk_that_refuses_to_rename_the_prepared_record(
    tmp_path: Path, pinned: Callable[[Path], None]
) -> None:
    async with robot(tmp_path) as subject:
        await subject.drive()
        pinned(record_path(tmp_path, "robot").with_suffix(".ready"))
        await press(subject)
        await restart_supervisor(subject)
        assert ESTOP in subject.status.reasons
        await nothing_moves(subject)


NOBODY = 65_534


@pytest.fixture
def shared() -> Generator[Path]:
    """A state directory of mode 0777 that other users can reach."""
    if os.geteuid() != 0:
        pytest.skip("needs root, to act as another user")
    with tempfile.TemporaryDirectory(dir="/tmp") as directory:
        Path(directory).chmod(0o755)
        state = Path(directory) / "state"
        state.mkdir()
        state.chmod(0o777)
        yield state


def as_another_user(*command: str | Path) -> int:
    return subprocess.run(command, user=NOBODY, group=NOBODY, extra_groups=[], check=False).returncode


async def test_a_robot_whose_state_directory_others_can_change_does_not_move_until_it_is_repaired(
    tmp_path: Path, shared: Path
) -> None:
    state, kept = shared, tmp_path / "kept"
    kept.write_text("kept")
    assert as_another_user("ln", "-s", kept, state / "estop-robot.ready") == 0
    async with robot(tmp_path, state=state) as subject:
        await subject.until(lambda: UNRECORDED in subject.status.reasons, "a stop")
        assert str(state) in subject.status.estop_record_problem
        assert "run `" in subject.status.estop_record_problem
        assert subject.bus is not None
        subject.bus.publisher(topics.ESTOP).put(Bool(data=True))
        await subject.until(lambda: ESTOP in subject.status.reasons, "the e-stop")
        assert as_another_user("rm", "-f", record_path(state, "robot")) == 0
        await restart_supervisor(subject)
        await nothing_moves(subject)
        await nothing_moves(subject, UNRECORDED)
        state.chmod(0o755)
        (state / "estop-robot.ready").unlink(missing_ok=True)  # the link, if no press has renamed it
        await subject.until(lambda: UNRECORDED not in subject.status.causes, "a repaired directory")
        assert as_another_user("rm", "-f", record_path(state, "robot")) != 0
        assert kept.read_text() == "kept"
        await nothing_moves(subject)
        await subject.press("r", lambda: ESTOP not in subject.status.reasons, "a reset")
        await subject.drive()


async def test_a_supervisor_that_cannot_read_the_record_starts_latched_and_says_what_is_wrong(
    tmp_path: Path,
) -> None:
    (tmp_path / "estop-robot.latched").mkdir()
    async with robot(tmp_path) as subject:
        await subject.until(lambda: ESTOP in subject.status.reasons, "a latched e-stop")
        await nothing_moves(subject)
        await subject.until(lambda: _heard(subject.status, neutral=True), "a neutral teleop")
        reply = await subject.answer_to_reset()
        assert reply.success
        assert "the next supervisor starts latched" in reply.message
        await subject.until(lambda: subject.status.estop_record_problem != "", "the problem in the status")
        await nothing_moves(subject, UNRECORDED)
