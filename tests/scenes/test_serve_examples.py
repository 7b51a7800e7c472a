"""The examples of docs/serve.md do to a server what the page has them do."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from tests.served import TOKEN, serve
from tests.timeouts import TIMEOUT

PAGE = Path(__file__).parents[2] / "docs" / "serve.md"


def test_the_examples_of_the_page_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    by_websocket, by_osc, joining = re.findall(
        r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("DIGICLAY_SERVE_TOKEN", TOKEN)
    with serve(tmp_path) as one:
        monkeypatch.setenv("DIGICLAY_SERVE", f"ws://127.0.0.1:{one.port}")
        monkeypatch.setenv("DIGICLAY_SERVE_OSC", str(one.osc_port))
        exec(by_websocket, {})
        exec(by_osc, {})
        with one.connect() as client:  # the pose by OSC is the last one
            client.recv(TIMEOUT)
            while json.loads(client.recv(TIMEOUT))["position"][2] != pytest.approx(0.038, abs=1e-8):
                pass
        assert one.stop()["counts"]["poses"] == 101
    said = capsys.readouterr().out
    assert said.startswith("9 x 9 pins\ntotal force: ")
    assert float(said.split()[-2]) > 0.0
    exec(joining, {})
