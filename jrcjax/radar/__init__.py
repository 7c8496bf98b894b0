"""The radar: chirps (2), placed objects, detection (5), modes, and the bank of miss ratios."""

from jrcjax.radar.bank import Radar, make_radar, mean_miss_ratio
from jrcjax.radar.fresh import miss_ratio
from jrcjax.radar.modes import Modes
from jrcjax.radar.paper import paper_radar

__all__ = ["Modes", "Radar", "make_radar", "mean_miss_ratio", "miss_ratio", "paper_radar"]
