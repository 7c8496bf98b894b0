"""Sweeps: files of constants, and the runner that turns them into results on disk. Nothing here draws."""
