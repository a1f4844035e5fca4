"""The examples of docs/clients.md: each runs where its library is installed."""

import pytest

from eval.clients import clients

CLIENTS = clients()


@pytest.mark.slow
@pytest.mark.parametrize("client", CLIENTS, ids=lambda client: client.name)
def test_it_runs(client):
    if reason := client.lacks():
        pytest.skip(f"{client.name}: {reason}")
    assert client.run() > 10.0
