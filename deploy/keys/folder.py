"""The folder of an authority: its certificate and key, the register, and a bundle for each name.

    authority/authority.pem, authority.key    the key signs: keep it on one computer
    register.json                             what was issued and revoked
    bundles/NAME/authority.pem, NAME.pem, NAME.key    what the computer of NAME needs

The folder and the bundles have mode 0700, private keys 0600 from their creation. Files are written beside their place,
flushed to the disk and renamed: a crash leaves the old or the new file, never a part. The register is written before
the bundle, so that no certificate exists that it does not know.
"""

import fcntl
import json
import os
import shutil
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from pathlib import Path
from tempfile import mkdtemp

from deploy.keys.register import Register, from_json, to_json
from deploy.stack.errors import DeployError
from wire import foreign
from wire.bundle import AUTHORITY, CERTIFICATE_SUFFIX, KEY_SUFFIX
from wire.host.config import ConfigError, absolute
from wire.ownership import ENTER, make_directory, refusal

ENVIRONMENT = "XDG_CONFIG_HOME"
PRIVATE, PUBLIC = 0o600, 0o644
PRIVATE_DIRECTORY = 0o700


class Folder:
    """The files of an authority. Only `locked` gives one, so that two commands never write at once."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._authority = path / "authority"
        self._register = path / "register.json"

    @property
    def has_authority(self) -> bool:
        return self._authority.exists()

    def authority(self) -> tuple[bytes, bytes]:
        """Return the authority's certificate and key in PEM.

        Raises:
            DeployError: there is no authority, or its files cannot be read.
        """
        if not self.has_authority:
            raise DeployError(f"there is no authority in {self.path}: run `lifeline keys init` first")
        try:
            return (
                foreign.read_text(self._authority / AUTHORITY).encode(),
                foreign.read_text(self._authority / f"authority{KEY_SUFFIX}").encode(),
            )
        except OSError as error:
            raise DeployError(f"cannot read the authority: {error.filename}: {error.strerror}") from error
        except foreign.ForeignError as error:
            raise DeployError(
                f"the authority in {self.path} is damaged: {error}; restore it from a backup, or make a new one with "
                "`lifeline keys init --replace`"
            ) from error

    def put_authority(self, certificate: bytes, key: bytes) -> None:
        """Write a new authority in the place of any earlier one."""
        files = {AUTHORITY: (certificate, PUBLIC), f"authority{KEY_SUFFIX}": (key, PRIVATE)}
        _put_directory(self._authority, files)

    def register(self) -> Register:
        """Return the register; an empty one if there is none.

        Raises:
            DeployError: it cannot be read.
        """
        try:
            return from_json(foreign.from_json(foreign.read_text(self._register)))
        except FileNotFoundError:
            return Register()
        except OSError as error:
            raise DeployError(f"cannot read {self._register}: {error.strerror}") from error
        except ValueError as error:
            raise DeployError(
                f"{self._register} is damaged: restore it from a backup, or make a new authority with "
                "`lifeline keys init --replace`"
            ) from error

    def put_register(self, register: Register) -> None:
        """Write the register."""
        text = json.dumps(to_json(register), indent=2) + "\n"
        temporary = self.path / f".{self._register.name}"
        _put_file(temporary, text.encode(), PRIVATE)
        temporary.replace(self._register)
        _flush(self.path)

    def put_bundle(self, name: str, certificate: bytes, key: bytes) -> Path:
        """Write the bundle of a name in the place of any earlier one, and return its directory."""
        bundles = self.path / "bundles"
        bundles.mkdir(mode=PRIVATE_DIRECTORY, exist_ok=True)
        files = {
            AUTHORITY: (self.authority()[0], PUBLIC),
            f"{name}{CERTIFICATE_SUFFIX}": (certificate, PUBLIC),
            f"{name}{KEY_SUFFIX}": (key, PRIVATE),
        }
        _put_directory(bundles / name, files)
        return bundles / name

    def remove_bundles(self) -> None:
        """Remove all bundles: those of another authority connect to nothing."""
        shutil.rmtree(self.path / "bundles", ignore_errors=True)

    def remove_bundle(self, name: str) -> None:
        """Remove the bundle of a revoked name from this computer."""
        shutil.rmtree(self.path / "bundles" / name, ignore_errors=True)

    def remove_leftovers(self) -> None:
        """Remove what an interrupted command left; the lock proves that no other command runs."""
        for directory in (self.path, self.path / "bundles"):
            for leftover in directory.glob(".*.new-*"):
                shutil.rmtree(leftover, ignore_errors=True)


def default_folder() -> Path:
    """Return `lifeline/keys` in the user's directory for configuration: one authority for all checkouts."""
    config_home = Path(os.environ.get(ENVIRONMENT, ""))
    # The XDG Base Directory Specification: relative paths are ignored.
    return (config_home if config_home.is_absolute() else absolute(Path("~/.config"))) / "lifeline" / "keys"


@contextmanager
def locked(given: Path | None, *, create: bool = False) -> Generator[Folder]:
    """Return the folder while no other command uses it.

    Args:
        given: the directory; None: the default.
        create: whether to create it if it is missing.

    Raises:
        DeployError: it is missing, it cannot be created or written, or others may read it.
    """
    try:
        path = default_folder() if given is None else absolute(given)
        if create:
            make_directory(path)
        elif not path.is_dir():
            raise DeployError(f"there is no folder of keys at {path}: run `lifeline keys init` first")
        with _open_directory(path) as descriptor:
            refused = refusal(path, ENTER)
            if refused is not None:
                raise DeployError(refused)
            fcntl.flock(descriptor, fcntl.LOCK_EX)
            folder = Folder(path)
            folder.remove_leftovers()
            yield folder
    except ConfigError as error:
        raise DeployError(f"{error}, with --keys") from error
    except OSError as error:
        raise DeployError(
            f"cannot use the folder of keys: {error.filename or given}: {error.strerror or error}"
        ) from error


@contextmanager
def _open_directory(path: Path) -> Generator[int]:
    descriptor = os.open(path, os.O_RDONLY | os.O_DIRECTORY)
    try:
        yield descriptor
    finally:
        os.close(descriptor)


def _put_directory(target: Path, files: Mapping[str, tuple[bytes, int]]) -> None:
    """Write files with their modes as a directory, in the place of an earlier one."""
    new = Path(mkdtemp(prefix=f".{target.name}.new-", dir=target.parent))  # has mode 0700
    try:
        for name, (content, mode) in files.items():
            _put_file(new / name, content, mode)
        _flush(new)
        old = new.with_name(f"{new.name}-old")  # a leftover, if a crash follows
        if target.exists():
            target.rename(old)
        new.rename(target)
        _flush(target.parent)
        shutil.rmtree(old, ignore_errors=True)
    except BaseException:
        shutil.rmtree(new, ignore_errors=True)
        raise


def _put_file(path: Path, content: bytes, mode: int) -> None:
    """Write a new file, whose mode is never wider than the given one."""
    path.unlink(missing_ok=True)
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode)
    with os.fdopen(descriptor, "wb") as file:
        file.write(content)
        file.flush()
        os.fsync(descriptor)


def _flush(directory: Path) -> None:
    """Write the entries of a directory to the disk."""
    with _open_directory(directory) as descriptor:
        os.fsync(descriptor)
