"""Command line: `python -m paper_figs` runs what is missing and draws the figures."""

from __future__ import annotations

import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import tyro

from jrcjax.model.presets import ENVIRONMENTS
from paper_figs import check_numbers
from paper_figs.claims.delta import Delta
from sweeps import interrupts
from sweeps.command import begin
from sweeps.options import FLAGS, Count, Counts, Folder, Preset
from sweeps.preset import base_of, preset_of
from sweeps.sweep import size_of


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
    """The paper's parameters: paper, paper_table, the name of a file in sweeps/presets, or a TOML file of what differs
    from them, such as one from jrcjax.config.nuscenes."""
    delta: Delta = field(default_factory=Delta)
    """Which differences between learners are negligible."""


def main(args: list[str] | None = None) -> int:
    """Entry point; returns the exit status."""
    options = tyro.cli(Options, prog="python -m paper_figs", args=args, config=FLAGS)
    out = options.out or Path("out/smoke" if options.smoke else "out")
    try:
        console = begin()
        size = size_of(options.seeds, options.episodes, preset_of(options.preset), options.smoke)
        check_numbers(options.only)
        size.check()
        options.delta.check()
        with interrupts.terminable():
            # What imports take is nearly enough to draw the placements of both environments.
            with ThreadPoolExecutor(1, "placements") as drawing:
                bases = [drawing.submit(base_of, name, size.preset) for name in ENVIRONMENTS]
                from paper_figs.pipeline import make_figures
            for base in bases:
                base.result()
            written = make_figures(options.only, size, out, console, options.delta)
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
