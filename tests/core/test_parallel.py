"""Calls in threads."""

import threading

import pytest

from jaxrotor.core import parallel


def test_ctrl_c_does_not_wait_for_calls_under_way(monkeypatch):
    monkeypatch.setattr(parallel, "cores", lambda workers: 2)
    released, ended = threading.Event(), []

    def call(value):
        if value == 0:
            raise KeyboardInterrupt
        released.wait(30)
        ended.append(value)

    with pytest.raises(KeyboardInterrupt):
        parallel.in_threads(call, [0, 1])
    assert not ended
    released.set()
