"""Files that survive a crash: written whole or not at all, checked when read, set aside and never deleted in doubt."""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import os
import socket
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

_TEMPORARY = ".tmp"
_LOCK = ".lock"
_MARK = b"\nsha256 "
_TRAILER = len(_MARK) + 64


class DamagedFile(Exception):
    """A file is not what was written, with the reason."""


class FolderInUse(OSError):
    """Another process writes to a folder."""


def write_whole(path: Path, content: bytes) -> None:
    """Writes a file under a temporary name, syncs it, gives it its name, and syncs the folder.

    Raises:
      OSError: naming the file, for instance when the disk is full; the folder is then as it was.
    """
    try:
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=".", suffix=_TEMPORARY)
    except OSError as error:
        raise _explained(error, path) from error
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        Path(temporary).chmod(0o644)
        Path(temporary).replace(path)
        _sync_folder(path.parent)
    except BaseException as error:
        Path(temporary).unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise _explained(error, path) from error
        raise


def _explained(error: OSError, path: Path) -> OSError:
    return OSError(error.errno, f"{error.strerror or error}: {path} was not written; the other files are whole")


def _sync_folder(folder: Path) -> None:
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def sealed(content: bytes) -> bytes:
    """A content with its checksum behind it, where readers of netCDF files do not look."""
    return content + _MARK + hashlib.sha256(content).hexdigest().encode()


def unsealed(path: Path) -> bytes:
    """The content of a sealed file.

    Raises:
      DamagedFile: if a single bit is not as it was written.
    """
    try:
        whole = path.read_bytes()
    except IsADirectoryError:
        raise DamagedFile("it is a folder") from None
    content = whole[:-_TRAILER]
    if whole[-_TRAILER:][: len(_MARK)] != _MARK:
        raise DamagedFile("it has no checksum at its end")
    if whole != sealed(content):
        raise DamagedFile("its checksum does not fit its content")
    return content


def set_aside(path: Path, reason: object) -> None:
    """Renames a file to `*.damaged`, so that nobody reads it, and says so on stderr."""
    number, aside = 1, path.with_name(f"{path.name}.damaged")
    while aside.exists():
        number += 1
        aside = path.with_name(f"{path.name}.damaged-{number}")
    try:
        path.rename(aside)
    except FileNotFoundError:  # another process was faster
        return
    except OSError as error:  # a folder that may only be read
        print(f"warning: {path} is left out: {reason} (and can't be renamed: {error.strerror})", file=sys.stderr)
        return
    print(f"warning: {path} is set aside as {aside.name}: {reason}", file=sys.stderr)


@contextlib.contextmanager
def locked(folder: Path, waiting: Callable[[str], None] | None = None) -> Iterator[None]:
    """Keeps other processes from writing to a folder, which it makes if need be, and clears what killed ones left.

    The system frees the lock however the process ends.

    Args:
      folder: what to lock.
      waiting: told who holds the lock while it is waited for; without it nobody waits.

    Raises:
      FolderInUse: if another process holds the lock and there is no `waiting`.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / _LOCK).open("a+") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            file.seek(0)
            held = f"{folder}: {file.read() or 'another process'} is writing here"
            if waiting is None:
                raise FolderInUse(f"{held}; wait until it has ended, or choose another --out") from None
            waiting(held)
            fcntl.flock(file, fcntl.LOCK_EX)
        file.truncate(0)
        file.write(f"process {os.getpid()} on {socket.gethostname()}")
        file.flush()
        for left in folder.glob(f".*{_TEMPORARY}"):
            left.unlink(missing_ok=True)
        yield
