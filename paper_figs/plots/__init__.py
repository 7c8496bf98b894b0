"""Pictures of tables: style, learning curves, points."""
