"""Draws docs/images/stop_times.png, soak.png and sigkill.png: `python -m docs.generate.draw_crash_safety`.

The first two from the committed results; the last from a run of the same services on the virtual clock,
which is the same for the same code.
"""

import asyncio
import itertools
import logging
from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from bench.rig.stored import read_appended
from bench.soak import Sample
from docs.generate.crash_safety import SOAK, result
from docs.generate.palette import DANGER, GREY, INK, LIGHT, RING, ROBOT, plain, style
from faults.classes import CLASSES, FaultClass, Group
from faults.promises import KILL_LIMIT_S, KILL_MEDIAN_S
from faults.seen import Seen
from faults.simulated.scenario import Drivers, Scenario, Scene
from faults.simulated.world import World
from virtual.loop import VirtualLoop
from wire import topics

IMAGES = Path(__file__).parents[1] / "images"
DASHED = (0, (1.2, 0.8))
DOTS = {"real": ("real processes", ROBOT, -0.2), "virtual": ("virtual clock", "#a9b3bd", 0.2)}
"""Label, colour, and place below the middle of the row of each campaign."""

HEADINGS: Mapping[str, str] = {
    Group.TELEOP: "operator's program",
    Group.SUPERVISOR: "supervisor",
    Group.SENSORS: "base and sensors",
    Group.NETWORK: "network",
    Group.STATION: "page of a station",
    Group.WIRE: "another program on the wire",
    Group.ESTOP: "e-stop, then within 0.3 s",
    Group.MACHINE: "computer",
}
WORDS = {
    "teleop_sigkill": "killed (SIGKILL)",
    "teleop_sigterm": "ended (SIGTERM)",
    "teleop_sigstop": "paused (SIGSTOP)",
    "teleop_blocked": "event loop blocked",
    "teleop_end_of_input": "end of the keyboard input",
    "teleop_gil": "interpreter's lock held",
    "supervisor_sigkill": "killed (SIGKILL)",
    "supervisor_sigstop": "paused (SIGSTOP)",
    "supervisor_blocked": "event loop blocked",
    "supervisor_and_teleop_sigkill": "killed with the operator's program",
    "supervisor_restart": "SIGTERM or an exception",
    "sim_sigkill": "base killed (SIGKILL)",
    "sim_sigstop": "base paused (SIGSTOP)",
    "sim_blocked": "base's event loop blocked",
    "sim_scan_nan": "every beam reads NaN",
    "sim_scan_silent": "no scans",
    "sim_scan_frozen_no_odom": "same scan repeated, no odometry",
    "sim_scan_frozen_odom_zero": "same scan repeated, odometry zero",
    "net_cut": "operator's link cut",
    "net_cut_base": "base's link cut",
    "net_healed": "operator's link cut and healed",
    "net_healed_base": "base's link cut and healed",
    "net_down_only": "operator's messages lost",
    "net_base_mute": "base's messages lost",
    "net_flapping": "operator's token lost for 2 ms",
    "net_unplugged": "operator's cable unplugged",
    "station_sigkill": "server killed (SIGKILL)",
    "station_sigstop": "server paused (SIGSTOP)",
    "station_page_sigkill": "page killed (SIGKILL)",
    "station_page_sigstop": "page paused (SIGSTOP)",
    "station_page_frozen": "page shows an old picture",
    "station_page_garbage": "page sends garbage",
    "station_supervisor_sigkill": "supervisor killed",
    "wire_second_lidar_steady": "second lidar at 20 Hz",
    "wire_second_lidar_flood": "second lidar at up to 2 kHz",
    "estop_teleop_sigkill": "operator's program killed",
    "estop_supervisor_sigkill": "supervisor killed",
    "estop_sim_sigkill": "base killed",
    "machine_suspend": "suspended",
}
"""The classes with a bound, in a few words below their heading."""

# Teleop is ready by then, and as fast as it will be when it is killed.
NEUTRAL_S, DRIVE_S, KILL_S, AGAIN_S, END_S = 1.5, 1.7, 3.313, 3.913, 6.0
PRESSES = 7


def draw_stop_times(path: Path) -> None:
    """Draw a dot for each stop and a line for each bound; classes without a bound are not drawn."""
    classes = {
        mode: [one for one in result(mode).classes() if one.bound_s is not None and one.timed]
        for mode in DOTS
    }
    drawn = {one.name for ones in classes.values() for one in ones}
    known = [one for one in CLASSES if one.name in drawn]
    rows: list[str] = []
    for group, members in itertools.groupby(known, lambda one: one.group):
        rows += [group, *(one.name for one in members)]
    figure = Figure(figsize=(10, 1.5 + 0.29 * len(rows)), layout="constrained")
    axes = figure.subplots()
    for mode, ones in classes.items():
        stops = sum(len(one.timed) for one in ones)
        label, colour, offset = DOTS[mode]
        axes.plot([], [], "o", color=colour, ms=6, mew=0, label=f"{label}: {stops:,} stops")
        for one in ones:
            times_ms = [1000 * max(case.stop_s, 1e-4) for case in one.timed if case.stop_s is not None]
            # Spread by rank and not by chance: the same picture every time.
            middle = rows.index(one.name) + offset
            heights = [middle + 0.14 * ((7 * rank) % 11 - 5) / 5 for rank in range(len(times_ms))]
            axes.plot(times_ms, heights, "o", color=colour, ms=4, alpha=0.7, mew=0)
    for one in known:
        _bound(axes, rows.index(one.name), one)
    axes.plot([], [], color=DANGER, lw=2.4, label="bound")
    axes.plot([], [], color=DANGER, lw=2.4, ls=DASHED, label="bound of the median")
    axes.set_xscale("log")
    axes.set_xlim(0.08, 2000)
    axes.set_xticks((0.1, 1, 10, 100, 1000), ("0.1", "1", "10", "100", "1000"))
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.set_yticks(range(len(rows)), [HEADINGS.get(row) or WORDS[row] for row in rows])
    axes.tick_params(axis="y", length=0)
    for label, row in zip(axes.get_yticklabels(), rows, strict=True):
        label.set_fontweight("bold" if row in HEADINGS else "normal")
    figure.supxlabel(
        "from the fault to a zero command; if the supervisor fails, to the base's own braking [ms]\n"
        "two bounds: of the median (dashed), and of the upper 95 % limit of the 95 % quantile (solid)",
        fontsize="medium",
    )
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(axis="x", color=LIGHT, lw=0.6)
    figure.legend(loc="outside upper center", ncols=4, frameon=False, handletextpad=0.4, columnspacing=1.4)
    figure.savefig(path, dpi=130, metadata={"Software": None})


def _bound(axes: Axes, row: int, known: FaultClass) -> None:
    """Draw the bound of a class; after the end of a process, also that of the median."""
    assert known.bound_s is not None
    ends = [row - 0.4, row + 0.4]
    axes.plot([1000 * known.bound_s] * 2, ends, color=DANGER, lw=2.4)
    if known.bound_s == KILL_LIMIT_S:
        axes.plot([1000 * KILL_MEDIAN_S] * 2, ends, color=DANGER, lw=2.4, ls=DASHED)


def killed() -> Seen:
    """A teleop driven by keys, killed at speed, started again with nobody at its keys."""
    loop = VirtualLoop()
    world = World(loop, Scenario(2, Scene.EMPTY, False, False, Drivers.TELEOP, 0.0, (), ()))  # noqa: FBT003 - as drawn
    logging.getLogger("sim").setLevel(logging.ERROR)

    async def play() -> None:
        world.start_all()
        watching = asyncio.ensure_future(world.watch())
        await asyncio.sleep(NEUTRAL_S)
        _press(world, "s")
        await asyncio.sleep(DRIVE_S - NEUTRAL_S)
        _press(world, "w" * PRESSES)
        await asyncio.sleep(KILL_S - DRIVE_S)
        world.kill(topics.TELEOP)
        await asyncio.sleep(AGAIN_S - KILL_S)
        world.start(topics.TELEOP)
        await asyncio.sleep(END_S - AGAIN_S)
        watching.cancel()

    loop.run_until_complete(play())
    world.end()
    loop.close()
    return world.seen


def _press(world: World, keys: str) -> None:
    assert world.keyboard is not None
    world.keyboard.press(keys)


def draw_sigkill(path: Path, seen: Seen) -> None:
    """Draw the speeds around the kill, and a detail of the first milliseconds."""
    figure = Figure(figsize=(10, 4.0), layout="constrained")
    whole, near = figure.subplots(1, 2, width_ratios=(3, 2))
    for axes, begin_s, end_s, scale in ((whole, -0.4, 2.2, 1.0), (near, -0.06, 0.02, 1000.0)):
        requested = [(a.sent_s - KILL_S, a.linear_m_s) for a in seen.asked]
        commands = [(c.arrival_s - KILL_S, c.linear_m_s) for c in seen.commands]
        motions = [(m.time_s - KILL_S, m.linear_m_s) for m in seen.motions]
        axes.plot(*_scaled(requested, scale), "o", color=GREY, ms=5, mfc="none", label="requested (teleop)")
        axes.plot(
            *_scaled(commands, scale),
            ".-",
            drawstyle="steps-post",
            color=ROBOT,
            lw=1.6,
            ms=4,
            label="permitted (cmd_vel)",
        )
        axes.plot(*_scaled(motions, scale), color=RING, lw=2.4, label="the robot's speed")
        axes.axvline(0.0, color=DANGER, lw=1.6)
        axes.set_xlim(begin_s * scale, end_s * scale)
        axes.set_ylim(-0.05, 0.82)
        plain(axes)
    zero_s = (
        next(c.arrival_s for c in seen.commands if c.arrival_s >= KILL_S and c.linear_m_s == 0.0) - KILL_S
    )
    whole.text(0.015, 0.77, "SIGKILL", color=DANGER, fontsize=10)
    whole.axvline(AGAIN_S - KILL_S, color=GREY, lw=1.2, ls=(0, (4, 3)))
    whole.text(
        AGAIN_S - KILL_S + 0.015, 0.77, "teleop restarted:\nno motion", color=INK, fontsize=9, va="top"
    )
    near.text(1000 * zero_s + 1.5, 0.1, f"zero after\n{1000 * zero_s:.1f} ms", color=INK, fontsize=9)
    whole.set_xlabel("time since the kill [s]")
    near.set_xlabel("time since the kill [ms]")
    whole.set_ylabel("forward speed [m/s]")
    whole.legend(loc="center right", fontsize=9, frameon=False)
    figure.savefig(path, dpi=130, metadata={"Software": None})


def draw_soak(path: Path) -> None:
    """Draw memory, descriptors, gaps and lateness over time, one below the other."""
    samples, _ = read_appended(SOAK, Sample)
    minutes = [sample.time_s / 60 for sample in samples]
    figure = Figure(figsize=(10, 9), layout="constrained")
    panels: list[Axes] = list(figure.subplots(4, 1, sharex=True))
    for name in samples[-1].processes:
        used = [sample.processes[name] for sample in samples]
        panels[0].plot(minutes, [one.rss_bytes / 1e6 for one in used], label=name)
        panels[1].plot(minutes, [one.descriptors for one in used], label=name)
    for label in ("p50", "p99", "max"):
        panels[2].plot(minutes, [getattr(sample.ticks, f"{label}_ms") for sample in samples], label=label)
        panels[3].plot(minutes, [getattr(sample.heartbeat, f"{label}_ms") for sample in samples], label=label)
    titles = (
        "memory (RSS) [MB]",
        "open descriptors",
        "gaps of cmd_vel [ms]",
        "lateness of the heartbeat [ms]",
    )
    for axes, title in zip(panels, titles, strict=True):
        axes.set_title(title, fontsize=10, loc="left")
        axes.set_ylim(bottom=0.0)
        plain(axes)
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=9, frameon=False)
    panels[-1].set_xlabel("time [min]")
    figure.savefig(path, dpi=110, metadata={"Software": None})


def _scaled(points: Sequence[tuple[float, float]], scale: float) -> tuple[list[float], list[float]]:
    return [scale * time_s for time_s, _ in points], [speed for _, speed in points]


def main() -> None:
    style()
    with mpl.rc_context({"font.size": 12}):
        draw_stop_times(IMAGES / "stop_times.png")
    draw_soak(IMAGES / "soak.png")
    draw_sigkill(IMAGES / "sigkill.png", killed())


if __name__ == "__main__":
    main()
