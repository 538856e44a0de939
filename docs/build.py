"""The API documentation, from docstrings, as HTML that needs no network.

Run: python docs/build.py DIR

Anything that is not right ends it: a warning, or a public name without a description.
"""

from __future__ import annotations

import argparse
import inspect
import sys
import warnings
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType

import pdoc
import pdoc.render
from pdoc.doc import Class, Function, Module

import fracjax

PAGES = ("blocks", "operators")


def page(name: str) -> ModuleType:
    """A module of the package under its public name, with all that it offers."""
    offered = getattr(fracjax, name)
    shown = ModuleType(f"fracjax.{name}", offered.__doc__)
    members = {key: getattr(offered, key) for key in dir(offered) if key[0] != "_"}
    members = {key: it for key, it in members.items() if not isinstance(it, ModuleType)}
    vars(shown).update(members, __all__=sorted(members), __spec__=ModuleSpec(shown.__name__, None))
    return shown


def prepare() -> None:
    """Put everything where pdoc looks: the package loads its names on first use."""
    for name in fracjax.__all__:
        setattr(fracjax, name, page(name) if name in PAGES else getattr(fracjax, name))
    sys.modules.update({f"fracjax.{name}": getattr(fracjax, name) for name in PAGES})


def undescribed(module: Module) -> list[str]:
    """Public functions, classes and their own methods that no docstring describes."""
    found = list(module.members.values())
    found += [own for it in found if isinstance(it, Class) for own in it.own_members]
    return [
        member.fullname
        for member in found
        if isinstance(member, Class | Function)
        and not (member.docstring.strip() or member.name.startswith("_"))
    ]


def main(folder: Path) -> None:
    """Write the pages into a folder."""
    warnings.simplefilter("error")
    # A type that is imported for type checkers alone is shown as it is written.
    warnings.filterwarnings("ignore", "Error parsing type annotation", UserWarning)
    # Once a day, on import of 0.23.
    warnings.filterwarnings("ignore", r"\nArviZ is undergoing a major refactor", FutureWarning)
    # The installed package is meant, wherever this is run.
    warnings.filterwarnings("ignore", "'fracjax' may refer to either", RuntimeWarning)
    prepare()
    modules = [Module(sys.modules[name]) for name in ("fracjax", *(f"fracjax.{p}" for p in PAGES))]
    missing = [name for module in modules for name in undescribed(module)]
    if missing:
        sys.exit(f"Without a description: {', '.join(missing)}.")
    pdoc.render.configure(
        docformat="markdown", show_source=False, footer_text=f"fracjax {fracjax.__version__}"
    )
    pdoc.pdoc("fracjax", output_directory=folder)
    print(f"Written: {folder}/index.html")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=inspect.cleandoc(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path, metavar="DIR")
    main(parser.parse_args().folder)
