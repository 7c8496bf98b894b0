"""Banks that come with the package are those that its code draws, and are taken by nobody whose code draws others."""

import jax
import numpy as np
import pytest

import jrcjax
from jrcjax import numerics
from jrcjax.radar import bank, stored

ENVIRONMENTS = ("source", "target")


@pytest.fixture
def other_file(tmp_path, monkeypatch):
    """Where banks are looked for instead of the package's file."""
    path = tmp_path / "banks.npz"
    monkeypatch.setattr(stored, "FILE", path)
    stored._banks.cache_clear()
    yield path
    stored._banks.cache_clear()


def of_paper(environment):
    radar = jrcjax.paper_params(environment).radar
    return radar.modes, radar.bank_seed, radar.bank_size


@pytest.mark.parametrize("environment", ENVIRONMENTS)
def test_stored_banks_are_those_that_are_drawn(environment):
    made_from = of_paper(environment)
    found = stored.stored(bank.content_of(*made_from))
    if found is None:
        pytest.skip(f"none is stored for {stored._VERSIONS}")
    drawn = np.asarray(bank.draw(*made_from))
    # Another processor rounds otherwise, which counts where a distance is the range resolution to the last bit.
    assert (found != drawn).mean() < 1e-3
    np.testing.assert_allclose(found, drawn, atol=2 / 27)


def test_a_checkout_has_those_of_its_own_source():
    with np.load(stored.FILE) as file:
        assert len(file.files) == len(ENVIRONMENTS)
    missing = [name for name in ENVIRONMENTS if stored.stored(bank.content_of(*of_paper(name))) is None]
    assert not missing or locked() != stored._VERSIONS, "make banks"


def locked():
    """Versions in requirements.lock."""
    lines = (stored.FILE.parents[2] / "requirements.lock").read_text(encoding="utf-8").splitlines()
    pinned = dict(line.split()[0].split("==") for line in lines if "==" in line.split(";")[0])
    return {name: pinned[name] for name in stored._VERSIONS}


def test_whoever_changes_what_draws_gets_other_banks(monkeypatch):
    content = bank.content_of(*of_paper("target"))
    before = stored.name_of(content)
    assert before == stored.name_of(bank.content_of(*of_paper("target")))
    changed = {before, stored.name_of(bank.content_of(*of_paper("source")))}
    with monkeypatch.context() as patch:
        patch.setitem(numerics.PINNED, "jax_some_setting", 3)
        changed.add(stored.name_of(content))
    with monkeypatch.context() as patch:
        patch.setattr(stored, "_CODE", "changed")
        changed.add(stored.name_of(content))
    with monkeypatch.context() as patch:
        patch.setattr(stored, "_VERSIONS", stored._VERSIONS | {"jax": "99"})
        patch.setattr(stored, "_CODE", stored.code())
        changed.add(stored.name_of(content))
    with monkeypatch.context() as patch:
        patch.setattr(stored, "_SOURCE", [path.with_suffix(".none") for path in stored._SOURCE])
        patch.setattr(stored, "_CODE", stored.code())
        changed.add(stored.name_of(content))
    assert len(changed) == 6
    assert "detection.py" in {path.name for path in stored._SOURCE}


@pytest.mark.parametrize("content", [None, b"", b"no archive", b"PK\x05\x06 cut"])
def test_without_a_whole_file_banks_are_drawn(content, other_file, tmp_path):
    if content is not None:
        other_file.write_bytes(content)
    modes, seed, _ = of_paper("target")
    np.testing.assert_array_equal(bank.bank_of(modes, seed, 48), bank.draw(modes, seed, 48))


def test_a_stored_bank_is_taken(other_file, monkeypatch):
    modes, seed, _ = of_paper("target")
    numbers = np.full((2, 40), 0.5, np.float32)
    np.savez(other_file, **{stored.name_of(bank.content_of(modes, seed, 40)): numbers})
    monkeypatch.setattr(bank, "draw", lambda *args: pytest.fail("it was drawn"))
    np.testing.assert_array_equal(jax.jit(lambda: bank.bank_of(modes, seed, 40))(), numbers)
