"""`python -m passport.link SOCKET PID`: the operator's link, which carries bytes to the hub until this process is stopped.

It prints the port at which it listens on the loopback interface. While it is stopped, data waits in the buffers of the kernel, as behind a
cable that is pulled, and no connection ends.
"""

import asyncio
import sys
from contextlib import suppress

from passport.child import die_with_parent

CHUNK_BYTES = 1 << 16


async def _main(hub: str) -> None:
    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            hub_reader, hub_writer = await asyncio.open_unix_connection(hub)
        except OSError:
            writer.close()
            return
        carrying = {
            asyncio.ensure_future(_carry(reader, hub_writer)),
            asyncio.ensure_future(_carry(hub_reader, writer)),
        }
        await asyncio.wait(carrying, return_when=asyncio.FIRST_COMPLETED)
        for side in (writer, hub_writer):
            side.transport.abort()
        await asyncio.gather(*carrying)

    server = await asyncio.start_server(serve, "127.0.0.1", 0)
    print(server.sockets[0].getsockname()[1], flush=True)
    await asyncio.to_thread(sys.stdin.read)


async def _carry(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    with suppress(OSError):  # one side is gone
        while data := await reader.read(CHUNK_BYTES):
            writer.write(data)
            await writer.drain()


if __name__ == "__main__":
    _, socket_path, pid = sys.argv
    die_with_parent(int(pid))
    asyncio.run(_main(socket_path))
