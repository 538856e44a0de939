"""Plots in the form that BokehJS reads, written without Bokeh's Python part.

That part takes half a second to import, and as long again to make a page's plots.  A `Model` here
is the name of a class of BokehJS and those of its properties that differ from their defaults.

Source: https://docs.bokeh.org/en/latest/docs/reference/core.html (serialization).
"""

from __future__ import annotations

import gzip
import json
from base64 import b64encode
from collections.abc import Sequence
from importlib.metadata import version
from typing import Any, NamedTuple

import numpy as np


class Field(NamedTuple):
    """A column of the table that a glyph draws."""

    name: str


class Value(NamedTuple):
    """One value for all rows of the table that a glyph draws."""

    value: Any


class Model:
    """An instance of a class of BokehJS; its attributes are the properties that are set."""

    def __init__(self, kind: str, **properties: Any) -> None:
        self.kind = kind
        self.__dict__.update(properties)

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(f"{name} of {self.kind} was not set")

    def __setattr__(self, name: str, value: Any) -> None:
        self.__dict__[name] = value

    def like(self, **changes: Any) -> Model:
        """Another instance, with the same properties but these."""
        return Model(**{**vars(self), **changes})


def document_of(roots: Sequence[Model], prefix: str) -> str:
    """The document with these roots, as JSON.

    Ids are a prefix and a number; the first are those of the roots, in their order.
    """
    ids = {id(root): f"{prefix}{k}" for k, root in enumerate(roots)}
    defined: set[int] = set()

    def written(value: Any) -> Any:
        if isinstance(value, Model):
            name = ids.setdefault(id(value), f"{prefix}{len(ids)}")
            if id(value) in defined:
                return {"id": name}
            defined.add(id(value))
            attributes = {k: written(each) for k, each in vars(value).items() if k != "kind"}
            return {"type": "object", "name": value.kind, "id": name, "attributes": attributes}
        if isinstance(value, Field):
            return {"type": "field", "field": value.name}
        if isinstance(value, Value):
            return {"type": "value", "value": value.value}
        if isinstance(value, dict):
            pairs = [[written(key), written(each)] for key, each in value.items()]
            return {"type": "map", "entries": pairs}
        if isinstance(value, np.ndarray):
            return {
                "type": "ndarray",
                "array": {"type": "bytes", "data": _packed(value)},
                "shape": list(value.shape),
                "dtype": value.dtype.name,
                "order": "little",
            }
        if isinstance(value, list | tuple):
            return [written(each) for each in value]
        return value

    document = {
        "version": version("bokeh"),
        "title": "",
        "roots": [written(root) for root in roots],
        "config": written(Model("DocumentConfig")),
    }
    return json.dumps(document, allow_nan=False)


def _packed(array: np.ndarray) -> str:
    """The bytes of an array, compressed: always alike, for no time is written with them."""
    return b64encode(gzip.compress(array.tobytes(), mtime=0)).decode()
