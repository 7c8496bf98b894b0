"""What is kept on disk is what would be made, whatever happens to its file."""

import subprocess
import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jrcjax
from jrcjax import kept as module
from jrcjax.kept import kept
from jrcjax.radar import bank

NUMBERS = np.linspace(0.0, 1.0, 12, dtype=np.float32).reshape(3, 4)


@pytest.fixture
def folder(tmp_path):
    """A folder of compiled programs in which nothing is yet."""
    jnp.asarray(NUMBERS)  # compiles, which no test may be the first to do in a folder that can't be
    before = jax.config.jax_compilation_cache_dir  # pyright: ignore[reportAttributeAccessIssue]
    jax.config.update("jax_compilation_cache_dir", str(tmp_path / "programs"))
    yield tmp_path / "programs"
    jax.config.update("jax_compilation_cache_dir", before)


def made(calls):
    def make():
        calls.append(1)
        return jnp.asarray(NUMBERS)

    return make


def test_numbers_are_made_once_for_the_same_content(folder):
    calls = []
    for _ in range(3):
        np.testing.assert_array_equal(kept("numbers", ("a", b"1"), made(calls)), NUMBERS)
    assert len(calls) == 1
    kept("numbers", ("a", b"2"), made(calls))
    assert len(calls) == 2
    assert len(list((folder / "numbers").iterdir())) == 2


@pytest.mark.parametrize("change", ["code", "settings"])
def test_other_code_and_other_settings_make_them_anew(folder, change, monkeypatch):
    calls = []
    kept("numbers", "a", made(calls))
    if change == "code":
        monkeypatch.setattr(module, "_code", lambda: "another version of the package")
    else:
        monkeypatch.setitem(module.numerics.PINNED, "jax_some_setting", 3)
    kept("numbers", "a", made(calls))
    assert len(calls) == 2


def test_the_source_of_the_package_is_part_of_what_decides(tmp_path):
    (tmp_path / "draw.py").write_text("one = 1\n")
    one = module.source_of(tmp_path.rglob("*.py"))
    assert one == module.source_of(tmp_path.rglob("*.py"))
    (tmp_path / "draw.py").write_text("one = 2\n")
    assert one != module.source_of(tmp_path.rglob("*.py"))
    assert module._SOURCE in module._code()


def test_a_whole_file_of_other_numbers_is_not_taken(folder):
    calls = []
    kept("numbers", "a", made(calls))
    (first,) = (folder / "numbers").iterdir()
    kept("numbers", "b", made(calls))
    (second,) = {*(folder / "numbers").iterdir()} - {first}
    first.write_bytes(second.read_bytes())
    kept("numbers", "a", made(calls))
    assert len(calls) == 3


def test_who_keeps_no_programs_keeps_nothing_else(folder):
    jax.config.update("jax_enable_compilation_cache", False)
    try:
        kept("numbers", "a", made([]))
    finally:
        jax.config.update("jax_enable_compilation_cache", True)
    assert not folder.exists()


@pytest.mark.parametrize("damage", ["flipped", "cut", "empty", "folder", "array"])
def test_a_damaged_file_is_made_anew(folder, damage):
    calls = []
    kept("numbers", "a", made(calls))
    (file,) = (folder / "numbers").iterdir()
    content = bytearray(file.read_bytes())
    file.unlink()
    if damage == "folder":
        file.mkdir()
    elif damage == "array":
        file.write_bytes(module.files.sealed(b"no array"))
    else:
        content[-80] ^= 1
        file.write_bytes({"flipped": content, "cut": content[:50], "empty": b""}[damage])
    for _ in range(2):
        np.testing.assert_array_equal(kept("numbers", "a", made(calls)), NUMBERS)
    assert len(calls) == (3 if damage == "folder" else 2)  # nothing is kept where a folder lies


@pytest.mark.parametrize("where", [None, "gs://bucket/programs", "file"])
def test_nothing_is_kept_where_nothing_can_be(folder, where, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").touch()
    jax.config.update("jax_compilation_cache_dir", where and (where if ":" in where else str(tmp_path / where)))
    calls = []
    for _ in range(2):
        np.testing.assert_array_equal(kept("numbers", "a", made(calls)), NUMBERS)
    assert len(calls) == 2
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_a_kept_bank_is_the_drawn_one_also_in_a_trace(folder, monkeypatch):
    modes, seed = jrcjax.paper_params("source").radar.modes, jnp.int32(11)

    def found():
        bank._known_bank.cache_clear()
        return bank.bank_of(modes, seed, 48)

    drawn = found()
    monkeypatch.setattr(bank, "draw", lambda *args: pytest.fail("it was drawn again"))
    np.testing.assert_array_equal(found(), drawn)
    bank._known_bank.cache_clear()
    scaled = jax.jit(lambda factor: factor * bank.bank_of(modes, seed, 48))(2.0)
    np.testing.assert_array_equal(scaled, 2.0 * drawn)
    np.testing.assert_array_equal(bank.bank_of(modes, seed, 48), drawn)  # numbers, no leaked tracer


@pytest.mark.parametrize("seed", [0, 1])  # seed 0 is what comes with the package
def test_a_second_process_draws_nothing(seed, tmp_path):
    code = f"""
from jrcjax.training import parallel
parallel.start()
import sys, hashlib, numpy as np, jrcjax
bank = np.asarray(jrcjax.paper_params("target").radar.replace(bank_seed={seed}).miss_bank)
print(hashlib.sha256(bank.tobytes()).hexdigest(), "distrax" in sys.modules)
"""
    environment = {"XDG_CACHE_HOME": str(tmp_path), "PATH": "", "HOME": str(tmp_path)}
    root = Path(__file__).parents[1]
    first, second = (
        subprocess.run(
            [sys.executable, "-c", code], cwd=root, env=environment, capture_output=True, text=True, check=True
        ).stdout.split()
        for _ in range(2)
    )
    assert first == [second[0], "True" if seed else "False"]
    assert second[1] == "False"
