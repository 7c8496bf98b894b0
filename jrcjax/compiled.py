"""What makes a function one program for those who call it by itself, in a notebook or step by step."""

from __future__ import annotations

import functools

import jax

compiled = functools.partial(jax.jit, inline=True)
"""Decorates pure functions of arrays: one program, not a hundred small ones; inside other programs they dissolve."""
