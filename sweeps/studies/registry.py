"""All sweeps and studies by name."""

from __future__ import annotations

from sweeps.studies.ablation import ABLATION
from sweeps.studies.fig5a import FIG5A
from sweeps.studies.fig5b import FIG5B
from sweeps.studies.fig6 import FIG6
from sweeps.studies.fig7 import FIG7
from sweeps.studies.fig8 import FIG8
from sweeps.studies.fig9 import FIG9
from sweeps.studies.multiverse import MULTIVERSE
from sweeps.studies.reconstruction import RECONSTRUCTION
from sweeps.studies.robustness import ROBUSTNESS
from sweeps.sweep import Study, Sweep

SWEEPS: dict[str, Sweep] = {sweep.name: sweep for sweep in (FIG5A, FIG5B, FIG6, FIG7, FIG8, FIG9, ABLATION)}
"""Those of one figure or table each."""
STUDIES: dict[str, Study] = {sweep.name: Study(sweep.name, sweep.description, (sweep,)) for sweep in SWEEPS.values()}
STUDIES |= {study.name: study for study in (ROBUSTNESS, MULTIVERSE, RECONSTRUCTION)}
"""All that `python -m sweeps run` takes."""
EVERY_SWEEP: dict[str, Sweep] = {
    part.name: part for study in STUDIES.values() for sweep in study.sweeps for part in (sweep, sweep.source) if part
}
"""Those of all studies, with the ones that train source agents, by the folder of their results."""
