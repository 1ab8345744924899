"""`python -m teleop`: drive the robot by keyboard or gamepad, or only watch."""

import gc
import signal

if __name__ == "__main__":
    gc.disable()  # until run_process: what the imports create stays
    # Until the loop runs, Ctrl-C ends the program without a traceback: the imports below take a while.
    signal.signal(signal.SIGINT, signal.SIG_DFL)

import argparse
import asyncio
import os
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from typing import NoReturn, get_args

from teleop.gamepad.device import GamepadDevice, open_gamepad
from teleop.gamepad.find import GamepadError
from teleop.holder import HeldError, about_this_process
from teleop.pilots.config import Mode, TeleopSection
from teleop.pilots.keyboard import Hold, Incremental
from teleop.pilots.keys import Command
from teleop.pilots.pilot import LEVELS, KeyKind, Pilot, Ramp, Velocity
from teleop.pilots.vigilance import unanswered_limit_m_s
from teleop.screen.controls import LEGENDS, command_for, help_lines, key_help
from teleop.screen.dashboard import render_dashboard
from teleop.screen.display import render
from teleop.screen.top_view import robot_of
from teleop.screen.view import Control, Event, Tone, View
from teleop.service import Render, Setup, Teleop
from teleop.terminal import Terminal, is_dumb, is_terminal
from wire import topics
from wire.bus import Bus, wait_until
from wire.host.command_line import EXIT_USAGE, override, read_document, refuse, service_parser
from wire.host.config import BusSection, ConfigError, section
from wire.host.installation import runnable
from wire.host.process import run_process
from wire.roles import Role
from wire.zenoh.bus import DEFAULT_ENDPOINT, open_bus
from wire.zenoh.hub_proof import HubProof

REDRAW_PERIOD_S = 0.5
GAMEPAD_SOURCE = "joy"
"""Default source name for a gamepad."""


@dataclass(frozen=True, slots=True)
class Options:
    """Configuration and command line options of a run."""

    config: TeleopSection
    bus: BusSection
    setup: Setup
    gamepad: GamepadDevice | None = None


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    args = _parser().parse_args(arguments)
    try:
        options = _options(args)
        if not is_terminal():
            refuse(
                "teleop",
                "keys need a terminal on standard input and output: run it in one, not in a pipe or a service",
            )
        if options.setup.control is Control.GAMEPAD:
            options = replace(options, gamepad=open_gamepad(options.config))
    except (ConfigError, GamepadError) as error:
        refuse("teleop", error)
    run_process("teleop", lambda stop: _run(stop, options), memory_keeper=options.bus.memory_keeper)


async def _run(stop: asyncio.Event, options: Options) -> int:
    wake = asyncio.Event()
    pilot = _pilot(options)
    bus: Bus | None = None
    try:
        with ExitStack() as stack:
            on_releases = pilot.rely_on_releases if isinstance(pilot, Hold) else None
            on_answer = pilot.rely_on_answers if isinstance(pilot, Incremental) else None
            plain = not options.setup.pictures
            terminal = stack.enter_context(
                Terminal(wake, plain=plain, on_releases=on_releases, on_answer=on_answer)
            )
            _greet(terminal, options)
            waiting = _Waiting(options, terminal, wake, stop)
            bus = await waiting.connect()
            if bus is not None:
                teleop = Teleop(
                    bus,
                    options.setup,
                    pilot=pilot,
                    keys=terminal,
                    screen=terminal,
                    render=_render(options),
                    wake=wake,
                )
                waiting.pass_warnings_to(lambda text: teleop.note(runnable(text), Tone.CAUTION))
                if options.gamepad is not None:
                    stack.enter_context(options.gamepad.reading(wake=wake, say=teleop.note))
                if isinstance(pilot, Hold):
                    teleop.note(pilot.explanation)
                if isinstance(pilot, Hold | Incremental):
                    pilot.say = teleop.note
                await teleop.run(stop)
                terminal.note("ended" if pilot is None else "ended; the last command was zero")
    except HeldError as error:
        print(f"teleop: {error}", file=sys.stderr)
        return EXIT_USAGE
    finally:
        if bus is not None:
            await bus.close()
    return 0


class _Waiting:
    """Waits for the supervisor, shows this on the screen, and can be ended by a key."""

    def __init__(
        self, options: Options, terminal: Terminal, wake: asyncio.Event, stop: asyncio.Event
    ) -> None:
        self._options, self._terminal, self._wake, self._stop = options, terminal, wake, stop
        self._render = _render(options)
        self._events: list[Event] = []
        self._warnings: list[str] = []
        self._say = self._note
        self._has_help = False
        self._redraw = True

    def pass_warnings_to(self, say: Callable[[str], None]) -> None:
        """Pass the warnings about this connection on, those so far and all later ones."""
        for text in self._warnings:
            say(text)
        self._say = say

    def _warn(self, text: str) -> None:
        self._warnings.append(text)
        self._say(text)

    async def connect(self) -> Bus | None:
        """Return the bus as soon as the supervisor runs; None if the operator quit."""
        section = self._options.bus

        def on_wait() -> None:
            quits = "Ctrl-C" if self._options.setup.control is Control.HOLD else "q"
            start = "`lifeline up --detach` starts it; " if section.endpoint == DEFAULT_ENDPOINT else ""
            self._note(runnable(f"waiting for the supervisor at {section.endpoint}; {start}{quits} quits"))

        config = section.to_bus_config(Role.OPERATOR)
        opening = asyncio.ensure_future(
            open_bus(config, "client", on_wait=on_wait, say=self._warn, proof=HubProof(config, self._warn))
        )
        stopping = asyncio.ensure_future(self._stop.wait())
        for task in (opening, stopping):
            task.add_done_callback(lambda _: self._wake.set())
        clock = asyncio.get_running_loop().time
        draw_s = clock()
        try:
            # Keys typed before the connection move nothing, but one that ends the program counts until the last moment.
            while not (ends := self._is_told_to_end()) and not opening.done():
                # Not after each input: the terminal answers each picture, which would ask for the next one.
                if self._redraw or clock() >= draw_s:
                    self._redraw, draw_s = False, clock() + REDRAW_PERIOD_S
                    if self._options.setup.pictures:
                        self._show()
                await wait_until(self._wake, draw_s)
                self._wake.clear()
            if ends and opening.done():
                await opening.result().close()
            return None if ends else opening.result()
        finally:
            opening.cancel()
            stopping.cancel()

    def _is_told_to_end(self) -> bool:
        control = self._options.setup.control
        pressed = [event.key for event in self._terminal.take() if event.kind is not KeyKind.RELEASE]
        commands = {command_for(key, control) for key in pressed}
        if Command.ESTOP in commands:
            self._note("emergency stop NOT sent: there is no connection to the supervisor")
        if Command.HELP in commands:
            self._has_help = not self._has_help
            self._redraw = True
        if Command.SUSPEND in commands:
            self._terminal.suspend()
            self._redraw = True
        return Command.QUIT in commands or self._terminal.ended or self._stop.is_set()

    def _note(self, text: str) -> None:
        self._events.append(Event(time.strftime("%H:%M:%S"), text, Tone.CAUTION))
        self._terminal.note(text)
        self._redraw = True
        self._wake.set()

    def _show(self) -> None:
        setup = self._options.setup
        view = View(
            setup.source,
            setup.endpoint,
            control=setup.control,
            robot=setup.robot,
            events=tuple(self._events),
            keys=LEGENDS[setup.control],
            help=key_help(setup.control) if self._has_help else (),
        )
        self._terminal.show(self._render(view, *self._terminal.size))


def _pilot(options: Options) -> Pilot | None:
    config = options.config
    ramp = Ramp(config.acceleration_m_s2, config.angular_acceleration_rad_s2)
    match options.setup.control:
        case Control.INCREMENTAL:
            unanswered_m_s = unanswered_limit_m_s(config.vigilance_s, config.round_trip_limit_s)
            return Incremental(
                ramp, config.step(), config.most(), config.level, unanswered_m_s=unanswered_m_s
            )
        case Control.HOLD:
            speed = Velocity(config.hold_linear_m_s, config.hold_angular_rad_s)
            return Hold(speed, config.most(), ramp, config.level)
        case Control.GAMEPAD:
            assert options.gamepad is not None
            return options.gamepad.pilot
        case Control.VIEW_ONLY:
            return None


def _render(options: Options) -> Render:
    if not options.setup.pictures:
        return lambda view, columns, _: [
            render(view, columns - 1)
        ]  # in the last column, the position of the cursor would be undefined
    # The Linux console's font has no braille, and encodings other than UTF-8 have no line characters.
    has_unicode = "utf" in sys.stdout.encoding.lower() and os.environ.get("TERM") != "linux"
    return lambda view, columns, rows: render_dashboard(view, columns, rows, unicode=has_unicode)


def _greet(terminal: Terminal, options: Options) -> None:
    """Print the keys once if the display does not show them."""
    if options.setup.pictures:
        return
    if is_dumb():
        terminal.note("this terminal has no control sequences (TERM=dumb): one line instead of a screen")
    for line in help_lines(key_help(options.setup.control)):
        terminal.note(line)


def _options(args: argparse.Namespace) -> Options:
    """Return the options from the configuration file and the command line, which takes precedence.

    Raises:
        ConfigError: the configuration is refused; the message lists all faults.
    """
    document = read_document(args)
    override(document, "teleop", "mode", args.mode)
    override(document, "teleop", "source", args.source)
    config = section(document, "teleop", TeleopSection)
    bus = section(document, "bus", BusSection)
    control = Control.VIEW_ONLY if args.view_only else Control(config.mode)
    source = config.source
    if control is Control.GAMEPAD and args.source is None and source == topics.TELEOP:
        source = GAMEPAD_SOURCE
    setup = Setup(
        source,
        bus.endpoint,
        control,
        robot=robot_of(document),
        most=config.most(),
        rate_hz=config.rate_hz,
        round_trip_limit_s=config.round_trip_limit_s,
        vigilance_s=config.vigilance_s,
        about=about_this_process(source),
        pictures=not (args.plain or is_dumb()),
    )
    return Options(config, bus, setup)


def _parser() -> argparse.ArgumentParser:
    defaults = TeleopSection()
    keys = "\n\n".join(
        "\n".join((f"keys, {control}:", *help_lines(key_help(control)))) for control in Control
    )
    parser = service_parser(
        "teleop",
        description="Drive the robot by keyboard or gamepad. The supervisor decides which velocity is permitted,\n"
        "and stops the robot when this program ends or hangs.",
        epilog=f"{keys}\n\n"
        f"One step is {defaults.linear_step_m_s:g} m/s or {defaults.angular_step_rad_s:g} rad/s at speed level {LEVELS}, "
        "unless the configuration differs.\n"
        "? shows all keys while the program runs.\n"
        "In mode hold, arrows count only if the terminal reports that its mouse wheel sends none (mode 1007): use the letters\n"
        "behind tmux, screen and mosh.\n"
        "After every stop the robot moves only after a neutral command (s, or all keys released).\n"
        "Exception: it may drive away from an obstacle that stopped it.\n"
        "exit code: 0 after q (except in mode hold), Ctrl-C or SIGTERM, 1 after an error, 2 for a wrong configuration,\n"
        "no terminal, or a source that another program holds",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--mode",
        choices=get_args(Mode),
        help="incremental: each key press changes the speed by one step; hold: the robot moves while a key is held; "
        f"gamepad: the robot moves while the dead-man button is held (default: {defaults.mode})",
    )
    parser.add_argument(
        "--source",
        metavar="NAME",
        help=f"name of this command source (default: {defaults.source}; with a gamepad, {GAMEPAD_SOURCE})",
    )
    parser.add_argument("--plain", action="store_true", help="print one line instead of the full screen")
    parser.add_argument(
        "--view-only",
        action="store_true",
        help="watch without driving; only the emergency stop can be commanded",
    )
    return parser


if __name__ == "__main__":
    main()
