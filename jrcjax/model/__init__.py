"""The decision process: channel (1), events (3)(4), metrics (6)(7), states to transitions (8)-(10), rewards (11)."""
