"""What a user meets by name: it exists, says what it is, in which unit, and where it is from."""

import inspect
import re
import subprocess
import sys
from types import ModuleType
from typing import get_origin

import pytest

import fracjax
from fracjax import blocks, operators
from fracjax._blocks import EFFECTS, AbstractBlock
from fracjax._models import MODELS, ORDINARY
from fracjax._recording import unit

UNIT = re.compile(r"\[[^\]\s][^\]]*\]|\bunits?\b|\bdimensionless\b")
SOURCE = re.compile(r"^\s*Source: \S.{10,}", re.MULTILINE)

WITHOUT_QUANTITIES = {
    "blocks": "a module",
    "operators": "a module",
    "InputError": "a sentence",
    "linear_gains": "from a block to names",
    "Model": "a block and its name",
    "parse_model": "from text to a model",
    "load_model": "from a file to a model",
    "load_compensation": "from a file to a result that says its units",
    "load_posterior": "from a folder to a result that says its units",
    "write_report": "from a result to a file",
    "MeasuredNoise": "has no argument",
    "StudentNoise": "has no argument",
    "sample_posterior": "from a fit to a result that says its units",
}


def public(module: ModuleType) -> dict[str, object]:
    """What a module offers by name, modules within it left out."""
    members = {name: getattr(module, name) for name in dir(module) if name[0] != "_"}
    return {name: it for name, it in members.items() if not isinstance(it, ModuleType)}


LAWS = [
    block
    for block in public(blocks).values()
    if inspect.isclass(block) and issubclass(block, AbstractBlock) and not inspect.isabstract(block)
]
CALLABLES = [
    (module, name)
    for module in (fracjax, blocks, operators)
    for name, it in public(module).items()
    if callable(it) and get_origin(it) is None  # no Literal of names
]


@pytest.mark.parametrize("name", fracjax.__all__)
def test_every_name_is_there_and_documented(name):
    found = getattr(fracjax, name)
    assert isinstance(found, dict | tuple) or (found.__doc__ or "").strip()


def test_no_other_name_is_offered():
    assert dir(fracjax) == sorted(fracjax.__all__)
    assert len(fracjax.__all__) == len(set(fracjax.__all__))
    assert not [name for name in fracjax.__all__ if name.startswith("_")]
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        fracjax.nothing  # noqa: B018


def test_a_star_import_gives_the_same_names():
    script = "from fracjax import *; import fracjax; assert set(fracjax.__all__) <= set(dir())"
    subprocess.run([sys.executable, "-c", script], check=True, timeout=120)


@pytest.mark.parametrize(("module", "name"), CALLABLES, ids=lambda it: getattr(it, "__name__", it))
def test_everything_callable_says_its_units(module, name):
    doc = inspect.getdoc(getattr(module, name)) or ""
    assert bool(UNIT.search(doc)) or name in WITHOUT_QUANTITIES, doc


@pytest.mark.parametrize("name", WITHOUT_QUANTITIES)
def test_no_exception_is_out_of_date(name):
    found = getattr(fracjax if name in fracjax.__all__ else blocks, name)
    assert not UNIT.search(inspect.getdoc(found) or "")


FUNCTIONS = [(m, n) for m, n in CALLABLES if inspect.isfunction(getattr(m, n)) and m is not blocks]


@pytest.mark.parametrize(("module", "name"), FUNCTIONS, ids=lambda it: getattr(it, "__name__", it))
def test_every_argument_and_result_is_described(module, name):
    function = getattr(module, name)
    _, _, sections = (inspect.getdoc(function) or "").partition("Args:")
    parameters = inspect.signature(function).parameters
    described = set(re.findall(r"^    (?:\*\*)?(\w+):", sections, re.MULTILINE))
    assert set(parameters) <= described
    assert inspect.signature(function).return_annotation in ("None", None) or "Returns:" in sections


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.__name__)
def test_every_law_has_a_source(law):
    assert SOURCE.search(inspect.getdoc(law) or "")


def test_every_model_and_effect_is_made_of_such_laws():
    def parts(block: AbstractBlock) -> list[AbstractBlock]:
        pair = [getattr(block, side) for side in ("first", "second") if hasattr(block, side)]
        return [part for half in pair for part in parts(half)] if pair else [block]

    made = [make() for make in MODELS.values()]
    made += [trial for e in EFFECTS.values() for trial in e.trials(ORDINARY)]
    assert {type(part) for block in made for part in parts(block)} <= set(LAWS)


@pytest.mark.parametrize("name", MODELS)
def test_every_model_has_a_source(name):
    doc = inspect.getdoc(MODELS[name]) or ""
    assert SOURCE.search(doc) or re.search(r"\[[LF] ", doc)


@pytest.mark.parametrize("name", EFFECTS)
def test_every_effect_has_a_source(name):
    assert re.search(r"\d{4}", EFFECTS[name].source)


def test_every_parameter_has_a_unit_that_is_one():
    """Of drive and response, of a quantity, or to a power that another parameter is."""
    made = [make() for make in MODELS.values()]
    made += [effect.trials(ORDINARY)[0] for effect in EFFECTS.values()]
    for block in made:
        parameters = fracjax.Model(block).parameters
        known = {"drive", "response"} | {name.rpartition(".")[2] for name in parameters}
        for parameter in parameters.values():
            for word in set(re.findall(r"[a-zA-Zµ]\w*", parameter.unit)) - known:
                unit(word)
