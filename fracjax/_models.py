"""Models by name, and their composition in text: "foh >> creep + resonance"."""

from __future__ import annotations

import ast
from collections.abc import Callable, Hashable, Mapping
from types import MappingProxyType
from typing import Any

import equinox as eqx
import jax
import numpy as np
from jax.typing import ArrayLike

from ._aliases import ALIASES, meant_by, spelt
from ._blocks import (
    EFFECTS,
    FOH,
    LFDH,
    AbstractBlock,
    BoucWen,
    Creep,
    Gain,
    PEADynamics,
    PrandtlIshlinskii,
    Setting,
)
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


def coupled() -> AbstractBlock:
    """FOH, then fractional creep, whose gain merges into FOH's [F §2.5]: six parameters."""
    return FOH() >> Creep(fixed_gain=True)


def coupled_model_1() -> AbstractBlock:
    """Coupled Model-1 [F §4.4]: NBW, then the creep that TFOCIM identifies.

    TFOCIM draws one straight line through the amplitude ratios, so its creep is s^-μ [F 11].
    """
    return BoucWen() >> Creep(fixed_gain=True)


def coupled_model_2() -> AbstractBlock:
    """Coupled Model-2 [F §4.4]: NBW, then the creep that OFOCIM identifies.

    OFOCIM fits creep and dynamics together, so its creep is (k_p + a s^μ)/(m s² + …) [F 20].  The
    paper does not say whether the dynamics then stay in the cascade.  Here they do, because they
    were identified together with the creep, and at the 1 Hz of the paper's Table 4 they change
    nothing.  The paper's count of six parameters suggests that only the creep stayed: that model is
    `coupled`, of order -μ.
    """
    return BoucWen() >> PEADynamics(fixed_gain=True)


def coupled_model_3() -> AbstractBlock:
    """Coupled Model-3 [F §4.4]: FOH, then the creep that OFOCIM identifies, as in Model-2."""
    return FOH() >> PEADynamics(fixed_gain=True)


ORDINARY = Setting(
    drive_low=0.0,
    drive_high=100.0,
    response_span=10.0,
    step=1e-3,
    duration=10.0,
    top_frequency=10.0,
    top_rate=1e3,
    rms_rate=500.0,
    response_low=0.0,
    resolution=1e-3,
)
"""The setting of a common piezo stack (100 V, 10 µm), by which models and effects are sized that
are named without a recording; chosen by judgement."""

_AT_ONCE = 0.7
"""The share of a typical response that follows the drive without memory; chosen by judgement."""


def prandtl_ishlinskii(setting: Setting = ORDINARY) -> AbstractBlock:
    """Prandtl–Ishlinskii plays over the setting's drive, weighted as in a typical loop.

    Source: Al Janaideh, Rakheja & Su, IEEE/ASME Trans. Mechatronics 16 (2011) 734.
    """
    shares = np.append(_AT_ONCE, np.full(12, (1 - _AT_ONCE) / 12))
    slope = setting.response_span / setting.drive_span
    return PrandtlIshlinskii(slope * shares, low=setting.drive_low, high=setting.drive_high)


SIZED = {"prandtl_ishlinskii": prandtl_ishlinskii}
"""Models whose size follows the recordings."""
"""The models whose blocks depend on the range of the drive, each with a function of the setting."""

MODELS: dict[str, Callable[[], AbstractBlock]] = {
    "foh": FOH,
    "lfdh": LFDH,
    "creep": Creep,
    "coupled": coupled,
    "bouc_wen": BoucWen,
    **SIZED,
    "pea_dynamics": PEADynamics,
    "gain": Gain,
    "coupled_model_1": coupled_model_1,
    "coupled_model_2": coupled_model_2,
    "coupled_model_3": coupled_model_3,
}
"""The models by name, each with a function that makes its block at nominal parameters."""


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


def _shapes(block: AbstractBlock) -> dict[str, tuple[int, ...]]:
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

    def visit_Name(self, node: ast.Name) -> ast.Name:  # the visitor's name for it
        return ast.Name(meant_by(node.id).name)


def parse_model(
    text: str,
    setting: Setting | None = None,
    values: Mapping[str, ArrayLike] = MappingProxyType({}),
) -> Model:
    """A model from its name, or from names joined by `>>` (series) and `+` (parallel).

    `+` binds tighter than `>>`; parentheses group.  A name alone is a model; that of an effect is
    the effect on an actuator that otherwise follows its drive in proportion, `gain >> resonance`.
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
            f"models are {', '.join(MODELS)} and the effects {', '.join(EFFECTS)}"
        )

    def build(
        node: ast.expr, own: Mapping[str, ArrayLike], path: str = "", ahead: bool = False
    ) -> AbstractBlock:
        match node:
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
