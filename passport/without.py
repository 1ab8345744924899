"""Takes the place of the process `supervisor` by a hub that judges nothing, and gives it back."""

import asyncio

from deploy.stack import processes, supervisord
from deploy.stack.launch import Launch
from deploy.stack.statedir import StateDir
from passport.child import READY, Child
from passport.injection import InjectionError, not_supervised
from wire import topics
from wire.zenoh.local_socket import socket_of

STOP_LIMIT_S = 6.0
"""For the end of the supervisor: more than the stopwaitsecs of supervisord.conf."""
END_LIMIT_S = 1.0
START_LIMIT_S = 1.0


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
        self._has_begun = False
        self._hub: Child | None = None

    def refusal(self) -> str | None:
        """Return why the robot cannot be measured without Lifeline; None if it can."""
        if topics.ROS2 in self._launch.nodes:
            return "a ROS 2 robot cannot be measured without Lifeline: the process ros2 itself stops its base"
        if socket_of(self._launch.bus.endpoint) is None:
            return "a robot with certificates cannot be measured without Lifeline: only its supervisor may command its base"
        return not_supervised(self._launch, self._state, topics.SUPERVISOR)

    async def begin(self) -> None:
        """Stop the supervisor, and start the hub in its place.

        Raises:
            InjectionError: one of them did not happen.
        """
        self._has_begun = True
        if not await asyncio.to_thread(supervisord.stop_program, self._state, topics.SUPERVISOR):
            raise InjectionError("supervisord does not stop the supervisor")
        loop = asyncio.get_running_loop()
        end_s = loop.time() + STOP_LIMIT_S
        while any(one.name == topics.SUPERVISOR for one in processes.of(self._state.path)):
            if loop.time() > end_s:
                raise InjectionError("the supervisor does not end")
            await asyncio.sleep(processes.POLL_S)
        sources = [word for source in self._sources for word in ("--source", source)]
        command = [*self._launch.command("passport.bypass"), "--namespace", self._launch.bus.namespace]
        self._hub = Child([*command, "--state-dir", str(self._state.path), *sources])
        answer = await self._hub.first_line()
        if answer != READY:
            raise InjectionError(f"the hub without Lifeline cannot run: {answer or 'it has ended'}")

    async def end(self) -> bool:
        """End the hub, which sends zero, and start the supervisor again; return whether it starts."""
        if not self._has_begun:
            return True
        if self._hub is not None:
            await self._hub.end(END_LIMIT_S)
        loop = asyncio.get_running_loop()
        end_s = loop.time() + START_LIMIT_S
        while not await asyncio.to_thread(supervisord.start_program, self._state, topics.SUPERVISOR):
            if loop.time() > end_s:
                return False
            await asyncio.sleep(processes.POLL_S)
        return True
