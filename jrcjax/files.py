"""Files that survive a crash: written whole or not at all, checked when read, set aside and never deleted in doubt.

Nothing here follows a link that stands in the place of a file to be written: the link itself is replaced.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import os
import secrets
import socket
import stat
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

try:
    import fcntl
except ModuleNotFoundError:
    raise ImportError("jrcjax runs on Linux and macOS; on Windows it runs under WSL") from None

_BEFORE, _AFTER = ".jrcjax-", ".tmp"  # around the names of temporary files
_LOCK = ".lock"
_MARK = b"\nsha256 "
_TRAILER = len(_MARK) + 64
_NO_LOCKS = (errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS, errno.EINVAL)
_NO_SYNC = (errno.EINVAL, errno.EOPNOTSUPP, errno.ENOSYS)


class DamagedFile(Exception):
    """A file is not what was written, with the reason."""


class FolderInUse(OSError):
    """Another process writes to a folder."""


def write_whole(path: Path, content: bytes) -> None:
    """Writes a file under a temporary name, syncs it and gives it its name.

    The user's umask decides who may read it. Temporary files of writers that were killed in this folder are removed.

    Raises:
      OSError: naming the file, for instance when the disk is full; the folder is then as it was.
    """
    try:
        _remove_what_killed_writers_left(path.parent)
        temporary, handle = _new_temporary(path.parent)
    except OSError as error:
        raise _explained(error, path) from error
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
            file.flush()
            _sync(handle)
            temporary.replace(path)
    except BaseException as error:
        temporary.unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise _explained(error, path) from error
        raise
    with contextlib.suppress(OSError):  # the file has its name; not every file system can sync a folder
        _sync_folder(path.parent)


def write_text(path: Path, text: str) -> Path:
    """`write_whole` for a text in UTF-8, whatever the user's locale is; returns the path."""
    write_whole(path, text.encode())
    return path


def _explained(error: OSError, path: Path) -> OSError:
    return OSError(error.errno, f"{error.strerror or error}: {path} was not written; the other files are whole")


def _new_temporary(folder: Path) -> tuple[Path, int]:
    """A new file and its handle, which holds a lock as long as its writer lives."""
    while True:
        path = folder / f"{_BEFORE}{secrets.token_hex(8)}{_AFTER}"
        handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o666)
        with contextlib.suppress(OSError):  # where there are no locks, nobody takes the file for one that was left
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if path.exists():
            return path, handle
        os.close(handle)  # taken for one that was left, before it had its lock


def _remove_what_killed_writers_left(folder: Path) -> None:
    """Removes temporary files whose writers, on any machine, are no more."""
    for left in folder.glob(f"{_BEFORE}*{_AFTER}"):
        with contextlib.suppress(OSError):
            handle = os.open(left, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                left.unlink(missing_ok=True)
            finally:
                os.close(handle)


def _sync(handle: int) -> None:
    """Waits until a file is on its disk, where the file system knows how."""
    try:
        os.fsync(handle)
    except OSError as error:
        if error.errno not in _NO_SYNC:
            raise


def _sync_folder(folder: Path) -> None:
    handle = os.open(folder, os.O_RDONLY | os.O_CLOEXEC)
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
    whole = content_of(path)
    content = whole[:-_TRAILER]
    if whole[-_TRAILER:][: len(_MARK)] != _MARK:
        raise DamagedFile("it has no checksum at its end")
    if whole != sealed(content):
        raise DamagedFile("its checksum does not fit its content")
    return content


def content_of(path: Path) -> bytes:
    """The bytes of a file.

    Raises:
      DamagedFile: if there is a folder, a named pipe, a link to nowhere or anything else in its place.
      FileNotFoundError: if there is nothing.
    """
    status_of(path)
    return path.read_bytes()


def status_of(path: Path) -> os.stat_result:
    """Size, time and number of a file; raises what `content_of` raises."""
    path.lstat()
    try:
        status = path.stat()
    except (FileNotFoundError, RuntimeError):
        raise DamagedFile("it is a link to nowhere") from None
    except OSError as error:
        if error.errno != errno.ELOOP:
            raise
        raise DamagedFile("it is a link that leads to itself") from None
    if stat.S_ISDIR(status.st_mode):
        raise DamagedFile("it is a folder")
    if not stat.S_ISREG(status.st_mode):
        raise DamagedFile("it is a named pipe, a socket or a device, and no file")
    return status


def set_aside(path: Path, reason: object) -> None:
    """Renames a file to `*.damaged`, so that nobody reads it, and says so on stderr."""
    number, aside = 1, path.with_name(f"{path.name}.damaged")
    while os.path.lexists(aside):
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
      OSError: naming the folder, if it can't be made, or its file system has no locks.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with _lock_file(folder) as file:
        try:
            _lock(file.fileno(), folder, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            held = f"{folder}: {file.read() or 'another process'} is writing here"
            if waiting is None:
                raise FolderInUse(f"{held}; wait until it has ended, or choose another --out") from None
            waiting(held)
            _lock(file.fileno(), folder, fcntl.LOCK_EX)
        file.seek(0)
        file.truncate()
        file.write(f"process {os.getpid()} on {socket.gethostname()}")
        file.flush()
        _remove_what_killed_writers_left(folder)
        yield


def _lock_file(folder: Path):
    """The open file whose lock is the folder's; what is no file of this folder alone is set aside."""
    path = folder / _LOCK
    with contextlib.suppress(FileNotFoundError):
        status = path.lstat()
        if not stat.S_ISREG(status.st_mode) or status.st_nlink > 1:
            set_aside(path, "it is no file, or another folder's, too")
    handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC, 0o666)
    return os.fdopen(handle, "r+", encoding="utf-8", errors="replace")


def _lock(handle: int, folder: Path, operation: int) -> None:
    try:
        fcntl.flock(handle, operation)
    except OSError as error:
        if error.errno not in _NO_LOCKS:
            raise
        text = f"{folder} is on a file system without locks ({error.strerror}); choose an --out on another one"
        raise OSError(error.errno, text) from error
