"""Who may reach the page: this machine, by its own name, with the token, from the page itself."""

import http.client
import socket

import pytest


def status(served, path: str, **headers: str) -> int:
    host, port = served.host.split(":")
    connection = http.client.HTTPConnection(host, int(port), timeout=30)
    connection.request("GET", path, headers=headers)
    response = connection.getresponse()
    response.read()
    connection.close()
    return response.status


def handshake(served, **headers: str) -> int:
    """The status of an attempt to open the page's socket."""
    return status(
        served,
        "/ws",
        **{
            "Connection": "Upgrade",
            "Upgrade": "websocket",
            "Sec-WebSocket-Version": "13",
            "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
            "Sec-WebSocket-Protocol": "bokeh, none",
            **headers,
        },
    )


@pytest.mark.parametrize(
    "path", ["/", "/?token=", "/?token=guessed", "/autoload.js?bokeh-autoload-element=x"]
)
def test_without_the_token_it_is_forbidden(served, path):
    assert status(served, path) == 403


def test_with_the_token_it_opens(served):
    assert status(served, f"/?token={served.token}") == 200
    assert status(served, "/", Cookie=f"fracjax_token={served.token}") == 200


def test_something_is_painted_before_the_scripts_come(served):
    connection = http.client.HTTPConnection(served.host, timeout=30)
    connection.request("GET", f"/?token={served.token}")
    page = connection.getresponse().read().decode()
    connection.close()
    assert page.count("bokeh.min.js") == 1
    assert page.index("fracjax is starting.") < page.index("bokeh.min.js")
    assert "<script" not in page[: page.index("fracjax is starting.")]


def test_by_another_name_it_is_forbidden(served):
    """As a foreign page would try that has its own name lead to 127.0.0.1."""
    assert status(served, f"/?token={served.token}", Host="evil.example") == 403


def test_a_foreign_origin_gets_no_socket(served):
    cookie = f"fracjax_token={served.token}"
    assert handshake(served, Cookie=cookie, Origin="http://evil.example") == 403
    assert handshake(served, Origin=f"http://{served.host}") == 403
    assert handshake(served, Cookie=cookie, Origin=f"http://{served.host}") == 101


def test_it_listens_on_this_machine_alone(served):
    port = int(served.host.split(":")[1])
    addresses = {each.getsockname() for each in served.server._http._sockets.values()}
    assert addresses == {("127.0.0.1", port)}
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.connect(("192.0.2.1", 9))  # nothing is sent
            outward = probe.getsockname()[0]
    except OSError:
        pytest.skip("this machine has no other address")
    with pytest.raises(OSError, match=r"refused|timed out"):
        socket.create_connection((outward, port), timeout=5).close()
