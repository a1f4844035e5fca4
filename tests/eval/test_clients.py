"""The examples of docs/clients.md: each runs where its library is installed."""

import pytest

from eval.clients import clients, timed

pytestmark = pytest.mark.usefixtures("registries")


@pytest.mark.slow
@pytest.mark.parametrize("client", clients(), ids=lambda client: client.name)
def test_it_runs(client, tmp_path, monkeypatch, capsys):
    pytest.importorskip(client.module, reason=f"{client.name} is not installed")
    monkeypatch.chdir(tmp_path)
    timed(client.code)
    assert float(capsys.readouterr().out.split()[-1]) > 10.0  # frames per second
