"""Draws the banks of the paper's environments and stores them in the package (`make banks`).

For who has changed how objects are placed or detected, or what jax or distrax draws; a test tells when it is due.
"""

import numpy as np

import jrcjax
from jrcjax.model.presets import PRESETS
from jrcjax.radar import bank, stored

found = {}
for preset in PRESETS:
    for environment in ("source", "target"):
        radar = jrcjax.paper_params(environment, preset).radar
        made_from = radar.modes, radar.bank_seed, radar.bank_size
        found[stored.name_of(bank.content_of(*made_from))] = np.asarray(bank.draw(*made_from))
np.savez_compressed(stored.FILE, **found)
print(f"{len(found)} banks in {stored.FILE}")
