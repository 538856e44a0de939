"""Models by name, and their composition in text: "foh >> creep + resonance"."""

from __future__ import annotations

import ast
from collections.abc import Hashable, Mapping
from types import MappingProxyType
from typing import Any

import equinox as eqx
import jax
import numpy as np
from jax.typing import ArrayLike

from ._aliases import ALIASES, meant_by, spelt
from ._blocks import (
    EFFECTS,
    INSIDE,
    AbstractBlock,
    AbstractInside,
    AbstractMachine,
    Motion,
    Setting,
    Within,
)
from ._catalogue import GROUPS as GROUPS
from ._catalogue import MODELS as MODELS
from ._catalogue import ORDINARY as ORDINARY
from ._catalogue import SIZED as SIZED
from ._naming import ByName, path_of_name, prefixes_of, shown_names, unknown_parameter
from ._parameters import Parameter, named_parameters, set_values
from ._recording import InputError, closest, require_kind
from ._show import Table, View, pretty_unit


class Model(eqx.Module):
    """A block that maps drive to response, and the name under which it is reported.

    Attributes:
        block: The block, which may be a composition of blocks.
        name: The name, by default the one under which `parse_model` builds the block.
    """

    block: AbstractBlock
    name: str = eqx.field(static=True)

    def __init__(self, block: AbstractBlock, name: str | None = None):
        self.block = block
        self.name = _catalogue_name(block) if name is None else name

    def __repr__(self) -> str:
        return self._view().brief()

    def _repr_html_(self) -> str:
        return self._view().html()

    def _view(self) -> View:
        rows = [
            [name, f"{np.array2string(np.asarray(p.value), precision=5)} {pretty_unit(p.unit)}"]
            for name, p in self.parameters.items()
        ]
        return View(f"Model {self.name}", [Table([], rows)])

    @property
    def parameters(self) -> ByName[Parameter]:
        """All parameters by the names of their blocks, such as "foh.alpha"; of one block, "alpha".

        Blocks of the same name are numbered, "resonance_1.damping".  The place in the composition,
        such as "first.alpha", reaches a parameter too.
        """
        shown = shown_names(self.block)
        pairs = named_parameters(self.block).items()
        return ByName(self.block, ((shown[path], parameter) for path, parameter in pairs))

    def with_values(self, values: Mapping[str, Any]) -> Model:
        """The same model at other parameter values.

        Args:
            values: Values by name, as in `parameters`, each of its parameter's shape and unit;
                parameters that are not named keep their values.

        Returns:
            The model with these values.

        Raises:
            InputError: When a name is no parameter's, or a value has another shape than its
                parameter.
        """
        parameters, by_path = named_parameters(self.block), {}
        for name, value in values.items():
            path = path_of_name(name, self.block)
            if path not in parameters:
                raise unknown_parameter(name, self.parameters)
            expected, shape = np.shape(parameters[path].value), np.shape(value)
            if shape != expected:
                raise InputError.at(
                    f"{self.name}, {name}",
                    f"a value of shape {expected}",
                    f"one of shape {shape}",
                    "give as many numbers as the parameter has",
                )
            by_path[path] = value
        return Model(set_values(self.block, by_path), self.name)


def _catalogue_name(block: AbstractBlock) -> str:
    """The name in `MODELS` that builds a block of this structure, or else the name of its class."""
    structure = jax.tree_util.tree_structure(block)
    names = (n for n, make in MODELS.items() if jax.tree_util.tree_structure(make()) == structure)
    return next(names, type(block).__name__)


def _typical_effect(
    word: str, setting: Setting | None, own: Mapping[str, ArrayLike], ahead: bool
) -> AbstractBlock:
    """An effect's block at the middle trial of one of its forms, for composition by name.

    An effect may have several forms: blocks of different classes or shapes.  Of the forms that the
    word means, it is the one whose parameters have the names and shapes of the values in `own`;
    else the first whose parameters have these names; else, if `ahead` (another block follows in
    series), the first that acts on the drive; else the first.
    """
    name, meant = meant_by(word)
    effect = EFFECTS[name]
    forms: dict[Hashable, list[AbstractBlock]] = {}
    for trial in effect.trials(setting or ORDINARY):
        if meant in ("", type(trial).__name__):
            forms.setdefault((type(trial), *_shapes(trial).items()), []).append(trial)
    shapes = {n: np.shape(v) for n, v in own.items()}
    matching = [form for form in forms.values() if _shapes(form[0]) == shapes]
    matching += [form for form in forms.values() if _shapes(form[0]).keys() == shapes.keys()]
    matching += [form for form in forms.values() if ahead and effect.site_of(form[0]) == "drive"]
    form = [*matching, *forms.values()][0]
    return form[len(form) // 2]


def _typical_inside(name: str, setting: Setting, own: Mapping[str, ArrayLike]) -> AbstractInside:
    """An effect inside a machine at the middle trial for the setting's motion.

    Of its forms it is the one whose parameters have the names in `own`, else the first.
    """
    turns = np.linspace(0, 2 * np.pi, 201)
    span, rate = 0.5 * setting.response_span, 2 * np.pi * setting.top_frequency
    drive = setting.drive_centre + 0.5 * setting.drive_span * np.sin(turns)
    motion = Motion(span * np.sin(turns), span * rate * np.cos(turns), drive)
    trials = INSIDE[name].trials(motion)
    forms: dict[Hashable, list[AbstractInside]] = {}
    for trial in trials:
        names = tuple((n, p.fixed) for n, p in named_parameters(trial).items())
        forms.setdefault(names, []).append(trial)
    free = {n for n, value in own.items() if np.any(value)}
    matching = [form for form in forms.values() if free and free <= {*_shapes(form[0])}]
    form = [*matching, *forms.values()][0]
    return form[len(form) // 2]


def _shapes(block: AbstractBlock | AbstractInside) -> dict[str, tuple[int, ...]]:
    """The shape of every parameter, by dotted path."""
    return {name: np.shape(p.value) for name, p in named_parameters(block).items()}


def as_model(model: Model | str, setting: Setting | None = None) -> Model:
    """The model, or the one of a name; raises InputError when it is neither."""
    if isinstance(model, str):
        return parse_model(model, setting)
    require_kind(model, Model, "model", 'give one, or its name such as "foh"')
    return model


class _AsNamed(ast.NodeTransformer):
    """A composition with the other words in it replaced by the names that they lead to."""

    def visit_BinOp(self, node: ast.BinOp) -> ast.BinOp:
        if isinstance(node.op, ast.MatMult):  # the words for what is inside have their own meaning
            return ast.BinOp(self.visit(node.left), node.op, node.right)
        return ast.BinOp(self.visit(node.left), node.op, self.visit(node.right))

    def visit_Name(self, node: ast.Name) -> ast.Name:  # the visitor's name for it
        return ast.Name(meant_by(node.id).name)


def parse_model(
    text: str,
    setting: Setting | None = None,
    values: Mapping[str, ArrayLike] = MappingProxyType({}),
) -> Model:
    """A model from its name, or from names joined by `>>` (series) and `+` (parallel).

    `machine @ effect` is an effect inside a machine, at its first port of the effect's kind, and
    `machine @ port.effect` at a port by name: "oscillator @ cubic_stiffness".

    `@` binds tighter than `+`, and `+` tighter than `>>`; parentheses group.  A name alone is a
    model; that of an effect is the effect on an actuator that otherwise follows its drive in
    proportion, `gain >> resonance`.
    The field's other words lead to these names: "Bouc-Wen", "Prandtl-Ishlinskii", "Kelvin-Voigt".

    Creep is one physical process with several laws.  The model `creep`, alone, is its power law
    k_c s^-μ, drive to response, as the papers identify it.  In a composition the name means the
    effect, which is added to a model that has gains already: the logarithmic law, or by its form
    `kelvin_voigt` a few relaxations.  `coupled` is foh followed by the power law.

    In a composition, effects are of their typical size for `setting`.  An effect with several forms
    is taken in the first, or, if another block follows in series, in the first that acts on the
    drive, or in the one that has the parameters in `values`.

    Args:
        text: The name or composition, such as "foh >> creep + resonance".
        setting: Ranges of the recordings, which set the typical size of effects and the radii of
            play operators; None for a common stack.
        values: Values of the model's parameters by name, as in `Model.parameters`, which select the
            form of an effect.

    Returns:
        The model at its nominal parameters.

    Raises:
        InputError: When a name is unknown or the text is no composition of names.
    """
    require_kind(text, str, "model", 'give a name such as "foh >> creep"')
    words = [*MODELS, *EFFECTS, *(w for w, a in ALIASES.items() if a.name in MODELS | EFFECTS)]

    def error(actual: str, similar: str = "") -> InputError:
        return InputError(
            f'model "{text}": expected names joined by >> and +, found {actual}{similar}; the '
            f"models are {', '.join(MODELS)} and the effects {', '.join(EFFECTS)}; inside a "
            f"machine, after @, they are {', '.join(INSIDE)}"
        )

    def build(
        node: ast.expr, own: Mapping[str, ArrayLike], path: str = "", ahead: bool = False
    ) -> AbstractBlock:
        match node:
            case ast.BinOp(_, ast.MatMult(), _):
                return within(node, own, path)
            case ast.BinOp(left, ast.RShift(), right):
                first = build(left, own, f"{path}first.", True)
                return first >> build(right, own, f"{path}second.", ahead)
            case ast.BinOp(left, ast.Add(), right):
                return build(left, own, f"{path}first.") + build(right, own, f"{path}second.")
            case ast.Name(word):
                name = meant_by(word).name
                if name in EFFECTS and node is not whole:
                    here = {n.removeprefix(path): v for n, v in own.items() if n.startswith(path)}
                    return _typical_effect(word, setting, here, ahead)
                if name in SIZED:
                    return SIZED[name](setting or ORDINARY)
                if name in MODELS:
                    return MODELS[name]()
                raise error(f'"{word}"', closest(word, words))
        raise error(f'"{ast.unparse(node)}"')

    def within(node: ast.expr, own: Mapping[str, ArrayLike], path: str) -> AbstractBlock:
        words: list[ast.expr] = []
        while isinstance(node, ast.BinOp) and isinstance(node.op, ast.MatMult):
            words.insert(0, node.right)
            node = node.left
        machine = build(node, own, f"{path}machine.")
        if not isinstance(machine, AbstractMachine):
            raise error(f'"{ast.unparse(node)}" before @, which has no ports')
        block = Within(machine)
        for k, word in enumerate(words):
            match word:
                case ast.Name(name):
                    port = ""
                case ast.Attribute(ast.Name(port), name):
                    pass
                case _:
                    raise error(f'"{ast.unparse(word)}" after @')
            if name not in INSIDE:
                raise error(f'"{name}" after @', closest(name, INSIDE))
            ports = machine.ports()
            if port and port not in ports:
                raise error(f'"{port}" after @, where the ports are {", ".join(ports) or "none"}')
            prefix = f"{path}effects.{k}."
            here = {n.removeprefix(prefix): v for n, v in own.items() if n.startswith(prefix)}
            effect = _typical_inside(name, setting or ORDINARY, here)
            block = block.at(port, effect) if port else block @ effect
        return block

    try:
        whole = ast.parse(spelt(text), mode="eval").body
        if isinstance(whole, ast.Name) and _is_effect(whole.id):
            whole = ast.parse(_alone(whole.id), mode="eval").body
        block = build(whole, {})
        if values:
            # The names of the blocks do not depend on their forms, which the values select.
            prefixes = prefixes_of(block)
            block = build(whole, {_placed(name, prefixes): v for name, v in values.items()})
        return Model(block, ast.unparse(_AsNamed().visit(whole)))
    except InputError:
        raise
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise error("something else") from None


def _is_effect(word: str) -> bool:
    """Whether a word that stands alone means an effect, or a form of one, and no model."""
    name, form = meant_by(word)
    return name in EFFECTS and (bool(form) or name not in MODELS)


def _alone(word: str) -> str:
    """The model of an effect alone: inserted at its site into a proportional actuator."""
    site = EFFECTS[meant_by(word).name].site
    return {"drive": f"{word} >> gain", "additive": f"gain + {word}"}.get(site, f"gain >> {word}")


def _placed(name: str, prefixes: Mapping[str, str]) -> str:
    """The place of a parameter given by its block's name or by its place."""
    places = [(place, shown) for place, shown in prefixes.items() if name.startswith(shown)]
    place, shown = places[0] if places and all(prefixes.values()) else ("", "")
    return place + name.removeprefix(shown)
