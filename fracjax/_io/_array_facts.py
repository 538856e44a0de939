"""What attributes, properties and single values say of the arrays they stand beside."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from fracjax._io._facts import fact, kind_of, speaks
from fracjax._io._table import Fact, Stated
from fracjax._io._units import is_compatible, readable

_DATA = re.compile(r"(data|values?|samples|signals?|y)$", re.IGNORECASE)
_VAGUE = ("rate", "interval", "increment", "dx")
"""What may be that of anything in a group that holds no samples."""
_PREFERRED = ("label", "name", "longname", "channelname", "signalname", "title")


@dataclass(frozen=True)
class Facts:
    """Values by path: that of an attribute is the path of what it belongs to, and its name.

    A value speaks of the array it is an attribute of; of the array beside it in the group, where
    that is the only one or is called Data; as in InputUnit, of the array whose name begins so; in
    a group of units, of the array of its name; and one of several in a list, of the array of its
    place. Steps and rates also speak of all arrays in the groups below.
    """

    source: str
    values: Mapping[str, object]
    sizes: Mapping[str, int]
    """The longest axis of each array by path."""
    order: Sequence[str] = ()
    """The paths of the arrays in the file's order."""
    _by_scope: dict[str, list[tuple[str, str, object]]] = field(default_factory=dict)
    _by_element: dict[tuple[str, str], list[tuple[str, str, object]]] = field(default_factory=dict)
    """Of an array of structures, whose field k of element i has the path `k/i`."""
    _used: set[str] = field(default_factory=set)

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

    def units(self, path: str, title: str, at: int, count: int) -> tuple[Stated, ...]:
        """The units that are stated of column `at` of an array of `count`, the nearest first."""
        stated = [
            *((key, value) for key, value in self._about(path, "unit")),
            *self._of_its_name({path.casefold(), path.rpartition("/")[2].casefold(), title}),
            *(self._of_its_place(path) if count == 1 else ()),
            *self._of_columns(path, "unit", at, count),
            *self._of_its_entry(path, "unit"),
        ]
        units = []
        for key, value in stated:
            if isinstance(value, str) and value.strip(" -"):
                self._used.add(key)
                units.append(Stated(value, f'"{key}"'))
        return tuple(dict.fromkeys(units))

    def _of_its_name(self, names: set[str]) -> Iterator[tuple[str, object]]:
        """Values by an array's name in a group of units."""
        for path, value in self.values.items():
            group, _, key = path.rpartition("/")
            if key.casefold() in names and kind_of(group.rpartition("/")[2]) == "unit":
                yield path, value

    def _of_its_place(self, path: str) -> Iterator[tuple[str, object]]:
        """Values at an array's place in a list of units, the first of which may be the step's."""
        for key, value in self.values.items():
            if isinstance(value, tuple) and kind_of(key.rpartition("/")[2]) == "unit":
                beside = self._within(key.rpartition("/")[0])
                extra = len(value) - len(beside)
                if path in beside and extra in (0, 1):
                    yield key, value[beside.index(path) + extra]

    def _of_columns(
        self, path: str, kind: str, at: int, count: int
    ) -> Iterator[tuple[str, object]]:
        """What lists of as many entries as an array has columns say of one: its own lists, else
        those of the groups it is in."""
        for scope in _scopes(path):
            for each, key, value in self._by_scope.get(scope, ()):
                if each == kind and isinstance(value, tuple) and len(value) == count > 1:
                    yield f"{scope}/{key}" if scope else key, value[at]
            # Cells of MATLAB, each by itself.
            if count > 1 and (scope, f"{count}") not in self._by_element:
                for each, key, value in self._by_element.get((scope, f"{at}"), ()):
                    if each == kind:
                        yield f"{scope}/{key}/{at}".lstrip("/"), value

    def _within(self, scope: str) -> list[str]:
        """The arrays in a group: in itself, else in the one group below it."""
        own = [each for each in self.order if each.rpartition("/")[0] == scope]
        below = {each.rpartition("/")[0] for each in self.order}
        return own or ([*self.order] if len(below) == 1 and scope in _scopes(*below) else [])

    def unused(self) -> tuple[Stated, ...]:
        """What speaks of a unit, a factor, a rate or a start and was not understood."""
        statements = []
        for path, value in self.values.items():
            scope, _, key = path.rpartition("/")
            kind = kind_of(key) or kind_of(scope.rpartition("/")[2])
            speaks_of_it = kind in ("unit", "xunit", "step", "rate", "unapplied", "scale", "offset")
            text = " ".join(map(str, value)) if isinstance(value, tuple) else f"{value}"
            speaks_of_it = speaks_of_it or speaks(f"{key} = {text}")
            if speaks_of_it and path not in self._used and text.strip() and len(text) < 500:
                statements.append(Stated(f"{key} = {text}", f'"{path}"'))
        return tuple(statements)

    def title(self, path: str, index: tuple[int, ...], count: int) -> str:
        """What a column of an array is called: its label, else the last part of the path."""
        last = path.rpartition("/")[2] + "".join(f".{at}" for at in index)
        for key, name in self._of_columns(path, "name", index[0], count) if len(index) == 1 else ():
            self._used.add(key)
            return f"{name}"
        titles = [(k, v) for k, v in self._about(path, "name") if isinstance(v, str) and v.strip()]
        rank = {name: at for at, name in enumerate(_PREFERRED)}
        titles.sort(
            key=lambda pair: rank.get(
                re.sub(r"[\W_]", "", pair[0].rpartition("/")[2].casefold()), 9
            )
        )
        return str(titles[0][1]) + "".join(f".{at}" for at in index) if titles else last

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
        return self._clocks_of_all(path)

    def _clocks_of_all(self, path: str) -> tuple[Fact, ...]:
        """The steps and rates of groups that hold no arrays, such as `meta/dt`, for a path that has
        none nearer: of keys that say on their own, or with that of their group, that samples are
        meant."""
        groups = {scope for each in self.sizes for scope in _scopes(each)}
        stated = []
        for scope in self._by_scope.keys() - groups if path not in ("", None) else ():
            of_group = kind_of(scope.rpartition("/")[2])
            if of_group not in ("step", "rate", "about"):
                continue
            for kind, key, value in self._by_scope[scope]:
                if key.casefold() == "value" and of_group in ("step", "rate"):
                    stated.append(self._fact(scope, of_group, key, value))
                elif (
                    kind in ("step", "rate")
                    and of_group == "about"
                    and (key not in _VAGUE or kind_of(scope.rpartition("/")[2] + key))
                ):
                    stated.append(self._fact(scope, kind, key, value))
        return tuple(dict.fromkeys(each for each in stated if each))

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
        own = {}
        for kind, key, value in self._by_scope.get(path, ()):
            own[kind] = value
            if kind in ("scale", "offset"):
                self._used.add(f"{path}/{key}")
        scale, offset = own.get("scale", 1.0), own.get("offset", 0.0)
        return (
            float(scale) if isinstance(scale, int | float) else 1.0,
            float(offset) if isinstance(offset, int | float) else 0.0,
        )

    def missing(self, path: str) -> list[float]:
        """The values that stand for no number."""
        own = self._by_scope.get(path, ())
        return [v for kind, _, v in own if kind == "missing" and isinstance(v, int | float)]

    def scales(self, path: str) -> tuple[Stated, ...]:
        """Factors of an array of which nobody knows whether they are in the numbers."""
        factors = []
        entry = [e for k in ("unapplied", "scale", "offset") for e in self._of_its_entry(path, k)]
        for key, value in (*self._about(path, "unapplied"), *entry):
            numbers = value if isinstance(value, tuple) else (value,)
            text = " ".join(f"{n:g}" if isinstance(n, float) else f"{n}" for n in numbers)
            if re.search(r"\d", text) and text not in ("1", "0", "True"):
                self._used.add(key)
                factors.append(Stated(text, f'"{key}"'))
        return tuple(factors)

    def _about(self, path: str, kind: str) -> Iterator[tuple[str, object]]:
        """The values of a kind that speak of an array by their paths: its own, its group's, those
        of its stem."""
        group, _, last = path.rpartition("/")
        own = self._by_scope.get(path, ())
        yield from ((f"{path}/{k}", v) for each, k, v in own if each == kind)
        beside = self._by_scope.get(group, ())
        if last.isdigit():
            element, (group, _, last) = last, group.rpartition("/")
            beside = self._by_element.get((group, element), ())
        prefix = f"{group}/" if group else ""
        stem = (_DATA.sub("", last).rstrip("_") or last).casefold()
        named = [(prefix, beside)]
        if path in self._within(""):
            named.append(("", self._by_scope.get("", ())))
        named += [
            (f"{scope}/", stated)
            for scope, stated in self._by_scope.items()
            if kind_of(scope.rpartition("/")[2]) == "about"
        ]
        for before, stated in named if stem else ():
            for _, key, value in stated:
                rest = key.casefold()
                if rest.startswith(stem) and kind_of(rest[len(stem) :]) == kind:
                    yield before + key, value
        if (group or self._is_alone(group, path)) and (
            _DATA.fullmatch(last) or self._is_alone(group, path)
        ):
            yield from ((prefix + key, value) for each, key, value in beside if each == kind)

    def _of_its_entry(self, path: str, kind: str) -> Iterator[tuple[str, object]]:
        """What an entry with an array's name says: `{"name": "voltage", "unit": "kV"}`."""
        for scope, stated in self._by_scope.items():
            names = [value for each, _, value in stated if each == "name"]
            if scope != path and names == [path.rpartition("/")[2]]:
                yield from (
                    (f"{scope}/{key}", value) for each, key, value in stated if each == kind
                )

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
        """A step or rate, its unit an attribute of it or beside it: `dt_unit`, the `xUnit` of an
        `xIncrement`, the first in a list of units of all columns."""
        path = f"{scope}/{key}" if scope else key
        own = [(f"{path}/{k}", v) for each, k, v in self._by_scope.get(path, ()) if each == "unit"]
        for _, name, text in self._by_scope.get(scope, ()):
            stem = re.sub(r"[\W_]*units?$", "", name, flags=re.IGNORECASE).casefold()
            time = kind_of(name) == "xunit" or stem == "time"
            of_value = stem != name.casefold() and (key.casefold().startswith(stem) and stem)
            if time or of_value or (key.casefold() == "value" and kind_of(name) == "unit"):
                own.append((f"{scope}/{name}" if scope else name, text))
        for name, listed in self.values.items():
            if (
                isinstance(listed, tuple)
                and kind_of(name.rpartition("/")[2]) == "unit"
                and len(listed) == len(self._within(scope)) + 1 > 1
                and _is_of_time(f"{listed[0]}")
            ):
                own.append((name, listed[0]))
        units = [(name, str(text)) for name, text in own if text and _is_of_time(str(text))]
        if not units and any(f"{text}".strip(" -") for _, text in own):
            return None
        self._used.update((path, *(name for name, _ in units)))
        unit = next((text for _, text in units), "")
        text = f"{value} {unit}".strip()
        if isinstance(value, int | float) and not unit:
            return fact(path, text, kind, key=key) or Fact(
                path, text, "s" if kind == "step" else "Hz"
            )
        return fact(path, text, kind, key=key)


def _is_of_time(text: str) -> bool:
    read = readable(text)
    return read is not None and is_compatible(read, "s", "Hz")


def _scopes(path: str) -> Iterator[str]:
    """A path and all that it lies in, the file last."""
    while path:
        yield path
        path = path.rpartition("/")[0]
    yield ""
