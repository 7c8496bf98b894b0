"""Results on disk under damage, kills, full disks and two runs at once: nothing lost, nothing silent."""

import errno
import functools
import json
import os
import shlex
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import jax
import numpy as np
import pytest
from rich.console import Console

from jrcjax import files
from sweeps import interrupts
from sweeps.__main__ import main
from sweeps.design import along
from sweeps.engine import run
from sweeps.engine.block import compute
from sweeps.engine.job import Job
from sweeps.engine.run import run_sweep
from sweeps.engine.sources import sources_of
from sweeps.engine.verify import made_elsewhere, sample_of, verify
from sweeps.results import parts, store
from sweeps.results.configuration import digest_of
from sweeps.studies.registry import EVERY_SWEEP, STUDIES, SWEEPS
from sweeps.studies.source import SOURCE
from sweeps.sweep import Size, Study

ROOT = Path(__file__).parents[2]
QUIET = Console(quiet=True)
CHEAP = replace(SWEEPS["fig5a"], name="cheap", learners=("round_robin",))
SIZE = Size(seeds=3, episodes=1)


@pytest.fixture(scope="module")
def untouched(tmp_path_factory):
    """Results of a run that nothing happened to."""
    return run_sweep(CHEAP, SIZE, tmp_path_factory.mktemp("untouched"), QUIET, resume=False)


@pytest.fixture
def folder(untouched, tmp_path):
    """A copy to damage."""
    copy = tmp_path / untouched.name
    copy.mkdir()
    for path in untouched.iterdir():
        (copy / path.name).write_bytes(path.read_bytes())
    return copy


def digests(folder: Path) -> dict[str, str]:
    return {part.path.name: part.digest for part in parts.parts_of(folder)}


def flipped(content: bytes, bit: int) -> bytes:
    changed = bytearray(content)
    changed[bit // 8] ^= 1 << bit % 8
    return bytes(changed)


DAMAGE = {
    "torn": lambda content, data: content[: len(content) // 2],
    "empty": lambda content, data: b"",
    "a flipped bit": lambda content, data: flipped(content, 8 * len(content) // 3),
    "without checksum": lambda content, data: bytes(data.to_netcdf(engine="h5netcdf")),
    "text": lambda content, data: b"no netCDF at all\n",
    "sealed text": lambda content, data: files.sealed(b"no netCDF at all\n"),
    "no results": lambda content, data: files.sealed(bytes(data[["reward"]].drop_attrs().to_netcdf(engine="h5netcdf"))),
}


@pytest.mark.parametrize("kind", DAMAGE)
def test_a_damaged_part_is_named_set_aside_and_computed_again(kind, folder, untouched, capsys):
    part = store.part_path(folder, range(3))
    damaged = DAMAGE[kind](part.read_bytes(), parts.read_part(part))
    part.write_bytes(damaged)
    with pytest.raises(FileNotFoundError, match="no results for seeds 0 to 2"):
        store.load(folder, 3)
    assert f"warning: {part} is set aside as {part.name}.damaged: it" in capsys.readouterr().err
    assert part.with_name(f"{part.name}.damaged").read_bytes() == damaged
    run_sweep(CHEAP, SIZE, folder.parent, QUIET, resume=True)
    assert digests(folder) == digests(untouched)


def test_a_part_under_the_name_of_other_seeds_is_set_aside(folder, untouched, capsys):
    store.part_path(folder, range(3)).rename(store.part_path(folder, range(5, 8)))
    run_sweep(CHEAP, SIZE, folder.parent, QUIET, resume=True)
    assert "seeds-000005-000007.nc.damaged: it holds seeds 0 to 2" in capsys.readouterr().err
    assert digests(folder) == digests(untouched)


def test_a_part_of_another_sweep_is_set_aside(folder, untouched, capsys):
    other = run_sweep(replace(CHEAP, name="other"), SIZE, folder.parent, QUIET, resume=False)
    part = store.part_path(folder, range(3))
    part.write_bytes(store.part_path(other, range(3)).read_bytes())
    run_sweep(CHEAP, SIZE, folder.parent, QUIET, resume=True)
    assert f"{part.name}.damaged: it is of the sweep 'other'" in capsys.readouterr().err
    assert digests(folder) == digests(untouched)


def test_a_folder_in_the_place_of_a_part_is_set_aside(folder, untouched):
    part = store.part_path(folder, range(3))
    part.unlink()
    part.mkdir()
    run_sweep(CHEAP, SIZE, folder.parent, QUIET, resume=True)
    assert digests(folder) == digests(untouched)


def test_what_was_set_aside_before_is_kept(folder):
    part = store.part_path(folder, range(3))
    for content in (b"first", b"second"):
        part.write_bytes(content)
        assert parts.parts_of(folder) == []
    assert part.with_name(f"{part.name}.damaged").read_bytes() == b"first"
    assert part.with_name(f"{part.name}.damaged-2").read_bytes() == b"second"


def test_seeds_in_two_parts_count_once(folder, tmp_path):
    again = run_sweep(CHEAP, Size(seeds=2, episodes=1), tmp_path / "elsewhere", QUIET, resume=False)
    (folder / "seeds-000000-000001.nc").write_bytes(store.part_path(again, range(2)).read_bytes())
    assert list(store.load(folder, 3)["seed"].values) == [0, 1, 2]


def test_parts_of_two_configurations_are_not_joined(folder, tmp_path):
    other = run_sweep(CHEAP, replace(SIZE, seeds=5, preset="paper_table"), tmp_path / "elsewhere", QUIET, resume=False)
    whole = parts.read_part(store.part_path(other, range(5)))
    store.write_part(folder, range(3, 5), whole.isel(seed=slice(3, 5)))
    with pytest.raises(store.ConfigurationMismatch, match='preset: "paper_table" there, "paper" wanted'):
        store.load(folder, 5)


def test_the_manifest_is_made_from_the_parts(folder):
    path = folder / store.MANIFEST
    manifest = json.loads(path.read_text())
    assert manifest["parts"] == digests(folder)
    for lost in (None, b'{"half'):
        path.unlink() if lost is None else path.write_bytes(lost)
        run_sweep(CHEAP, SIZE, folder.parent, QUIET, resume=True)
        assert json.loads(path.read_text()) == manifest


def test_the_manifest_says_where_all_parts_come_from(folder):
    part = store.part_path(folder, range(3))
    data = parts.read_part(part)
    provenance = json.loads(data.attrs["provenance"])
    other = provenance | {"git_commit": "0" * 40, "versions": provenance["versions"] | {"jax": "0.0"}}
    store.write_part(folder, range(3, 6), data.assign_coords(seed=[3, 4, 5]).assign_attrs(provenance=json.dumps(other)))
    store.write_manifest(folder)
    manifest = json.loads((folder / store.MANIFEST).read_text())
    assert manifest["git_commit"] == [provenance["git_commit"], "0" * 40]
    assert [versions["jax"] for versions in manifest["versions"]] == [provenance["versions"]["jax"], "0.0"]
    assert manifest["machine"] == provenance["machine"]


def test_a_digest_is_that_of_the_content(folder, capsys):
    """A part that claims the digest of another one is no part."""
    part = store.part_path(folder, range(3))
    data = parts.read_part(part)
    data["reward"][0, 0, 0, 0] += 1
    part.write_bytes(files.sealed(bytes(data.to_netcdf(engine="h5netcdf"))))
    assert parts.parts_of(folder) == []
    assert (
        "set aside as seeds-000000-000002.nc.damaged: its digest is not that of its content" in capsys.readouterr().err
    )


@pytest.mark.parametrize(
    ("setting", "value"),
    [
        ("jax_threefry_partitionable", False),
        ("jax_default_prng_impl", "rbg"),
        ("jax_enable_x64", True),
        ("jax_default_matmul_precision", "bfloat16"),
    ],
)
def test_a_run_under_another_setting_of_jax_is_not_continued(setting, value, folder, untouched):
    before = getattr(jax.config, setting)
    jax.config.update(setting, value)
    try:
        field = setting.removeprefix("jax_")
        with pytest.raises(store.ConfigurationMismatch, match=rf"numerics\.{field}: .* there, .* wanted"):
            run_sweep(CHEAP, replace(SIZE, seeds=4), folder.parent, QUIET, resume=True)
        with pytest.raises(store.ConfigurationMismatch, match=rf"numerics\.{field}: "):
            list(verify(folder, None, {"cheap": CHEAP}))
    finally:
        jax.config.update(setting, before)


def test_the_digest_of_environments_tells_banks_apart():
    params = Job(CHEAP, SIZE).points.params
    other = jax.tree.map(lambda leaf: leaf + 0.5 if leaf is params.radar.miss_bank else leaf, params)
    assert digest_of(params) != digest_of(other)


@pytest.mark.parametrize("kind", ["pipe", "dangling", "loop"])
def test_what_is_no_file_in_the_place_of_a_part_is_set_aside(kind, folder, capsys):
    part = folder / "seeds-000005-000007.nc"
    {
        "pipe": lambda: os.mkfifo(part),
        "dangling": lambda: part.symlink_to(folder / "absent"),
        "loop": lambda: part.symlink_to(part),
    }[kind]()
    assert [found.seeds for found in parts.parts_of(folder)] == [range(3)]
    assert f"{part} is set aside as {part.name}.damaged: it is a " in capsys.readouterr().err


@pytest.mark.parametrize("failing", ["open", "fsync"])
def test_a_full_disk_is_told_and_leaves_what_was_there(failing, folder, untouched, monkeypatch):
    def full(*args, **kwargs):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patched:
        patched.setattr(files.os, failing, full if failing == "fsync" else full_for_parts(files.os.open, full))
        with pytest.raises(OSError, match=r"No space left on device: .*seeds-000003-000003\.nc was not written") as e:
            run_sweep(CHEAP, replace(SIZE, seeds=4), folder.parent, QUIET, resume=True)
        assert e.value.errno == errno.ENOSPC
    assert digests(folder) == digests(untouched)
    assert not list(folder.glob(".*.tmp"))


def full_for_parts(opened, full):
    """What opens files but for temporary ones."""
    return lambda path, *args, **kwargs: (full if ".tmp" in str(path) else opened)(path, *args, **kwargs)


def test_a_second_run_says_that_the_folder_is_in_use(folder):
    with files.locked(folder), pytest.raises(files.FolderInUse, match=f"process {os.getpid()} on .* is writing here"):
        run_sweep(CHEAP, replace(SIZE, seeds=4), folder.parent, QUIET, resume=True)
    run_sweep(CHEAP, replace(SIZE, seeds=4), folder.parent, QUIET, resume=True)
    assert parts.finished_seeds(folder) == {0, 1, 2, 3}


def test_damaged_source_agents_are_trained_again(tmp_path, capsys):
    size = Size(seeds=2, episodes=1, pretraining=2, demonstrations=30)
    first = sources_of(Job(SOURCE, size), range(2), tmp_path)
    part, manifest = store.part_path(tmp_path / "source", range(2)), tmp_path / "source" / store.MANIFEST
    told = manifest.read_bytes()
    manifest.unlink()  # as a process leaves it that is killed between a part and its manifest
    sources_of(Job(SOURCE, size), range(2), tmp_path)
    assert manifest.read_bytes() == told
    part.write_bytes(flipped(part.read_bytes(), 4321))
    again = sources_of(Job(SOURCE, size), range(2), tmp_path)
    assert "set aside" in capsys.readouterr().err
    jax.tree.map(np.testing.assert_array_equal, first, again)


# --- Kills ------------------------------------------------------------------------------------------------------------

# Runs a sweep whose numbers are made up at once, over and over in children of its own that are killed at random
# moments: most of a child's time is then writing, and starting one costs nothing.
_KILLED = """
import os, random, signal, sys, time
from dataclasses import replace
from pathlib import Path
import numpy as np
import xarray as xr
from rich.console import Console
from sweeps.engine import run
from sweeps.engine.block import Block
from sweeps.results import store
from sweeps.studies.registry import SWEEPS
from sweeps.sweep import Size

def made_up(job, seeds, chunks):
    rewards = np.stack([np.random.default_rng(seed).normal(size=20_000) for seed in seeds])
    about = {"configuration": '{"sweep": "fig5a"}', "provenance": '{"finished": "now"}'}
    return Block(seeds, xr.Dataset({"reward": (("seed", "episode"), rewards)}, {"seed": np.array(seeds)}, about), {})

run.block_of = made_up
store.configuration = lambda job: {"sweep": "fig5a"}

def go(out):
    run.run_sweep(SWEEPS["fig5a"], Size(seeds=320), out, Console(quiet=True), resume=True)

random.seed(0)
out = Path(sys.argv[1])
begin = time.perf_counter()
go(out / "whole")
seconds = time.perf_counter() - begin
kills = part_way = number = 0
while kills < int(sys.argv[2]):
    folder = out / f"killed-{number}"
    child = os.fork()
    if child == 0:
        go(folder)
        os._exit(0)
    time.sleep(random.uniform(0, seconds / 10))
    os.kill(child, signal.SIGKILL)
    if os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == -signal.SIGKILL:
        kills += 1
        part_way += any((folder / "fig5a").glob("*.nc"))
    else:  # it came to its end before; the next one starts afresh
        number += 1
go(folder)
print(kills, part_way)
"""


@pytest.mark.slow
def test_results_are_the_same_after_twenty_kills(tmp_path):
    command = [sys.executable, "-W", "ignore", "-c", _KILLED, str(tmp_path), "20"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    kills, part_way = map(int, done.stdout.split())
    assert kills == 20
    assert part_way > 0
    whole = tmp_path / "whole" / "fig5a"
    assert len(digests(whole)) == 20
    for killed in tmp_path.glob("killed-*/fig5a"):
        assert digests(killed) == digests(whole)
        assert {path.name for path in killed.iterdir()} == {path.name for path in whole.iterdir()}


# --- Seeds, devices and verification ----------------------------------------------------------------------------------

_ON_DEVICES = """
import os, sys
from pathlib import Path
from jrcjax.training import parallel
if not int(sys.argv[1]):
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})  # before the threads are there
parallel.use_all_cores()
parallel.keep_compiled()
import jax
if int(sys.argv[1]):
    jax.config.update("jax_num_cpu_devices", int(sys.argv[1]))
import dataclasses
from rich.console import Console
from sweeps.engine import run
from sweeps.studies.registry import SWEEPS
from sweeps.sweep import Size
ddqn = dataclasses.replace(SWEEPS["fig5a"], learners=("ddqn",))
run.run_sweep(ddqn, Size(seeds=int(sys.argv[2]), episodes=2), Path(sys.argv[3]), Console(quiet=True), resume=False)
"""


def on_devices(devices: int | None, seeds: int, out: Path) -> Path:
    command = [sys.executable, "-c", _ON_DEVICES, str(devices or 0), str(seeds), str(out)]
    subprocess.run(command, cwd=ROOT, check=True)
    return out / "fig5a"


@pytest.mark.slow
def test_a_seed_has_the_same_bits_on_two_devices_three_and_a_single_core(tmp_path):
    """Two blocks of seeds on two devices, one and a half on three, and what `use_all_cores` makes of one core."""
    two = on_devices(2, 35, tmp_path / "two")
    three = on_devices(3, 35, tmp_path / "three")
    one_core = on_devices(None, 3, tmp_path / "one")
    assert digests(two) == digests(three)
    a, b = (store.load(folder, 3).drop_attrs() for folder in (two, one_core))
    assert a.identical(b)
    assert len(np.unique(store.load(two, 35)["reward"].values[0, 0], axis=0)) == 35


@pytest.mark.parametrize("seeds", [range(2, 3), range(1, 4), range(0, 40)])
def test_a_seed_has_the_same_bits_alone_and_among_others(seeds, untouched):
    size = replace(SIZE, seeds=seeds.stop)
    data = compute(Job(CHEAP, size), seeds).results
    common = sorted(set(seeds) & set(range(3)))
    there = store.load(untouched, 3).sel(seed=common)
    assert data.sel(seed=common).drop_attrs().identical(there.drop_attrs())


def test_verifying_finds_results_that_can_be_reproduced(untouched, capsys):
    assert [found for _, found in verify(untouched, None, {"cheap": CHEAP})] == [[]]


def test_verifying_says_where_and_how_much_results_differ(folder, monkeypatch, capsys):
    part = store.part_path(folder, range(3))
    data = parts.read_part(part)
    data["reward"][0, 0, 1, 0] += 0.5
    data["miss_detection"][0, 0, 2, 0] = np.nan
    store.write_part(folder, range(3), data)
    monkeypatch.setitem(EVERY_SWEEP, "cheap", CHEAP)
    assert main(["verify", str(folder)]) == 1
    out = capsys.readouterr().out
    assert f"{part}: differs" in out
    assert "reward: 1 of 3 entries differ, by at most 0.5, first at algorithm round_robin, point 0, seed 1" in out
    assert "miss_detection: 1 of 3 entries differ, by at most nan" in out
    assert main(["verify", str(folder.parent / "nothing")]) == 2
    assert "folder: " in capsys.readouterr().err


def test_verifying_says_of_each_part_what_it_found_until_it_is_interrupted(folder, monkeypatch, capsys):
    run_sweep(CHEAP, replace(SIZE, seeds=20), folder.parent, QUIET, resume=True)
    first, *others = parts.parts_of(folder)
    assert others

    def recomputed(part, sweep):
        if part.path != first.path:
            raise KeyboardInterrupt
        return parts.read_part(part.path)

    monkeypatch.setattr("sweeps.engine.verify.recomputed", recomputed)
    monkeypatch.setattr(sys, "orig_argv", ["python", "-m", "sweeps", "verify", str(folder)])
    monkeypatch.setitem(EVERY_SWEEP, "cheap", CHEAP)
    assert main(["verify", str(folder)]) == interrupts.STATUS
    captured = capsys.readouterr()
    assert captured.out == f"{first.path}: the same, bit for bit\n"
    assert captured.err.endswith(f"interrupted; to go on: python -m sweeps verify {folder}\n")


def test_verifying_refuses_results_of_another_configuration(folder):
    changed = replace(CHEAP, design=along("density", "env.radar.density", (9.0,)))
    with pytest.raises(store.ConfigurationMismatch, match=r"design\.density: null there, \[9\.0\] wanted"):
        list(verify(folder, None, {"cheap": changed}))
    with pytest.raises(ValueError, match="results of the sweep 'cheap'"):
        list(verify(folder, None, {}))


def test_sampled_parts_are_spread_from_first_to_last():
    held = [parts.Part(Path(str(i)), range(i, i + 1), {}, {}, "") for i in range(10)]
    for number, wanted in ((1, [0]), (2, [0, 9]), (3, [0, 4, 9]), (10, list(range(10))), (99, list(range(10)))):
        assert [part.seeds.start for part in sample_of(held, number)] == wanted
    for bad in (0, -1, True, 1.5):
        with pytest.raises(ValueError, match="parts: "):
            sample_of(held, bad)


def test_results_name_what_decides_their_last_bit(folder, monkeypatch):
    made = parts.parts_of(folder)[0].provenance
    monkeypatch.setenv("XLA_FLAGS", made["machine"]["xla_flags"])  # commands in this process add to it
    assert {"command", "versions", "machine", "git_commit", "git_modified"} <= made.keys()
    assert {"jrcjax", "jaxlib"} <= made["versions"].keys()
    assert set(made["machine"]["cpu_features"]) <= set(Path("/proc/cpuinfo").read_text().split())
    part = parts.parts_of(folder)[0]
    assert made_elsewhere(part) == []
    made["machine"]["cpu_features"] = ["fma"]
    assert made_elsewhere(part)[0].startswith("cpu_features: ['fma'] there, ")


# --- Kills and interrupts of the command itself -----------------------------------------------------------------------


def command(out: Path, *flags: str) -> list[str]:
    run_it = ["run", "fig5a", "--episodes", "2", "--seeds", "160", "--out", str(out), *flags]
    return [sys.executable, "-m", "sweeps", *run_it]


def started(out: Path, parts_wanted: int, *flags: str) -> subprocess.Popen:
    """The command, when it has written so many parts."""
    hears = "import os, signal, sys; signal.signal(signal.SIGINT, signal.SIG_DFL); os.execv(sys.argv[1], sys.argv[1:])"
    listening = [sys.executable, "-c", hears, *command(out, *flags)]  # what a script runs in its background ignores it
    process = subprocess.Popen(listening, cwd=ROOT, stderr=subprocess.PIPE, text=True)
    while process.poll() is None and len(list(out.glob("fig5a/*.nc"))) < parts_wanted:
        time.sleep(0.002)
    return process


@pytest.mark.slow
def test_the_command_goes_on_after_an_interrupt_and_a_kill_with_the_same_results(tmp_path):
    subprocess.run(command(tmp_path / "whole"), cwd=ROOT, check=True, capture_output=True)
    out, whole = tmp_path / "stopped", digests(tmp_path / "whole" / "fig5a")
    process = started(out, 1)
    process.send_signal(signal.SIGINT)
    said = process.communicate()[1]
    assert process.returncode == 130
    saved = parts.finished_seeds(out / "fig5a")
    assert saved == {*range(len(saved))}
    assert 16 <= len(saved) < 160
    assert f"saved in {out}/fig5a: seeds {store.in_words(saved)}" in said
    assert f"interrupted; to go on: {shlex.join(['python', *command(out)[1:], '--resume'])}" in said
    assert digests(out / "fig5a").items() <= whole.items()
    process = started(out, len(saved) // 16 + 1, "--resume")
    process.kill()
    process.communicate()
    assert process.returncode == -signal.SIGKILL
    subprocess.run(command(out, "--resume"), cwd=ROOT, check=True, capture_output=True)
    assert digests(out / "fig5a") == whole


def test_a_request_to_end_interrupts_too():
    before = signal.getsignal(signal.SIGTERM)
    with pytest.raises(KeyboardInterrupt), interrupts.terminable():
        signal.raise_signal(signal.SIGTERM)
    assert signal.getsignal(signal.SIGTERM) is before


def test_a_sweep_in_a_thread_leaves_signals_alone():
    def in_thread():
        with interrupts.terminable():
            return signal.getsignal(signal.SIGTERM)

    with ThreadPoolExecutor(1) as pool:
        assert pool.submit(in_thread).result() is signal.getsignal(signal.SIGTERM)


def test_an_interrupt_waits_for_what_is_begun(request):
    request.addfinalizer(functools.partial(signal.signal, signal.SIGINT, signal.getsignal(signal.SIGINT)))
    signal.signal(signal.SIGINT, signal.default_int_handler)  # which a test run in the background ignores
    before = signal.getsignal(signal.SIGTERM), signal.getsignal(signal.SIGINT)
    done = []

    def interrupted(number):
        with interrupts.held_off():
            signal.raise_signal(number)
            done.append(number)

    for number in (signal.SIGINT, signal.SIGTERM):
        with interrupts.terminable():
            with pytest.raises(KeyboardInterrupt):
                interrupted(number)
            assert signal.getsignal(signal.SIGINT) is before[1]
    assert done == [signal.SIGINT, signal.SIGTERM]
    assert (signal.getsignal(signal.SIGTERM), signal.getsignal(signal.SIGINT)) == before
    with interrupts.held_off():
        done.append(0)
    assert done[-1] == 0


def test_an_interrupted_sweep_tells_what_is_saved(folder, monkeypatch, capsys):
    def interrupted(*args):
        raise KeyboardInterrupt

    monkeypatch.setitem(STUDIES, "cheap", Study("cheap", "", (CHEAP,)))
    monkeypatch.setattr(run, "block_of", interrupted)
    arguments = ["run", "cheap", "--seeds", "4", "--episodes", "1", "--out", str(folder.parent), "--resume"]
    assert main(arguments) == 130
    said = " ".join(capsys.readouterr().err.split())
    assert "cheap: stopped; saved in " in said
    assert "seeds 0 to 2" in said
    assert "interrupted; to go on: python " in said
