"""The API documentation, from docstrings with Google sections, as HTML that needs no network.

Run: python docs/build.py DIR

It stops at any warning and at a public name without a description.
"""

from __future__ import annotations

import argparse
import inspect
import re
import sys
import warnings
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType

import pdoc
import pdoc.docstrings
import pdoc.render
from pdoc.doc import Class, Function, Module

import fracjax

PAGES = ("blocks", "operators")
SECTIONS = ("Args", "Attributes", "Raises", "Returns", "Yields")


def page(name: str) -> ModuleType:
    """A module of the package under its public name, with all its public members."""
    module = getattr(fracjax, name)
    public = ModuleType(f"fracjax.{name}", module.__doc__)
    members = {key: getattr(module, key) for key in dir(module) if key[0] != "_"}
    members = {key: it for key, it in members.items() if not isinstance(it, ModuleType)}
    spec = ModuleSpec(public.__name__, None)
    vars(public).update(members, __all__=sorted(members), __spec__=spec)
    return public


def prepare() -> None:
    """Put all names where pdoc searches for them, because the package loads them on first use."""
    for name in fracjax.__all__:
        setattr(fracjax, name, page(name) if name in PAGES else getattr(fracjax, name))
    sys.modules.update({f"fracjax.{name}": getattr(fracjax, name) for name in PAGES})


def with_sections(docstring: str) -> str:
    """A docstring in which pdoc takes no other line than those of `SECTIONS` for a heading.

    It would take any line of words that ends in a colon before an indented one, such as a sentence
    before its equation; a space after the colon prevents that.
    """
    return re.sub(rf"^(?!(?:{'|'.join(SECTIONS)}):$)(.+:)$", r"\1 ", docstring, flags=re.MULTILINE)


def undescribed(module: Module) -> list[str]:
    """Public functions, classes and their own methods without a docstring."""
    members = list(module.members.values())
    members += [own for it in members if isinstance(it, Class) for own in it.own_members]
    return [
        member.fullname
        for member in members
        if isinstance(member, Class | Function)
        and not (member.docstring.strip() or member.name.startswith("_"))
    ]


def main(folder: Path) -> None:
    """Write the pages into a folder."""
    warnings.simplefilter("error")
    # A type that is imported only for type checkers is shown as text.
    warnings.filterwarnings("ignore", "Error parsing type annotation", UserWarning)
    # ArviZ 0.23 warns once a day when it is imported.
    warnings.filterwarnings("ignore", r"\nArviZ is undergoing a major refactor", FutureWarning)
    # The documentation is that of the installed package, in any folder.
    warnings.filterwarnings("ignore", "'fracjax' may refer to either", RuntimeWarning)
    prepare()
    modules = [Module(sys.modules[name]) for name in ("fracjax", *(f"fracjax.{p}" for p in PAGES))]
    missing = [name for module in modules for name in undescribed(module)]
    if missing:
        sys.exit(f"Without a description: {', '.join(missing)}.")
    convert = pdoc.docstrings.convert
    pdoc.docstrings.convert = lambda text, *others: convert(with_sections(text), *others)
    pdoc.render.configure(
        docformat="google", show_source=False, footer_text=f"fracjax {fracjax.__version__}"
    )
    pdoc.pdoc("fracjax", output_directory=folder)
    print(f"Written: {folder}/index.html")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=inspect.cleandoc(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path, metavar="DIR")
    main(parser.parse_args().folder)
