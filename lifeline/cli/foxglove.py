"""The definition of `lifeline foxglove`. It imports its module only when it runs."""

from typing import Annotated

import typer

from lifeline.command import Config, Endpoint, KeysPath, StatePath, exit_with, running


def foxglove(
    *,
    listen: Annotated[
        str,
        typer.Option(
            "--listen",
            metavar="HOST:PORT",
            help="Address to serve WebSockets on; port 0 chooses a free one.",
        ),
    ] = "127.0.0.1:8765",
    config: Config = None,
    endpoint: Endpoint = None,
    keys_dir: KeysPath = None,
    state_dir: StatePath = None,
) -> None:
    """Serve all messages, frames and safety distances to Foxglove, read-only, until Ctrl-C."""

    def run() -> int:
        from lifeline.foxglove import foxglove as serve  # noqa: PLC0415

        serve(running(config, endpoint, state_dir, keys_dir), listen)

    exit_with(run)
