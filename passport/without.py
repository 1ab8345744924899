"""Replaces Lifeline's processes by programs that judge nothing, and starts them again."""

import asyncio

from deploy.stack import processes, ros2_program, supervisord
from deploy.stack.errors import DeployError
from deploy.stack.launch import Launch
from deploy.stack.statedir import StateDir
from passport.child import READY, Child
from passport.injection import InjectionError, not_supervised
from wire import topics
from wire.zenoh.local_socket import socket_of

STOP_LIMIT_S = 6.0
"""For the end of a process: more than the stopwaitsecs of supervisord.conf."""
END_LIMIT_S = 1.0
START_LIMIT_S = STOP_LIMIT_S + 1.0
"""For the start of a process that may still be ending."""


class Without:
    """The robot without Lifeline, from `begin` to `end`.

    Args:
        launch: how to reach the robot.
        state: the state directory of this computer.
        sources: the command sources that drive it.
    """

    def __init__(self, launch: Launch, state: StateDir, sources: tuple[str, ...]) -> None:
        self._launch, self._state = launch, state
        self._sources = sources
        self._replaced = [topics.SUPERVISOR, *(name for name in launch.nodes if name == topics.ROS2)]
        """The processes that are replaced; the hub first."""
        self._stopped: list[str] = []
        """Those that supervisord was asked to stop."""
        self._children: list[Child] = []

    def refusal(self) -> str | None:
        """Return why the robot cannot be measured without Lifeline; None if it can."""
        if socket_of(self._launch.bus.endpoint) is None:
            return "a robot with certificates cannot be measured without Lifeline: only its supervisor may command its base"
        for name in self._replaced:
            if (problem := not_supervised(self._launch, self._state, name)) is not None:
                return problem
        try:
            self._commands()
        except DeployError as error:
            return str(error)
        return None

    def _commands(self) -> list[list[str]]:
        """Return the command lines of the programs that replace the processes, in the order of `_replaced`.

        Raises:
            DeployError: of a ROS 2 robot, the interpreter is missing, or the state directory is not writable.
        """
        launch = self._launch
        sources = [word for source in self._sources for word in ("--source", source)]
        hub = [*launch.command("passport.bypass"), "--namespace", launch.bus.namespace]
        commands = [[*hub, "--state-dir", str(self._state.path), *sources]]
        if topics.ROS2 in self._replaced:
            module = "passport.ros2_bypass"
            commands.append(ros2_program.with_variables(self._state, launch.config, launch.bus, module))
        return commands

    async def begin(self) -> None:
        """Stop the processes, and start the programs in their place.

        Raises:
            DeployError: a program cannot be started, so that nothing was stopped.
            InjectionError: one of them did not happen.
        """
        commands = self._commands()
        for name in self._replaced:
            self._stopped.append(name)
            if not await asyncio.to_thread(supervisord.stop_program, self._state, name):
                raise InjectionError(f"supervisord does not stop the process {name}")
        loop = asyncio.get_running_loop()
        end_s = loop.time() + STOP_LIMIT_S
        while running := [one.name for one in processes.of(self._state.path) if one.name in self._replaced]:
            if loop.time() > end_s:
                raise InjectionError(f"the process {running[0]} does not end")
            await asyncio.sleep(processes.POLL_S)
        for name, command in zip(self._replaced, commands, strict=True):
            child = Child(command)
            self._children.append(child)
            answer = await child.first_line()
            if answer != READY:
                raise InjectionError(
                    f"the program in place of the process {name} cannot run: {answer or 'it has ended'}"
                )

    async def end(self) -> bool:
        """End the programs, which send zero, and start the processes again; return whether they start."""
        for child in self._children:
            await child.end(END_LIMIT_S)
        return all([await self._starts_again(name) for name in self._stopped])

    async def _starts_again(self, name: str) -> bool:
        loop = asyncio.get_running_loop()
        end_s = loop.time() + START_LIMIT_S
        while not await asyncio.to_thread(supervisord.start_program, self._state, name):
            if loop.time() > end_s:
                return False
            await asyncio.sleep(processes.POLL_S)
        return True
