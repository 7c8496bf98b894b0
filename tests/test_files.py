"""Files under damage, kills, links, full disks and file systems that can less than others."""

import ast
import contextlib
import errno
import os
import stat
import subprocess
import sys
import time
from pathlib import Path

import pytest

from jrcjax import files

ROOT = Path(__file__).parents[1]


def flipped(content: bytes, bit: int) -> bytes:
    changed = bytearray(content)
    changed[bit // 8] ^= 1 << bit % 8
    return bytes(changed)


def failing(number: int):
    def fails(*args, **kwargs):
        raise OSError(number, os.strerror(number))

    return fails


def test_every_flipped_bit_and_every_lost_byte_is_seen(tmp_path):
    content, path = bytes(range(40)), tmp_path / "file"
    path.write_bytes(files.sealed(content))
    assert files.unsealed(path) == content
    whole = path.read_bytes()
    for changed in [flipped(whole, i) for i in range(8 * len(whole))] + [whole[:n] for n in range(len(whole))]:
        path.write_bytes(changed)
        with pytest.raises(files.DamagedFile):
            files.unsealed(path)


@pytest.mark.parametrize("number", [errno.EINVAL, errno.EOPNOTSUPP, errno.ENOSYS])
def test_a_file_system_that_cannot_sync_takes_files_all_the_same(number, tmp_path, monkeypatch):
    monkeypatch.setattr(files.os, "fsync", failing(number))
    files.write_whole(tmp_path / "file", b"content")
    assert (tmp_path / "file").read_bytes() == b"content"
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_what_has_its_name_is_not_said_to_be_missing(tmp_path, monkeypatch):
    """The folder's own sync fails, after the file has its name."""
    synced = os.fsync
    monkeypatch.setattr(
        files.os,
        "fsync",
        lambda handle: (failing(errno.EIO) if stat.S_ISDIR(os.fstat(handle).st_mode) else synced)(handle),
    )
    files.write_whole(tmp_path / "file", b"content")
    assert (tmp_path / "file").read_bytes() == b"content"


def test_a_full_disk_leaves_what_was_there(tmp_path, monkeypatch):
    path = tmp_path / "file"
    path.write_bytes(b"old")
    monkeypatch.setattr(files.os, "fsync", failing(errno.ENOSPC))
    with pytest.raises(OSError, match=r"No space left on device: .*file was not written") as error:
        files.write_whole(path, b"new")
    assert error.value.errno == errno.ENOSPC
    assert path.read_bytes() == b"old"
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_a_mode_that_cannot_be_set_is_no_reason_to_lose_a_file(tmp_path, monkeypatch):
    monkeypatch.setattr(files.os, "chmod", failing(errno.EPERM))
    monkeypatch.setattr(files.os, "fchmod", failing(errno.EPERM))
    files.write_whole(tmp_path / "file", b"content")


@pytest.mark.parametrize("umask", [0o077, 0o027, 0o002])
def test_the_users_umask_decides_who_may_read(umask, tmp_path):
    before = os.umask(umask)
    try:
        files.write_whole(tmp_path / "file", b"content")
        with files.locked(tmp_path):
            pass
    finally:
        os.umask(before)
    for name in ("file", ".lock"):
        assert stat.S_IMODE((tmp_path / name).stat().st_mode) == 0o666 & ~umask


def test_a_link_in_the_place_of_a_file_is_replaced_and_its_target_left(tmp_path):
    target, folder = tmp_path / "precious", tmp_path / "folder"
    target.write_bytes(b"precious")
    folder.mkdir()
    (folder / "file").symlink_to(target)
    files.write_whole(folder / "file", b"content")
    assert (target.read_bytes(), (folder / "file").read_bytes()) == (b"precious", b"content")
    assert not (folder / "file").is_symlink()


@pytest.mark.parametrize("kind", ["link", "hard link", "dangling", "pipe", "folder"])
def test_a_lock_is_a_file_of_its_own_folder(kind, tmp_path, capsys):
    target, folder = tmp_path / "precious", tmp_path / "folder"
    target.write_bytes(b"precious")
    folder.mkdir()
    lock = folder / ".lock"
    make = {
        "link": lambda: lock.symlink_to(target),
        "hard link": lambda: lock.hardlink_to(target),
        "dangling": lambda: lock.symlink_to(tmp_path / "new"),
        "pipe": lambda: os.mkfifo(lock),
        "folder": lock.mkdir,
    }
    make[kind]()
    with files.locked(folder):
        assert lock.read_text().startswith(f"process {os.getpid()} on ")
    assert target.read_bytes() == b"precious"
    assert not (tmp_path / "new").exists()
    assert f"{lock} is set aside as .lock.damaged" in capsys.readouterr().err


def test_a_file_system_without_locks_is_named_with_the_way_out(tmp_path, monkeypatch):
    monkeypatch.setattr(files.fcntl, "flock", failing(errno.ENOLCK))
    allowed = r"folder is on a file system without locks \(No locks available\); choose an --out on another one"
    with pytest.raises(OSError, match=allowed), files.locked(tmp_path / "folder"):
        pass
    files.write_whole(tmp_path / "file", b"content")  # needs none
    assert (tmp_path / "file").read_bytes() == b"content"


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (lambda path: os.mkfifo(path), "a named pipe"),
        (lambda path: path.symlink_to(path.with_name("absent")), "a link to nowhere"),
        (lambda path: path.symlink_to(path), "a link that leads to itself"),
        (lambda path: path.mkdir(), "a folder"),
    ],
)
def test_what_is_no_file_is_named_and_set_aside(make, reason, tmp_path, capsys):
    path = tmp_path / "file"
    make(path)
    with pytest.raises(files.DamagedFile, match=f"it is {reason}") as error:
        files.unsealed(path)
    files.set_aside(path, error.value)
    assert f"{path} is set aside as file.damaged: it is {reason}" in capsys.readouterr().err
    make(path)
    files.set_aside(path, error.value)  # and keeps what was set aside before, links to nowhere included
    assert sorted(os.listdir(tmp_path)) == ["file.damaged", "file.damaged-2"]


# Children that write load this module alone, which takes no time.
_FILES = f"""
import importlib.util, pathlib, sys, time
spec = importlib.util.spec_from_file_location("files", {str(ROOT / "jrcjax" / "files.py")!r})
files = importlib.util.module_from_spec(spec)
spec.loader.exec_module(files)
path = pathlib.Path(sys.argv[1])
"""
_WRITES_SLOWLY = "files.os.fsync = lambda handle: time.sleep(60)\nfiles.write_whole(path, b'content')"
_LOCKS = "with files.locked(path): time.sleep(60)"


@contextlib.contextmanager
def child(code: str, path: Path, ready):
    """A process that runs `code`, once `ready` says that it came so far."""
    with subprocess.Popen([sys.executable, "-c", _FILES + code, str(path)]) as process:
        try:
            while not ready():
                assert process.poll() is None
                time.sleep(0.01)
            yield process
        finally:
            process.kill()


def test_a_killed_writers_temporary_file_is_removed_and_a_living_ones_kept(tmp_path):
    path, theirs = tmp_path / "file", tmp_path / ".theirs.tmp"
    theirs.write_bytes(b"another program's")
    ready = lambda: any(left.stat().st_size for left in tmp_path.glob(".jrcjax-*.tmp"))  # noqa: E731
    with child(_WRITES_SLOWLY, path, ready):
        files.write_whole(tmp_path / "other", b"meanwhile")
        assert ready()
    assert not path.exists()
    assert len(list(tmp_path.glob(".jrcjax-*.tmp"))) == 1
    files.write_whole(tmp_path / "other", b"afterwards")
    assert sorted(os.listdir(tmp_path)) == [".theirs.tmp", "other"]


def test_a_killed_process_leaves_neither_lock_nor_temporary_files(tmp_path):
    lock = tmp_path / ".lock"
    with child(_LOCKS, tmp_path, lambda: lock.exists() and lock.read_text()) as process:
        with pytest.raises(files.FolderInUse, match=f"process {process.pid} on "), files.locked(tmp_path):
            pass
        (tmp_path / ".jrcjax-left.tmp").write_bytes(b"half")
    with files.locked(tmp_path):
        assert not (tmp_path / ".jrcjax-left.tmp").exists()


def calls_of(path: Path):
    """(name of the function or method, its call) for every call in a file."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call):
            yield getattr(node.func, "attr", getattr(node.func, "id", "")), node


def test_every_text_is_utf_8_by_name_and_every_output_written_aside():
    """Whatever the locale, and whenever the process is killed."""
    packages = [ROOT / name for name in ("jrcjax", "sweeps", "paper_figs", "benchmarks", "explorer")]
    found = []
    for path in (path for package in packages for path in package.rglob("*.py")):
        for name, call in calls_of(path):
            where, keywords = f"{path.relative_to(ROOT)}:{call.lineno}: {name}", [k.arg for k in call.keywords]
            if name in ("read_text", "fdopen", "open") and "encoding" not in keywords:
                binary = any(isinstance(a, ast.Constant) and "b" in str(a.value) for a in call.args)
                found += [] if binary or ast.unparse(call.func) in ("os.open", "webbrowser.open") else [where]
            if name in ("write_bytes", "savetxt") or (name == "write_text" and isinstance(call.func, ast.Attribute)):
                found += [] if ast.unparse(call.func) == "files.write_text" else [where]
            if name == "savefig" and "format" not in keywords and ast.unparse(call.func) != "pages.savefig":
                found.append(where)  # into memory, so that the format has to be told
            if name == "to_csv" and call.args:
                found.append(where)
    assert found == []
