"""The folder of the page: no file from elsewhere, none too large, none overwritten."""

import numpy as np
import pytest

from fracjax import read, write
from fracjax._app import _workspace
from fracjax._app._texts import command_line, python_code
from fracjax._app._workspace import Workspace
from fracjax._cli._main import cli
from fracjax._recording import InputError


@pytest.fixture
def workspace(tmp_path) -> Workspace:
    folder = tmp_path / "folder"
    folder.mkdir()
    times = np.arange(64) * 0.01
    signal = np.sin(9 * times)
    for name in ("a.csv", "b.csv", "c.csv"):
        columns = {"time_s": times, "voltage_V": signal, "displacement_um": 2 * signal}
        write(folder / name, columns)
    (folder / "notes.md").write_text("no recording")
    return Workspace(folder)


def test_files_outside_the_folder_are_out_of_reach(workspace):
    outside = workspace.folder.parent / "secret.csv"
    outside.write_text("time,a,b\n0,1,2\n")
    (workspace.folder / "link.csv").symlink_to(outside)
    assert workspace.names() == ["a.csv", "b.csv", "c.csv"]
    for name in ("../secret.csv", str(outside), "link.csv"):
        with pytest.raises(InputError, match="expected a file in"):
            workspace.path(name)


def test_an_upload_stays_in_the_folder(workspace):
    for name in ("../../up.csv", "..\\..\\up.csv", "/etc/up.csv"):
        workspace.add(name, b"x")
    assert (workspace.folder / "up.csv").read_bytes() == b"x"
    assert not (workspace.folder.parent / "up.csv").exists()


def test_uploads_are_bounded_and_overwrite_nothing(workspace, monkeypatch):
    monkeypatch.setattr(_workspace, "LARGEST", 10)
    with pytest.raises(InputError, match="at most"):
        workspace.add("large.csv", b"x" * 11)
    with pytest.raises(InputError, match=r"\.exe"):
        workspace.add("tool.exe", b"x")
    before = (workspace.folder / "a.csv").read_bytes()
    with pytest.raises(InputError, match="a new name"):
        workspace.add("a.csv", b"other")
    assert (workspace.folder / "a.csv").read_bytes() == before
    workspace.add("a.csv", b"other", replace=True)
    assert (workspace.folder / "a.csv").read_bytes() == b"other"


def test_roles_columns_and_recordings(workspace):
    with pytest.raises(InputError, match="choose its role"):
        workspace.training()
    workspace.roles |= {"a.csv": "train", "b.csv": "held out"}
    workspace.options = {"output_unit": "nm"}
    (recording,) = workspace.training()
    assert recording.response_unit == "nm"
    assert workspace.columns("a.csv") == ["time_s", "voltage_V", "displacement_um"]
    assert [r.source for r in workspace.recordings("held out")] == [str(workspace.folder / "b.csv")]


def chosen(workspace: Workspace) -> Workspace:
    workspace.roles |= {"a.csv": "train", "b.csv": "held out", "c.csv": "repeat"}
    workspace.options = {"output": "displacement_um", "output_unit": "nm"}
    workspace.mask, workspace.noise = [(0.1, 0.2)], "3 nm"
    return workspace


@pytest.mark.parametrize("task", ["fit", "diagnose"])
def test_the_command_line_is_one_that_fracjax_takes(workspace, task):
    """Click itself parses it."""
    import shlex

    program, name, *arguments = shlex.split(command_line(chosen(workspace), task))
    assert (program, name) == ("fracjax", task)
    command = cli.commands[task]
    context = command.make_context(task, arguments)
    assert context.params["recordings"] == ("a.csv",)
    assert context.params["output_unit"] == "nm"
    assert context.params["mask"] == ("0.1 s..0.2 s",)


def test_the_python_does_what_was_chosen(workspace, monkeypatch):
    """It runs, with the functions of fracjax that compute replaced by ones that note."""
    import fracjax

    calls = {}
    monkeypatch.setattr(
        fracjax, "diagnose", lambda *given, **options: calls.update(given=given, **options)
    )
    monkeypatch.setattr(fracjax, "write_report", lambda *given: None)
    monkeypatch.chdir(workspace.folder)
    exec(python_code(chosen(workspace), "diagnose"), {})
    model, recording = calls["given"]
    assert (model, recording.source, recording.response_unit) == ("foh", "a.csv", "nm")
    assert calls["mask"] == [(0.1, 0.2)]
    assert calls["noise"] == "3 nm"
    assert calls["holdout"].source == "b.csv"
    monkeypatch.setattr(fracjax, "compare", lambda *given, **options: calls.update(given=given))
    exec(python_code(chosen(workspace), "fit"), {})
    assert calls["given"][0] == ["foh"]
    assert calls["repeat"].response == pytest.approx(read("c.csv", output_unit="nm").response)
