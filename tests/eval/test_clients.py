"""The examples of docs/clients.md: each runs where its library is installed."""

import pytest

from eval.clients import CLIENTS_PAGE, Client, clients

CLIENTS = clients()


def test_the_page_has_an_example_of_each() -> None:
    names = [client.name for client in CLIENTS]
    assert names == [
        *("stable-baselines3", "torchrl", "skrl", "rsl_rl", "tianshou", "RLlib", "CleanRL")
    ]
    assert CLIENTS_PAGE.read_text().count("```python") == len(names)
    for client in CLIENTS:
        assert client.code.count("\n") < 30, client.name


@pytest.mark.slow
@pytest.mark.parametrize("client", CLIENTS, ids=lambda client: client.name)
def test_it_runs(client: Client) -> None:
    if reason := client.lacks():
        pytest.skip(f"{client.name}: {reason}")
    assert client.run() > 10.0
