"""Real recordings by name: the local copy, the origin, and what is said where there is neither."""

import hashlib
import re
import shutil
from pathlib import Path

import pooch
import pytest
import requests

import fracjax
from fracjax._registry import RECORDINGS, _registry, fetch_recording

NAME = "piezo_dbo/Model_Vi_Do.dat"
TABLE = (Path(fracjax.__file__).parent / "_registry" / "recordings.txt").read_text(encoding="utf-8")
ROWS = [line.split() for line in TABLE.splitlines() if line and line[0] != "#"]


@pytest.fixture
def online(monkeypatch, tmp_path):
    """No local copy, an empty cache, and an origin that answers with what is put here."""
    monkeypatch.delenv("FRACJAX_DATA", raising=False)
    monkeypatch.setattr(_registry._ORIGIN, "path", tmp_path / "cache")
    origin: dict[str, bytes | Exception] = {}
    asked: list[str] = []

    def downloader(url, target, _):
        asked.append(url)
        answer = origin[url]
        if isinstance(answer, Exception):
            raise answer
        Path(target).write_bytes(answer)

    monkeypatch.setattr(pooch.core, "choose_downloader", lambda *_, **__: downloader)
    return origin, asked


@pytest.fixture
def known(monkeypatch) -> bytes:
    """The bytes that the registry is made to expect under NAME."""
    content = b"0 1\n" * 40
    digest = hashlib.sha256(content).hexdigest()
    monkeypatch.setitem(_registry._ORIGIN.registry, NAME, digest)
    return content


def refusal(name: str) -> str:
    with pytest.raises(fracjax.InputError) as caught:
        fetch_recording(name)
    assert "\n" not in str(caught.value)
    return str(caught.value)


# The table ----------------------------------------------------------------------------------------


def test_every_recording_has_a_digest_and_an_address_that_cannot_change():
    assert [row[0] for row in ROWS] == list(RECORDINGS)
    for name, digest, url in ROWS:
        assert re.fullmatch(r"[0-9a-f]{64}", digest)
        assert re.fullmatch(r"https://raw\.githubusercontent\.com/[^/]+/[^/]+/[0-9a-f]{40}/.+", url)
        assert Path(url).name == Path(name).name
    assert len({row[1] for row in ROWS}) == len(ROWS)


def test_every_folder_names_its_licence():
    for folder in {name.partition("/")[0] for name in RECORDINGS}:
        about = TABLE[TABLE.index(f"# {folder}. ") :].splitlines()[:2]
        assert re.search(r"(MIT|CC BY 4\.0), Copyright", about[1])


def test_the_public_names_are_these():
    assert fracjax.RECORDINGS is RECORDINGS
    assert fracjax.fetch_recording is fetch_recording


# A local copy -------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", RECORDINGS)
def test_the_local_copy_is_the_origin_s(data_folder, monkeypatch, name):
    monkeypatch.setenv("FRACJAX_DATA", str(data_folder))
    assert fetch_recording(name) == data_folder / name


def test_a_local_copy_is_used_as_it_is(tmp_path, monkeypatch, known, online):
    monkeypatch.setenv("FRACJAX_DATA", str(tmp_path))
    path = tmp_path / NAME
    path.parent.mkdir()
    path.write_bytes(known)
    assert fetch_recording(NAME) == path
    path.write_bytes(known + b" ")
    said = refusal(NAME)
    assert said.startswith(f"{path}: expected a file of SHA-256 {_registry._ORIGIN.registry[NAME]}")
    assert "copy it again from https://" in said
    path.unlink()
    assert "found no such file; copy it from https://" in refusal(NAME)
    assert online[1] == []


def test_a_name_of_no_recording():
    said = refusal("piezo_dbo/nothing.dat")
    assert 'found "piezo_dbo/nothing.dat"; give one of piezo_dbo/Model_Vi_Do.dat, Test' in said
    assert "mr_damper/ensaio.A.1.mat" in said


# The origin ---------------------------------------------------------------------------------------


def test_the_origin_is_asked_once(online, known):
    origin, asked = online
    url = _registry._ORIGIN.get_url(NAME)
    origin[url] = known
    for _ in range(2):
        assert fetch_recording(NAME).read_bytes() == known
    assert asked == [url]
    shutil.rmtree(_registry._ORIGIN.path)
    fetch_recording(NAME)
    assert asked == [url, url]


@pytest.mark.parametrize(
    "failure",
    [
        requests.ConnectionError("no route"),
        requests.HTTPError("404"),
        requests.Timeout("late"),
        PermissionError(13, "denied"),
    ],
)
def test_offline_one_sentence_names_the_remedy(online, failure):
    origin, _ = online
    origin[_registry._ORIGIN.get_url(NAME)] = failure
    said = refusal(NAME)
    assert said.startswith(f"{NAME}: expected the recording from https://")
    assert type(failure).__name__ in said
    assert said.endswith("or name a local copy of the recordings' folders in FRACJAX_DATA.")


def test_a_download_of_other_bytes_is_refused_and_not_kept(online):
    origin, _ = online
    origin[_registry._ORIGIN.get_url(NAME)] = b"an error page"
    assert "found another file; try again" in refusal(NAME)
    assert not (Path(_registry._ORIGIN.path) / NAME).exists()
