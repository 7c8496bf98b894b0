"""Training: episodes of acting and learning, many agents on all cores, and transfer from source to target (22)."""
