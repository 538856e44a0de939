"""The page, served in a thread."""

import asyncio
from collections.abc import Iterator
from pathlib import Path
from threading import Event, Thread
from types import SimpleNamespace

import pytest

from fracjax._app._server import server_for


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[SimpleNamespace]:
    """The server's address, host with port, token and folder."""
    folder = tmp_path_factory.mktemp("folder")
    one = SimpleNamespace(folder=Path(folder))
    ready = Event()

    def run() -> None:
        asyncio.set_event_loop(asyncio.new_event_loop())
        one.server, one.address = server_for(folder)
        one.server.start()
        one.server.io_loop.add_callback(ready.set)
        one.server.io_loop.start()

    thread = Thread(target=run, daemon=True)
    thread.start()
    assert ready.wait(60)
    one.host = one.address.split("/")[2]
    one.token = one.address.rpartition("=")[2]
    yield one
    one.server.io_loop.add_callback(one.server.io_loop.stop)
    thread.join(30)
