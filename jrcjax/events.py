"""Short name of `jrcjax.model.events`: equations (3) and (4)."""

from jrcjax.model.events import event_probability, event_probability_at

__all__ = ["event_probability", "event_probability_at"]
