"""The configuration reference, made from the classes: `python -m jrcjax.config.document` writes CONFIGURATION.md.

What a field means is the docstring under it, which Python itself drops, so it comes from the source.
"""

from __future__ import annotations

import argparse
import ast
import dataclasses
import inspect
from pathlib import Path
from typing import Any

import numpy as np

from jrcjax.containers import Container, Field, Kind, schema_of
from jrcjax.files import write_text
from jrcjax.learners.hparams import Config, HParams
from jrcjax.model.params import FACTORS, EnvParams
from jrcjax.model.presets import ENVIRONMENTS, paper_params

PATH = Path(__file__).with_name("CONFIGURATION.md")
_MOST_NUMBERS = 12  # that are shown of an array
_INTRODUCTION = """\
# Configuration

Every setting with its type, its value in Table I, and its meaning. Made from the classes by
`python -m jrcjax.config.document`; do not edit it.

Types: float and int are arrays of one number, or of one per level [J], data rate [L], radar mode [K], class of objects
[C] or placement [B]; all of them may be traced and vmapped over. What is static decides shapes or code. In a parameter
file (`jrcjax.load_params`) and in Python fields have these names, and named choices may go by name. In
`python -m sweeps run custom --vary PATH=VALUES` a path is `env.` or `hparams.`, the dotted field, and an index for each
axis: `env.speed.event_probability.1`, or `.high` where there are two levels. `env.all.prior.0` is that entry of every
factor.
"""


def fields_of(kind: type) -> dict[str, str]:
    """Field to the docstring under it, in one line, for a class whose fields all have one or tell by their type."""
    found: dict[str, str] = {}
    for base in reversed(kind.__mro__):
        if dataclasses.is_dataclass(base):
            found |= _own_fields_of(base)
    return found


def _own_fields_of(kind: type) -> dict[str, str]:
    body = ast.parse(inspect.getsource(kind)).body[0]
    assert isinstance(body, ast.ClassDef)
    found: dict[str, str] = {}
    for node, below in zip(body.body, [*body.body[1:], None], strict=True):
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            text = below.value.value if isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant) else ""
            found[node.target.id] = " ".join(str(text).split())
    return found


def _type_of(field: Field | None, value: Any, annotation: str) -> str:
    """The type and shape of an array, or the annotation of what is static."""
    if not hasattr(value, "dtype"):
        return f"{annotation}, static"
    kind = "int" if np.issubdtype(value.dtype, np.integer) else "float"
    return f"{kind} [{' '.join(field.axes)}]" if field and field.axes else kind


def _allowed(field: Field | None) -> str:
    """What a field may hold, if its schema says it."""
    if field is None:
        return ""
    return ", ".join(field.names) or ("" if field.kind is Kind.SETTING else field.words)


def _shown(value: Any, readings: tuple[str, ...] = ()) -> str:
    """A value as a person writes it."""
    if readings and not isinstance(value, str):
        return f"{int(value)} ({readings[int(value)]})"
    if isinstance(value, str | int):
        return str(value)
    array = np.asarray(value)
    if array.size > _MOST_NUMBERS:
        return f"{' x '.join(map(str, array.shape))} numbers"
    if array.ndim > 1:
        return "; ".join(map(_shown, array))
    return ", ".join(f"{number:.6g}" for number in np.atleast_1d(array))


def _table(kind: type, instances: dict[str, Any]) -> list[str]:
    """The rows of one class's fields that hold values, with a column for each instance."""
    meanings = fields_of(kind)
    schema = schema_of(kind) if issubclass(kind, Container) else {}
    lines = [
        f"| field | type | {' | '.join(instances)} | allowed | meaning |",
        f"|---|---|{'---|' * len(instances)}---|---|",
    ]
    for described in dataclasses.fields(kind):
        values = [getattr(instance, described.name) for instance in instances.values()]
        if dataclasses.is_dataclass(values[0]):
            continue
        field = schema.get(described.name)
        shown = [_shown(value, field.names if field else ()) for value in values]
        type_ = _type_of(field, values[0], str(described.type))
        cells = (f"`{described.name}`", type_, *shown, _allowed(field), meanings[described.name])
        lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return lines


def _section(title: str, kind: type, instances: dict[str, Any]) -> list[str]:
    summary = (inspect.getdoc(kind) or "").split("\n\n")[0].replace("\n", " ")
    return [f"## {title}", "", summary, "", *_table(kind, instances), ""]


def reference() -> str:
    """The whole page."""
    both = {name: paper_params(name) for name in ENVIRONMENTS}
    lines = [*_INTRODUCTION.splitlines(), "", *_section("EnvParams", EnvParams, both)]
    for part in (*FACTORS, "radar"):
        parts = {name: getattr(params, part) for name, params in both.items()}
        kind = type(parts["source"])
        lines += _section(f"EnvParams.{part}: {kind.__name__}", kind, parts)
    lines += _section("HParams", HParams, {"default": HParams()})
    lines += _section("Config", Config, {"default": Config()})
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    argparse.ArgumentParser(prog="python -m jrcjax.config.document", description=__doc__).parse_args()
    print(write_text(PATH, reference()))
