"""What attributes, properties and single values say of the arrays they stand beside."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from fracjax._io._facts import fact, kind_of
from fracjax._io._table import Fact

_DATA = re.compile(r"(data|values?|samples|signals?|y)$", re.IGNORECASE)
_PREFERRED = ("label", "name", "longname", "channelname", "signalname", "title")


@dataclass(frozen=True)
class Facts:
    """Values by path: that of an attribute is the path of what it belongs to, and its name.

    A value speaks of the array it is an attribute of; of the array beside it in the group, where
    that is the only one or is called Data; or, as in InputUnit, of the array whose name begins so.
    Steps and rates also speak of all arrays in the groups below.
    """

    source: str
    values: Mapping[str, object]
    sizes: Mapping[str, int]
    """The longest axis of each array by path."""
    _by_scope: dict[str, list[tuple[str, str, object]]] = field(default_factory=dict)
    _by_element: dict[tuple[str, str], list[tuple[str, str, object]]] = field(default_factory=dict)
    """Of an array of structures, whose field k of element i has the path `k/i`."""

    def __post_init__(self):
        for path, value in self.values.items():
            scope, _, key = path.rpartition("/")
            self._by_scope.setdefault(scope, []).append((kind_of(key) or "", key, value))
            group, _, name = scope.rpartition("/")
            if key.isdigit() and name:
                attribute = kind_of(name) or "", name, value
                self._by_element.setdefault((group, key), []).append(attribute)
                # A text in a cell of its own.
                if key == "0" and f"{scope}/1" not in self.values:
                    self._by_scope.setdefault(group, []).append(attribute)

    def unit(self, path: str) -> str:
        """The unit of an array; empty where none is stated."""
        stated_units = (value for _, value in self._about(path, "unit"))
        return next(
            (unit for unit in stated_units if isinstance(unit, str) and unit.strip(" -")), ""
        )

    def title(self, path: str) -> str:
        """What an array is called: its label, else the last part of its path."""
        last = path.rpartition("/")[2]
        titles = [(k, v) for k, v in self._about(path, "name") if isinstance(v, str) and v.strip()]
        rank = {name: at for at, name in enumerate(_PREFERRED)}
        titles.sort(key=lambda pair: rank.get(re.sub(r"[\W_]", "", pair[0].casefold()), 9))
        return str(titles[0][1]) if titles else last

    def clocks(self, path: str) -> tuple[Fact, ...]:
        """The steps and rates of the nearest scope that has any: the array, its group, the file."""
        for scope in _scopes(path):
            clock_facts = [
                self._fact(scope, kind, key, value)
                for kind, key, value in self._by_scope.get(scope, ())
                if kind in ("step", "rate") and value not in ("", None)
            ]
            if stated := tuple(dict.fromkeys(each for each in clock_facts if each)):
                return stated
        return ()

    def start(self, path: str) -> int | None:
        """When the first sample of an array was taken [ns since 1970], where its own attributes
        tell."""
        own = self._by_scope.get(path, ())
        moments = [v for kind, _, v in own if kind == "start" and isinstance(v, int) and v > 10**15]
        shifts = [v for kind, _, v in own if kind == "shift" and isinstance(v, int | float)]
        if not moments and not shifts:
            return None
        return (moments[0] if moments else 0) + round(1e9 * (shifts[0] if shifts else 0.0))

    def scaling(self, path: str) -> tuple[float, float]:
        """The factor and what is added to it that the conventions of NetCDF state (CF, 8.1)."""
        own = {kind: value for kind, _, value in self._by_scope.get(path, ())}
        scale, offset = own.get("scale", 1.0), own.get("offset", 0.0)
        return (
            float(scale) if isinstance(scale, int | float) else 1.0,
            float(offset) if isinstance(offset, int | float) else 0.0,
        )

    def missing(self, path: str) -> list[float]:
        """The values that stand for no number."""
        own = self._by_scope.get(path, ())
        return [v for kind, _, v in own if kind == "missing" and isinstance(v, int | float)]

    def unapplied(self, path: str) -> str:
        """A factor beside an array of which nobody knows whether it is in the numbers."""
        for kind, key, value in self._by_scope.get(path, ()):
            if kind == "unapplied" and isinstance(value, int | float) and value not in (0, 1):
                return f'"{key}" of {value:g}'
        return ""

    def _about(self, path: str, kind: str) -> Iterator[tuple[str, object]]:
        """The values of a kind that speak of an array: its own, its group's, those of its stem."""
        group, _, last = path.rpartition("/")
        yield from ((k, v) for each, k, v in self._by_scope.get(path, ()) if each == kind)
        beside = self._by_scope.get(group, ())
        if last.isdigit():
            element, (group, _, last) = last, group.rpartition("/")
            beside = self._by_element.get((group, element), ())
        stem = _DATA.sub("", last).rstrip("_").casefold()
        if stem:
            for _, key, value in beside:
                rest = key.casefold()
                if rest.startswith(stem) and kind_of(rest[len(stem) :]) == kind:
                    yield rest[len(stem) :], value
        if (group or self._is_alone(group, path)) and (
            _DATA.fullmatch(last) or self._is_alone(group, path)
        ):
            yield from ((key, value) for each, key, value in beside if each == kind)

    def _is_alone(self, group: str, path: str) -> bool:
        """Whether no other array in a group is as long by far."""
        others = [
            size
            for other, size in self.sizes.items()
            if other != path
            and re.sub(r"/\d+$", "", other).rpartition("/")[0] == group
            and re.sub(r"/\d+$", "", other) != re.sub(r"/\d+$", "", path)
        ]
        return all(4 * size < self.sizes.get(path, 0) for size in others)

    def _fact(self, scope: str, kind: str, key: str, value: object) -> Fact | None:
        path = f"{scope}/{key}" if scope else key
        beside = self._by_scope.get(path, ())
        unit = next((str(v) for each, _, v in beside if each == "unit" and v), "")
        text = f"{value} {unit}".strip()
        if isinstance(value, int | float) and not unit:
            return fact(path, text, kind, key=key) or Fact(
                path, text, "s" if kind == "step" else "Hz"
            )
        return fact(path, text, kind, key=key)


def _scopes(path: str) -> Iterator[str]:
    """A path and all that it lies in, the file last."""
    while path:
        yield path
        path = path.rpartition("/")[0]
    yield ""
