"""The sentence of the stop-time passport of the robot that a station's page shows."""

import hashlib
from pathlib import Path

from deploy.keys.signatures import SignatureError
from deploy.stack.errors import DeployError
from deploy.stack.launch import ANY_BASE, Launch
from passport.reading import check
from wire.text import printable


def sentence_of(launch: Launch, file: Path, authority: Path | None) -> str:
    """Return the first sentence of a passport that is signed and was measured with this robot's configuration.

    Args:
        launch: the robot.
        file: the page of the passport.
        authority: a directory or file with the certificate of the authority that is trusted; None: the robot's bundle.

    Raises:
        DeployError: the passport cannot be verified, or was measured with another configuration.
    """
    authority = authority or launch.bus.keys
    if authority is None:
        raise DeployError(
            "--passport needs the authority that signed it: name its certificate with --authority"
        )
    if ANY_BASE in launch.nodes:
        raise DeployError("--passport needs the robot's configuration: name it with --config")
    try:
        found = check(file, authority)
    except SignatureError as error:
        raise DeployError(f"{file} {error}") from error
    try:
        configuration = launch.config.read_bytes()
    except OSError as error:
        raise DeployError(f"cannot read {launch.config}: {error.strerror}") from error
    if found.configuration_sha256 != hashlib.sha256(configuration).hexdigest():
        raise DeployError(
            f"{file} was measured with another configuration than {launch.config}: measure this robot again"
        )
    return printable(found.shows)
