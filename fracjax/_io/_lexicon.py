"""The words that files write, as `words.toml` lists them."""

import tomllib
from pathlib import Path


def _read() -> dict[str, dict[str, tuple[str, ...]]]:
    sections = tomllib.loads(Path(__file__).with_name("words.toml").read_text(encoding="utf-8"))
    return {
        section: {key: tuple(words.split()) for key, words in entries.items()}
        for section, entries in sections.items()
    }


WORDS = _read()
"""By section and key; the file says what each means."""


def by_word(section: str) -> dict[str, str]:
    """The key of each word of a section."""
    return {word: key for key, words in WORDS[section].items() for word in words}
