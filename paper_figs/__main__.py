"""Command line: `python -m paper_figs` runs what is missing and draws the figures."""

from __future__ import annotations

import dataclasses
import json
import sys
from dataclasses import dataclass
from pathlib import Path

import tyro
from rich.console import Console

from sweeps import interrupts
from sweeps.options import FLAGS, Count, Counts, Folder, Preset
from sweeps.preset import label_of, preset_of
from sweeps.sweep import Size, size_of


@dataclass(frozen=True)
class Options:
    """Regenerates the paper's figures: PDF, PNG and CSV each; claims, regret, the seeds needed, and report.html."""

    only: Counts = ()
    """Numbers of the figures to draw, 5 to 9. Default: all."""
    seeds: Count = None
    """Independent seeds. Default: 10, or 2 with --smoke."""
    episodes: Count = None
    """Episodes per seed. Default: 1000, or 20 with --smoke."""
    out: Folder = None
    """Folder for the figures; results go to its folder `results` and are used again. Default: out, or out/smoke."""
    smoke: bool = False
    """A tiny version of everything."""
    preset: Preset = "paper"
    """The paper's parameters: paper, paper_table, or a TOML file of what differs from them, such as one from
    jrcjax.config.nuscenes."""


def results_folder(out: Path, size: Size) -> Path:
    """Where results of one preset and length lie, so that runs of different ones don't meet."""
    return out / "results" / f"{label_of(size.preset)}-{size.episodes}-episodes"


def make_figures(numbers: tuple[int, ...], size: Size, out: Path, console: Console) -> list[Path]:
    """Runs the sweeps that are missing, then writes all files of the figures with these numbers.

    Raises:
      ValueError: unknown figures, bad sizes, or results of another configuration in `out`.
    """
    import pandas as pd

    from paper_figs import report
    from paper_figs.analysis import divergence, ranking, regret
    from paper_figs.claims import judge
    from paper_figs.figures import FIGURES, NUMBERS
    from paper_figs.plots import style
    from sweeps.engine.estimate import in_words
    from sweeps.engine.run import expected_seconds, run_sweep
    from sweeps.results import store
    from sweeps.studies.registry import SWEEPS

    unknown = sorted(set(numbers) - set(NUMBERS))
    if unknown:
        raise ValueError(f"only: {unknown}; allowed: {', '.join(map(str, NUMBERS))}")
    size.check()
    out.mkdir(parents=True, exist_ok=True)
    wanted = [figure for figure in FIGURES if not numbers or figure.number in numbers]
    results = results_folder(out, size)
    seconds = expected_seconds([SWEEPS[figure.name] for figure in wanted], size, results)
    console.print(
        f"figures: {len(wanted)}, seeds: {size.seeds}, episodes: {size.episodes}; about {in_words(seconds)} in all"
    )
    written, pictures, judgements, optima, diverged, manifests = [], {}, [], [], [], {}
    tables: dict[str, list[pd.DataFrame]] = {"regret": [], "seeds_needed": []}
    for figure in wanted:
        folder = run_sweep(SWEEPS[figure.name], size, results, console, resume=True)
        data = store.load(folder, size.seeds)
        table = figure.table(data)
        table.to_csv(out / f"{figure.name}.csv", index=False, float_format="%.6g")
        files = style.save(figure.draw(table, figure.title), out / figure.name)
        written += [out / f"{figure.name}.csv", *files]
        pictures[figure.title] = files[-1]
        lost = divergence.rows(figure.name, data)
        judgements += [dataclasses.replace(claim, n_diverged=len(lost)) for claim in figure.claims(data)]
        diverged += lost
        optima += report.optimum_rows(figure.name, data)
        tables["regret"].append(regret.table(data, figure.name))
        tables["seeds_needed"].append(ranking.needed_table(data, figure.name))
        manifests[figure.name] = (folder / store.MANIFEST).read_text()
    for name, parts in tables.items():
        pd.concat(parts).to_csv(out / f"{name}.csv", index=False, float_format="%.6g")
        written.append(out / f"{name}.csv")
    page = report.render(size, pictures, judgements, optima, diverged, manifests)
    texts = {"claims.json": json.dumps(judge.as_json(judgements), indent=2) + "\n", "report.html": page}
    for name, text in texts.items():
        (out / name).write_text(text)
        written.append(out / name)
    return written


def main(args: list[str] | None = None) -> int:
    """Entry point; returns the exit status."""
    options = tyro.cli(Options, prog="python -m paper_figs", args=args, config=FLAGS)
    from jrcjax.training import parallel  # after parsing, so that --help and errors come at once

    parallel.use_all_cores()
    parallel.keep_compiled()
    out = options.out or Path("out/smoke" if options.smoke else "out")
    try:
        size = size_of(options.seeds, options.episodes, preset_of(options.preset), options.smoke)
        with interrupts.terminable():
            written = make_figures(options.only, size, out, Console(stderr=True))
    except KeyboardInterrupt:
        print(interrupts.how_to_go_on(), file=sys.stderr)
        return interrupts.STATUS
    except (ValueError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    print("\n".join(map(str, written)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
